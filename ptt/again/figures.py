"""Figures of a recheck: how far each value has moved, and what the machine misses by, then and now."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag

from ptt.again.changes import CURVE, Change
from ptt.again.weigh import Weighed
from ptt.diagnosis.noise.slow import share_within
from ptt.fitting.evidence import UNGROUPED_VARIANCE
from ptt.fitting.factor import inverse
from ptt.fitting.solve import rms
from ptt.record import Record

TOTAL = "total"


@dataclass(frozen=True)
class Moved(Record):
    """One value, then and now.

    Attributes:
        effect: key of its effect.
        parameter: its name.
        joint: number of the joint, from 1; 0 where it belongs to none.
        name: as in 'gap_mm 2'.
        unit: of the values.
        before: as the model has it.
        now: as this run has it, if this and what else is said to have changed is all that did.
        std: standard error of the difference.
    """

    keys: ClassVar[str] = "effect, parameter: name, unit, joint, before, now, std, z"

    effect: str
    parameter: str
    joint: int
    name: str
    unit: str
    before: float
    now: float
    std: float

    @property
    def z(self) -> float:
        """The difference in standard errors."""
        return (self.now - self.before) / self.std if self.std > 0.0 else 0.0


def moved_of(found: Weighed, changes: Sequence[Change]) -> tuple[Moved, ...]:
    """How far some values have moved, all of them free together beside what has changed, no prior on any but on curves.

    Args:
        found: the best explanation.
        changes: of these.

    Returns:
        One for each value of the changes.
    """
    state, system, before = found.state, found.system, found.before
    free = [change.key for change in changes]
    own = np.concatenate([found.columns_of(change) for change in changes])
    rest = [state.of(key) for key in state.keys if key not in free]
    kept = np.concatenate([np.flatnonzero(state.owner < 0), *rest]).astype(int)
    columns = np.concatenate([state.columns[kept], own]).astype(int)
    others = [found.columns_of(change) for change in found.changed if change.ways.shape[1] < CURVE]
    loose = np.isin(columns, np.concatenate([np.zeros(0, dtype=int), *others]))
    looked_at = np.concatenate([_prior_of(change, found) for change in changes])
    prior = np.where(loose, UNGROUPED_VARIANCE, np.concatenate([state.posterior.prior_variance[kept], looked_at]))
    sums = system.sums_of(columns, state.memory)
    covariance = inverse(sums.gram + np.diag(1.0 / prior))
    values, error = covariance @ sums.side, state.posterior.phi * covariance
    own_values, own_error = values[len(kept) :], error[len(kept) :, len(kept) :]
    ways, places = _ways_of(changes)
    # What is left of the whole and what one value has beside it are one value.
    ways = np.array([ways[[other == place for other in places]].sum(axis=0) for place in places])
    step, std = ways @ own_values, np.sqrt(np.einsum("ij,jk,ik->i", ways, own_error, ways))
    result, at = [], 0
    for change in changes:
        size = before.layout.scale[change.places]
        then, start = before.values[change.places] * size, before.start[change.places] * size
        rows = zip(change.parameters, change.joints, change.names, change.units, strict=True)
        for i, row in enumerate(rows):
            now = float(start[i] + step[at + i] * size[i])
            result.append(Moved(change.effect.key, *row, float(then[i]), now, float(std[at + i] * size[i])))
        at += len(change.names)
    return tuple(result)


def _ways_of(changes: Sequence[Change]) -> tuple[np.ndarray, list[tuple[str, int]]]:
    """How the values of some changes, (v, c), follow from all their columns; of each value effect and place."""
    ways = block_diag(*(change.ways for change in changes))
    return np.asarray(ways), [(change.effect.key, int(place)) for change in changes for place in change.places]


def _prior_of(change: Change, found: Weighed) -> np.ndarray:
    """Prior variance of a change's columns: none but of a curve, whose bends few rows would send anywhere."""
    width = change.ways.shape[1]
    if width < CURVE:
        return np.full(width, UNGROUPED_VARIANCE)
    named = change.key in found.state.keys
    return found.state.posterior.prior_variance[found.state.of(change.key)] if named else np.ones(width)


def every_value(found: Weighed) -> tuple[Moved, ...]:
    """Every value that may have changed: what has, together; each of the others as if it alone had changed besides."""
    named, rows = found.changed, dict[tuple[str, str], Moved]()
    for change in found.changes:
        if not change.whole and change not in named:
            rows |= {(one.effect, one.name): one for one in moved_of(found, [change])}
    for one in moved_of(found, named) if named else ():
        if (one.effect, one.name) not in rows or one.std > 0.0:
            rows[one.effect, one.name] = one
    return tuple(rows.values())


