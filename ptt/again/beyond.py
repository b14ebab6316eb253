"""Heights that a model's curves never saw: how they go on there is uncertain, and no change of the machine."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from ptt.again.before import Before
from ptt.effects.shapes import SHAPES, smooth_shapes
from ptt.fitting.linear import LinearPoint, tried_sizes
from ptt.model.model import Term
from ptt.run.problem import Problem

BENDS = 4  # of what comes after an end; the next is a twentieth of the first
NEAR = 0.01  # share of a curve's range by which it may be left: its slope does less than a micrometre there


@dataclass(frozen=True)
class End:
    """One end of one joint's curve beyond which a run goes.

    Attributes:
        term: with the curve.
        joint: from 0.
        upper: whether it is the upper end.
        at: where the curve ends, mm.
        furthest: where the run goes, mm.
        range: length of the curve, mm.
    """

    term: Term
    joint: int
    upper: bool
    at: float
    furthest: float
    range: float


def ends_left(before: Before, problem: Problem) -> Iterator[End]:
    """Ends of the model's curves beyond which a run has readings.

    Args:
        before: the solved model.
        problem: the run.

    Yields:
        Each end.
    """
    q = problem.view.q[torch.as_tensor(problem.used)]
    for term in before.layout.terms:
        shape = given_of(term, problem.view.joints)
        if term.effect.key in before.cured or not {"from", "to"} <= shape.keys():
            continue
        for joint in range(q.shape[1]):
            low, high = float(shape["from"][joint]), float(shape["to"][joint])
            least, most = float(q[:, joint].min()), float(q[:, joint].max())
            if most > high + NEAR * (high - low):
                yield End(term, joint, True, high, most, high - low)
            if least < low - NEAR * (high - low):
                yield End(term, joint, False, low, least, high - low)


def given_of(term: Term, joints: int) -> dict[str, torch.Tensor]:
    """Searched and given parameters of a term by their stems."""
    found, start = dict[str, torch.Tensor](), 0
    for parameter in term.effect.parameters:
        size = parameter.size(joints)
        if parameter.role != "linear":
            found[parameter.stem] = term.theta[start : start + size]
        start += size
    return found


def columns_beyond(before: Before, at: LinearPoint, problem: Problem) -> np.ndarray:
    """How curves may go on beyond the heights that their run visited, (n, 3, c) whitened, each as far as is usual.

    A curve has a slope that wanders at random along the axis, so beyond its end its slope is as uncertain as at the
    end, and its bends grow with the power 3/2 of the length (as in `screw-error-map`).

    Args:
        before: the solved model.
        at: where columns come from.
        problem: the run, n rows.
    """
    parts = [_going_on(end, at, problem) for end in ends_left(before, problem)]
    return np.concatenate([np.zeros((problem.table.rows, 3, 0)), *parts], axis=2)


def _going_on(end: End, at: LinearPoint, problem: Problem) -> np.ndarray:
    """One rail's or screw's curves beyond one of their ends, (n, 3, c)."""
    effect, joints = end.term.effect, problem.view.joints
    shape = {stem: value.clone() for stem, value in given_of(end.term, joints).items()}
    near, far = ("from", "to") if end.upper else ("to", "from")
    shape[near][end.joint], shape[far][end.joint] = end.at, end.furthest
    sizes, share = tried_sizes(effect, problem), abs(end.furthest - end.at) / end.range
    columns = at.columns(effect, shape) / sizes
    fixed = smooth_shapes(torch.tensor(0.0 if end.upper else 1.0)).numpy()[:BENDS]  # where they leave the end
    parts = list[np.ndarray]()
    for bends, line in _curves(end, joints):
        slope, level = columns[:, :, [line]], columns[:, :, [line + 1]]
        own = end.term.theta[bends].abs().numpy() / sizes[bends]
        usual = sizes[bends.start] * max(1.0, float(own.max()))
        parts.append(usual * share**1.5 * (columns[:, :, bends][:, :, :BENDS] - fixed * level))
        parts.append(2.0 * usual * share * (slope + level if end.upper else slope - level))
    return np.concatenate(parts, axis=2)


def _curves(end: End, joints: int) -> Iterator[tuple[slice, int]]:
    """Of each curve of one joint the places of its bends and of its slope, behind which its level is."""
    starts = np.cumsum([0, *(parameter.size(joints) for parameter in end.term.effect.parameters)])
    rows = list(zip(end.term.effect.parameters, starts.tolist(), strict=False))
    line, pairs = next((start, p.count // 2) for p, start in rows if p.held)
    curves = [start for p, start in rows if p.count == SHAPES]
    for number, start in enumerate(curves):
        first = start + end.joint * SHAPES
        yield slice(first, first + SHAPES), line + 2 * (end.joint * pairs + number)


def beyond_notes(before: Before, problem: Problem) -> tuple[str, ...]:
    """A line for each effect whose curves a run leaves.

    Args:
        before: the solved model.
        problem: the run.

    Returns:
        The lines.
    """
    places: dict[str, list[str]] = {}
    for end in ends_left(before, problem):
        way = "up" if end.upper else "down"
        words = f"slider {end.joint + 1} goes {way} to {end.furthest:.0f} mm ({end.at:.0f} when the model was made)"
        places.setdefault(end.term.effect.key, []).append(words)
    return tuple(
        f"{', '.join(words)}: how {key} continues beyond that is taken as unknown" for key, words in places.items()
    )
