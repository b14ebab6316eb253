"""Plan of a first run: poses over the volume, repeats from both sides, datum revisits, in random order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch

from ptt.effects import Library, library
from ptt.errors import InputError
from ptt.model.model import Model
from ptt.plan.arm import d_optimal_poses
from ptt.plan.floor import say_floor
from ptt.plan.forecast import EffectForecast, forecast, see_plan
from ptt.plan.pool import with_base
from ptt.plan.space import Space, build_space, can_drive, draw_poses
from ptt.plan.visits import Visit, as_counted, both_ways, singles, table_of
from ptt.progress import Progress
from ptt.record import Record
from ptt.run.noise import DEFAULT_SIGMA
from ptt.run.repeats import ENOUGH, repeat_groups
from ptt.run.table import Table
from ptt.run.target_frame import RunFrame, stated_frame

ROWS = 200  # by default
LEAST_ROWS = 60  # for each payload
DATUM_EVERY = 20  # rows between two datum visits
GROUP_ROWS = 8  # rows of a group of repeats: twice before, pose, beyond, pose
SHUFFLES = 40  # orders that are tried for the best balance of directions, at most
SHUFFLED_ROWS = 400_000  # rows in all of these orders: from 10,000 rows on any order is balanced to a hundredth


@dataclass(frozen=True)
class FirstRun(Record):
    """A plan, and the expected standard errors of each effect.

    Attributes:
        targets: rows in driving order; positions in the frame that the machine file states for targets.
        freedom: degrees of freedom of true repeats.
        rising: share of rows that each joint reaches upwards, (k,).
        datum_visits: number of rows with the role datum.
        effects: forecast of each effect.
        sigma: assumed noise of one coordinate, mm.
        words: the plan in a few sentences.
    """

    keys: ClassVar[str] = (
        "rows: targets.rows, repeat_freedom: freedom, rising_share: rising, datum_visits, sigma_um: sigma [um], "
        "effects, words"
    )

    targets: Table
    freedom: int
    rising: np.ndarray
    datum_visits: int
    effects: tuple[EffectForecast, ...]
    sigma: float
    words: str


def plan_first_run(
    model: Model,
    *,
    rows: int = ROWS,
    payloads: Sequence[float] = (),
    freedom: int = ENOUGH,
    space: Space | None = None,
    seed: int = 0,
    known: Library | None = None,
    progress: Progress | None = None,
) -> FirstRun:
    """Plan a run that determines as much as possible of a machine without any measurements yet.

    Args:
        model: the machine, bare or with effects.
        rows: approximate number of rows, without base reflectors.
        payloads: loads to be put on one after the other, kg; empty: no load is stated.
        freedom: wanted degrees of freedom of true repeats.
        space: poses that may be driven; None for all of the machine's.
        seed: of poses and order.
        known: effects by name; None for the library.
        progress: told what is done, how much of how much.

    Returns:
        The plan.

    Raises:
        InputError: too few rows.
        WorkspaceError: too little of the volume can be reached.
    """
    levels = tuple(dict.fromkeys(payloads)) or (float("nan"),)
    if rows < LEAST_ROWS * len(levels):
        fix = f"plan at least {LEAST_ROWS} rows for each payload"
        raise InputError(f"{rows} rows are too few for {len(levels)} payloads" if payloads else
                         f"{rows} rows are too few", fix=fix)  # fmt: skip
    known = library() if known is None else known
    space = build_space(model.file) if space is None else space
    sigma = model.file.tracker.sigma_mm or DEFAULT_SIGMA
    random = np.random.default_rng([seed, 32])
    shares = np.diff(np.round(np.linspace(0, rows, len(levels) + 1)).astype(int))
    groups = _fewest_groups(int(shares.min()), len(levels), freedom)
    visits: list[Visit] = []
    for level, share in zip(levels, shares, strict=True):
        parts = _parts(model, space, share, groups, random, known, sigma, progress)
        visits += [replace(visit, payload=level) for visit in _in_best_order(model, space, parts, random)]
    if len(levels) > 1:  # under the first load again: shows hysteresis and drift
        visits.append(replace(_datum(space), payload=levels[0]))
    table = table_of(with_base(_numbered(visits), model.file), space, straight=model.file.machine.moves == "straight")
    view, timed = see_plan(model, table)
    read = table.role != "base"
    effects = forecast(model, view, read, known, sigma, progress)
    rising = (view.direction.numpy()[read] > 0).mean(axis=0)
    done = repeats_in(timed, view.direction.numpy())
    visited = int((table.role == "datum").sum())
    frame = stated_frame(model.file.targets)
    words = _words(table, done, rising, visited, levels) + say_floor(table, space) + _counted(space, frame)
    return FirstRun(as_counted(table, frame), done, rising, visited, effects, sigma, words + _lost(effects))


def repeats_in(table: Table, direction: np.ndarray) -> int:
    """Degrees of freedom of true repeats.

    Args:
        table: rows with a clock.
        direction: of arrival, (n, k).

    Returns:
        Number of rows less number of distinct ones, without base reflectors.
    """
    rows = table.role != "base"
    group = repeat_groups(table, direction)[rows]
    return int(len(group) - len(np.unique(group)))


def _fewest_groups(share: int, levels: int, freedom: int) -> int:
    """Groups of repeats needed under each load: three degrees of freedom each, beside those of datum visits."""
    datums = max(share // DATUM_EVERY, 1)
    wanted = -(-(freedom + 2) // levels) - (datums - 2)
    return int(np.clip(-(-wanted // 3), 2, (share - 2 * datums) // GROUP_ROWS))


def _parts(
    model: Model, space: Space, rows: int, groups: int, random: np.random.Generator, known: Library, sigma: float,
    progress: Progress | None,
) -> list[Visit]:  # fmt: skip
    """Visits under one load without datum visits: groups of repeats, and single poses for the rest."""
    repeated = both_ways(space, groups, random, repeats=GROUP_ROWS // 4)
    left = rows - sum(visit.rows for visit in repeated) - 2 * max(rows // DATUM_EVERY, 1)
    if left <= 0:
        return repeated
    if space.by_tool:
        return [*repeated, *singles(draw_poses(space, left, random, progress))]
    return [*repeated, *singles(d_optimal_poses(model, space, left, random, known, sigma))]


def _in_best_order(model: Model, space: Space, parts: list[Visit], random: np.random.Generator) -> list[Visit]:
    """Random order with regular datum visits; of several, the one with the best balance of directions."""
    straight = model.file.machine.moves == "straight"

    def bias(visits: list[Visit]) -> float:
        direction = table_of(visits, space, straight=straight).direction
        assert direction is not None
        return float(np.abs(direction.mean(axis=0)).max())

    tries = min(SHUFFLES, SHUFFLED_ROWS // sum(len(part.name) for part in parts))
    tried = (_with_datums(space, [parts[i] for i in random.permutation(len(parts))]) for _ in range(max(tries, 1)))
    return min(tried, key=bias) if tries > 1 else next(tried)


def _with_datums(space: Space, parts: list[Visit]) -> list[Visit]:
    """Visit the datum before the first row, then after every `DATUM_EVERY` rows or more."""
    result, since, datum = [], DATUM_EVERY, _datum(space)
    for part in parts:
        if since >= DATUM_EVERY:
            result.append(datum)
            since = 0
        result.append(part)
        since += len(part.name)
    return result


def _datum(space: Space) -> Visit:
    """A visit of the datum, the middle of the workspace, always approached from the same side."""
    step, middle = 0.03 * (space.upper - space.lower), (space.lower + space.upper) / 2.0
    places = (space.mechanism.home(), middle) if space.by_tool else (middle,)
    tried = [torch.stack([place + side * step, place]) for place in places for side in (-1.0, 1.0)]
    drivable = [way for way in tried if can_drive(space, way).all()]
    way = drivable[0] if drivable else draw_poses(space, 2, np.random.default_rng(0))
    return Visit(way, ("datum before", "datum"), "datum")


def _numbered(visits: list[Visit]) -> list[Visit]:
    """Name visits in driving order; the approach to the datum becomes a pose like others."""
    result: list[Visit] = []
    count = 0
    for visit in visits:
        if visit.role == "datum":
            result += [replace(visit, q=visit.q[:1], name=visit.name[:1], role="pose"),
                       replace(visit, q=visit.q[1:], name=visit.name[1:])]  # fmt: skip
            continue
        count += 1
        result.append(visit.named(f"p{count}") if visit.rows > 1 else replace(visit, name=(f"p{count}",)))
    return result


def _counted(space: Space, frame: RunFrame) -> str:
    """Words on the frame that targets are counted in, where it is not the base frame; '' of an arm's joint commands."""
    if frame.source == "base" or not space.by_tool:
        return ""
    if frame.source == "unknown":
        return " Targets are in the base frame: the machine file does not know in which frame they are stated."
    return " Targets are in the frame that the machine file states under [targets]."


def _lost(effects: tuple[EffectForecast, ...]) -> str:
    """Words on effects of the model that the plan cannot test; '' without any."""
    lost = [f"{effect.effect} needs {effect.needs}" for effect in effects if effect.in_model and effect.needs]
    return f" Effects of the model that this run could not determine: {'; '.join(lost)}." if lost else ""


def _words(table: Table, freedom: int, rising: np.ndarray, datums: int, levels: tuple[float, ...]) -> str:
    base = int((table.role == "base").sum())
    shares = ", ".join(f"{share:.0%}" for share in rising)
    lines = [
        f"{table.rows - base} poses in random order, {datums} datum visits among them; "
        f"joints arrive upwards in {shares}.",
        f"Repeats leave {freedom} degrees of freedom for the noise floor"
        + ("." if freedom >= ENOUGH else f", fewer than the {ENOUGH} needed: plan more rows."),
    ]
    if len(levels) > 1:
        loads = ", ".join(f"{level:g}" for level in levels)
        lines.append(f"Loads of {loads} kg in turn, and a datum under the first again at the end.")
    if base:
        lines.append("Base reflectors are read before and after.")
    return " ".join(lines)