def errors_of(found: Weighed) -> dict[str, float]:
    """What the machine misses by beside the solved model, root mean square in total, um.

    All three are in the frame that `ptt compare` uses: a fitted one is taken off, one that base reflectors hold is
    theirs. What happened to the set-up on the way is taken off.

    Returns:
        expected: what a machine that has not changed would show in this run: its noise, what the model's values and the
        base reflectors leave uncertain at these poses, and what the model left unexplained; now: with the model as it
        was; left: with what is said to have changed.
    """
    system, before, memory = found.system, found.before, found.state.memory
    doubt = np.hstack([_doubt_of(found), found.own_frame.doubt])
    spread = [system.in_mm(column.reshape(-1, 3)) for column in doubt.T]
    doubtful = 1e6 * sum(float(np.square(part).sum()) for part in spread) / max(len(system.rows), 1)
    wander = 0.0  # frames of each run take what lies in its mean
    if memory.wander is not None:
        wander = share_within(memory.wander, system.clock.span / max(int(system.clock.starts.sum()), 1))
    noise = (1e3 * found.noise.total) ** 2 * (1.0 + wander)
    off = _off(found) - _work(found, before.values - before.start) - found.work_of(found.set_up)
    every = np.ones(len(system.rows), dtype=bool)
    return {
        "expected": float(np.sqrt(noise + doubtful + before.left**2)),
        "now": rms(system.in_mm(off.reshape(-1, 3)), every)["total"],
        "left": rms(system.in_mm(_left(found)), every)["total"],
    }


def _off(found: Weighed) -> np.ndarray:
    """What the model, its values where they would be if nothing else had changed, leaves in its frame, (3 m,)."""
    frame, start = found.own_frame, found.before.start
    on_base = (found.supposed.on_base @ start).ravel()
    return frame.without(frame.at_base(found.system.values.ravel()), -on_base)


def _work(found: Weighed, values: np.ndarray) -> np.ndarray:
    """What values of the model, (w,) or (w, c), do to the readings in their frame, (3 m,) or (3 m, c)."""
    sides = (found.supposed.own, found.supposed.on_base)
    rows, on_base = (side.reshape(-1, len(found.before.values)) @ values for side in sides)
    return found.own_frame.without(rows, on_base)


def _doubt_of(found: Weighed) -> np.ndarray:
    """How far what is uncertain of the machine leaves the readings open, (3 m, c)."""
    count = found.system.values.size
    rest = [found.goes_on.reshape(-1, 1), found.supposed.unnamed.reshape(count, -1)]
    still = np.zeros((found.supposed.on_base[:, :, 0].size, sum(part.shape[1] for part in rest)))
    return np.hstack([_work(found, found.before.root), found.own_frame.without(np.hstack(rest), still)])


def _left(found: Weighed) -> np.ndarray:
    """What is left with what is said to have changed, (m, 3) whitened."""
    system, frame = found.system, found.own_frame
    keys = [*(change.key for change in found.changed), *(room.key for room in found.then), *found.set_up]
    named = found.scorer.score(keys, found.state.memory)
    columns, values = named.columns, named.posterior.values
    if not frame.held.shape[1]:
        return system.residual(columns, values)
    other = ~np.isin(columns, found.frame)  # the frame is the reflectors', which the readings pull away from them
    on_rows, on_base = (
        (side[:, :, columns[other]] @ values[other]).ravel()
        for side in (system.columns, system.base_columns[: len(found.supposed.on_base)])
    )
    return (_off(found) - frame.without(on_rows, on_base)).reshape(-1, 3)


def made_by(found: Weighed, values: np.ndarray) -> dict[str, float]:
    """What each effect does to the tool in this run, in the frame that errors are stated in, um.

    Args:
        found: for the columns.
        values: (w,) of the model, in usual sizes.

    Returns:
        Key of the effect -> root mean square; 'total' for all together.
    """
    layout, system = found.at.fitted.layout, found.system
    owner, made = layout.owner[: len(values)], {}
    for index, term in enumerate((*layout.terms, None)):
        mine = values if term is None else np.where(owner == index, values, 0.0)
        work = system.in_mm(_work(found, mine).reshape(-1, 3))
        made[TOTAL if term is None else term.effect.key] = rms(work, np.ones(len(work), dtype=bool))["total"]
    return made
