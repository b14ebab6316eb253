"""Candidate visits: poses over the workspace from both sides, under the loads, temperatures and speeds that matter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.effects import Library
from ptt.effects.cards import card_of
from ptt.machine import MachineFile
from ptt.plan.design import DesignColumns
from ptt.plan.space import Space, narrow_space
from ptt.plan.visits import Visit, both_ways
from ptt.run.problem import Problem

POSES = 160  # candidates under one condition, at most
PAYLOADS = (0.0, 2.5, 5.0)  # kg
WARMING = 5.0  # K between the cold and the warm part of a run, at least
FEEDS = (10.0, 50.0)  # mm/s
RANGED = ("from", "to")  # parameters of curves: the joint values between which they are defined
LOADED = {"load", "payload", "link force"}  # variables on effect cards that a payload changes


@dataclass(frozen=True)
class Conditions:
    """Conditions under which rows can be driven; an empty tuple where one does not matter.

    Attributes:
        payloads: kg.
        temps: degrees Celsius.
        feeds: mm/s.
    """

    payloads: tuple[float, ...] = ()
    temps: tuple[float, ...] = ()
    feeds: tuple[float, ...] = ()


def conditions_for(problem: Problem, known: Library, confused: Sequence[Sequence[str]]) -> Conditions:
    """Loads, temperatures and speeds that the confused effects depend on.

    Args:
        problem: the run.
        known: effects by name.
        confused: keys, step by step.

    Returns:
        The conditions.
    """
    classes = [known[key.partition("[")[0]] for step in confused if len(step) > 1 for key in step]
    requires = {need for cls in classes for need in cls.requires}
    telling = {word for cls in classes for word in (card_of(cls).telling, card_of(cls).shade)}
    table = problem.table
    loads: tuple[float, ...] = ()
    if "payload" in requires or telling & LOADED:
        seen = np.unique(np.round(_known(table.payload_kg, problem), 3))
        loads = tuple(sorted({float(value) for value in (*PAYLOADS, *_ends(seen))}))
    else:
        loads = tuple(float(value) for value in _known(table.payload_kg, problem)[-1:])
    temps: tuple[float, ...] = ()
    if "temperature" in requires and table.temp_c is not None:
        low, high = (float(end(table.temp_c[problem.used])) for end in (np.nanmin, np.nanmax))
        temps = (round(low, 1), round(max(high, low + WARMING), 1))
    feeds: tuple[float, ...] = ()
    if "speed" in requires:
        own = np.unique(_known(table.feed_mm_s, problem))
        feeds = tuple(float(value) for value in (_ends(own) if len(own) > 1 else FEEDS))
    return Conditions(loads, temps, feeds)


def make_pool(design: DesignColumns, space: Space, conditions: Conditions, random: np.random.Generator) -> list[Visit]:
    """Candidate visits under all conditions.

    Args:
        design: the columns; poses stay within the joint values at which its curves are defined.
        space: where the machine can go.
        conditions: loads, temperatures and speeds.
        random: generator of the poses.

    Returns:
        The visits.
    """
    nan = (float("nan"),)
    levels = [
        (payload, temp, feed)
        for payload in conditions.payloads or nan
        for temp in conditions.temps or nan
        for feed in conditions.feeds or nan
    ]
    visits = both_ways(_within(design, space), POSES, random)
    share = max(POSES // len(levels), min(POSES, 48))
    return [
        replace(visit, payload=payload, temp=temp, feed=feed)
        for payload, temp, feed in levels
        for visit in visits[:share]
    ]


def with_base(visits: Sequence[Visit], file: MachineFile) -> list[Visit]:
    """Add readings of the base reflectors before and after, where the machine has some.

    Args:
        visits: the rows.
        file: the machine.

    Returns:
        The visits with the readings of the base.
    """
    names = tuple(point.name for point in file.tracker.base_point)
    if not names or not visits:
        return list(visits)

    def read(beside: Visit, row: int) -> Visit:
        q = beside.q[row][None].expand(len(names), -1)
        return replace(beside, q=q, name=names, role="base")

    return [read(visits[0], 0), *visits, read(visits[-1], -1)]


def _known(column: np.ndarray | None, problem: Problem) -> np.ndarray:
    """Values of a context in the used rows that state it."""
    values = np.zeros(0) if column is None else np.asarray(column, dtype=float)[problem.used]
    return values[np.isfinite(values)]


def _ends(values: Sequence[float] | np.ndarray) -> tuple[float, ...]:
    return (float(values[0]), float(values[-1])) if len(values) else ()


def _within(design: DesignColumns, space: Space) -> Space:
    """The space, narrowed to the joint values at which all curves are defined."""
    lower, upper = space.lower, space.upper
    shapes = [rival.shape for rival in design.rivals]
    ranged = [(shape[RANGED[0]], shape[RANGED[1]]) for shape in shapes if RANGED[0] in shape]
    for term in design.fitted.layout.terms:
        if any(parameter.stem == RANGED[0] for parameter in term.effect.parameters):
            count = space.joints
            ranged.append((term.theta[-2 * count : -count], term.theta[-count:]))
    for low, high in ranged:
        lower, upper = torch.maximum(lower, low), torch.minimum(upper, high)
    return narrow_space(space, lower, upper) if ranged else space
