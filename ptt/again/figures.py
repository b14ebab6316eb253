"""Figures of a recheck: each value in the model and in the run, and the tool error by the model, expected and found."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag

from ptt.again.changes import CURVE, Change
from ptt.again.explanation import Explanation
from ptt.diagnosis.evidence.noise_level import noise_after
from ptt.diagnosis.noise.slow import share_within
from ptt.fitting.evidence import UNGROUPED_VARIANCE
from ptt.fitting.factor import inverse
from ptt.record import Record
from ptt.run.axes import rms
from ptt.run.problem import Problem

TOTAL = "total"
CLEAR = 3.0  # standard errors beyond which a difference is clear


@dataclass(frozen=True)
class Moved(Record):
    """One value, then and now.

    Attributes:
        effect: key of its effect.
        parameter: its name.
        joint: number of the joint, from 1; 0 where it belongs to none.
        name: as in 'gap_mm 2'.
        unit: of the values.
        before: in the model.
        now: in this run, if nothing else has changed but what is said to have.
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


def estimate_moves(found: Explanation, changes: Sequence[Change]) -> tuple[Moved, ...]:
    """Estimate the values of some changes jointly, beside everything else in the explanation.

    The values have no prior, so the estimates are not shrunk; curves keep theirs, since few rows would leave them free.

    Args:
        found: the best explanation.
        changes: whose values are estimated.

    Returns:
        One for each value of the changes, in their order.
    """
    state, system, prior = found.state, found.system, found.prior
    free = [change.key for change in changes]
    own = np.concatenate([found.columns_of(change) for change in changes])
    rest = [state.of(key) for key in state.keys if key not in free]
    kept = np.concatenate([np.flatnonzero(state.owner < 0), *rest]).astype(int)
    columns = np.concatenate([state.columns[kept], own]).astype(int)
    others = [found.columns_of(change) for change in found.changed if change.ways.shape[1] < CURVE]
    loose = np.isin(columns, np.concatenate([np.zeros(0, dtype=int), *others]))
    looked_at = np.concatenate([_prior_of(change, found) for change in changes])
    variance = np.where(loose, UNGROUPED_VARIANCE, np.concatenate([state.posterior.prior_variance[kept], looked_at]))
    sums = system.sums_of(columns, state.memory)
    covariance = inverse(sums.gram + np.diag(1.0 / variance))
    values, error = covariance @ sums.side, state.posterior.phi * covariance
    own_values, own_error = values[len(kept) :], error[len(kept) :, len(kept) :]
    ways, places = _ways_of(changes)
    # A value that changes both with the whole effect and by itself changes by the sum.
    ways = np.array([ways[[other == place for other in places]].sum(axis=0) for place in places])
    step, std = ways @ own_values, np.sqrt(np.einsum("ij,jk,ik->i", ways, own_error, ways))
    result, at = [], 0
    for change in changes:
        size = prior.layout.scale[change.places]
        then, start = prior.values[change.places] * size, prior.start[change.places] * size
        rows = zip(change.parameters, change.joints, change.names, change.units, strict=True)
        for i, row in enumerate(rows):
            now = float(start[i] + step[at + i] * size[i])
            result.append(Moved(change.effect.key, *row, float(then[i]), now, float(std[at + i] * size[i])))
        at += len(change.names)
    return tuple(result)


def _ways_of(changes: Sequence[Change]) -> tuple[np.ndarray, list[tuple[str, int]]]:
    """Derivative of the values of some changes by their unknowns, (v, c); of each value the effect and its place."""
    ways = block_diag(*(change.ways for change in changes))
    return np.asarray(ways), [(change.effect.key, int(place)) for change in changes for place in change.places]


def _prior_of(change: Change, found: Explanation) -> np.ndarray:
    """Prior variance of a change's unknowns: practically infinite, but of a curve the one in use."""
    width = change.ways.shape[1]
    if width < CURVE:
        return np.full(width, UNGROUPED_VARIANCE)
    named = change.key in found.state.keys
    return found.state.posterior.prior_variance[found.state.of(change.key)] if named else np.ones(width)


def every_value(found: Explanation) -> tuple[Moved, ...]:
    """All values: those said to have changed estimated jointly, each other one as if it alone had changed as well.

    A share of an effect as a whole says nothing of a value that the model did not measure.
    """
    named, rows = found.changed, dict[tuple[str, str], Moved]()
    for change in found.changes:
        if not change.whole and change not in named:
            rows |= {(one.effect, one.name): one for one in estimate_moves(found, [change])}
    sure = {(change.effect.key, name) for change in named for name in clear_then(found, change)}
    for one in estimate_moves(found, named) if named else ():
        key = one.effect, one.name
        if key not in rows or (one.std > 0.0 and key in sure):
            rows[one.effect, one.name] = one
    return tuple(rows.values())


def clear_then(found: Explanation, change: Change) -> tuple[str, ...]:
    """Names of a change's values; of a whole effect only those that were clearly not zero in the model, if any were."""
    if not change.whole:
        return change.names
    prior, own = found.prior, change.places
    clear = np.abs(prior.values[own]) > CLEAR * prior.std[own]
    return tuple(name for name, sure in zip(change.names, clear, strict=True) if sure) or change.names


def clear_values(found: Explanation) -> dict[str, set[str]]:
    """Names of the values that were clearly not zero in the model, by effect."""
    prior, names = found.prior, dict[str, set[str]]()
    for change in found.changes:
        clear = np.abs(prior.values[change.places]) > CLEAR * prior.std[change.places]
        names.setdefault(change.effect.key, set()).update(np.array(change.names)[clear].tolist())
    return names


def errors_of(found: Explanation, problem: Problem) -> dict[str, float]:
    """Error of the readings against the solved model, rms of the vector, um.

    All three are in the frame that `ptt compare` uses: a fitted frame is removed, a frame that base reflectors hold is
    where these put it. Movements of the set-up during the run are removed.

    Args:
        found: the best explanation.
        problem: the run.

    Returns:
        expected: of a machine that has not changed: noise of the run, uncertainty of the model's values and of the base
        reflectors at these poses, and the model's own unexplained error, as a root sum of squares; now: found, with the
        model as it was; left: with the changes.
    """
    system, prior, memory = found.system, found.prior, found.state.memory
    doubt = np.hstack([_root_of_uncertainty(found), found.own_frame.doubt])
    spread = [system.in_mm(column.reshape(-1, 3)) for column in doubt.T]
    doubtful = 1e6 * sum(float(np.square(part).sum()) for part in spread) / max(len(system.rows), 1)
    wander = 0.0  # share of the tracker's wander within runs: the frame of each run takes its mean
    if memory.wander is not None:
        wander = share_within(memory.wander, system.clock.span / max(int(system.clock.starts.sum()), 1))
    # What the rows scatter by beyond a noise that is known is no noise: it would make any error an expected one.
    floor = noise_after(problem, system, found.state).total
    noise = (1e3 * min(floor, found.noise.total)) ** 2 * (1.0 + wander)
    off = _residual_of_prior(found) - _shift_of(found, prior.values - prior.start) - found.shift_of(found.set_up)
    return {
        "expected": float(np.sqrt(noise + doubtful + prior.left**2)),
        "now": rms(system.in_mm(off.reshape(-1, 3)))["total"],
        "left": rms(system.in_mm(_left(found)))["total"],
    }


def _residual_of_prior(found: Explanation) -> np.ndarray:
    """Residual of the model at `Prior.start`, in the run's own frame, (3 m,) whitened."""
    frame, start = found.own_frame, found.prior.start
    on_base = (found.linear_problem.on_base @ start).ravel()
    return frame.without(frame.at_base(found.system.values.ravel()), -on_base)


def _shift_of(found: Explanation, values: np.ndarray) -> np.ndarray:
    """Shift of the readings in the run's own frame by values of the model, (w,) or (w, c) -> (3 m,) or (3 m, c)."""
    sides = (found.linear_problem.own, found.linear_problem.on_base)
    rows, on_base = (side.reshape(-1, len(found.prior.values)) @ values for side in sides)
    return found.own_frame.without(rows, on_base)


def _root_of_uncertainty(found: Explanation) -> np.ndarray:
    """Root of the covariance of the predicted readings by the uncertainty of the machine, (3 m, c) whitened."""
    count = found.system.values.size
    rest = [found.extrapolated.reshape(-1, 1), found.linear_problem.unnamed.reshape(count, -1)]
    still = np.zeros((found.linear_problem.on_base[:, :, 0].size, sum(part.shape[1] for part in rest)))
    return np.hstack([_shift_of(found, found.prior.root), found.own_frame.without(np.hstack(rest), still)])


def _left(found: Explanation) -> np.ndarray:
    """Residual with the changes, in the run's own frame, (m, 3) whitened."""
    system, frame = found.system, found.own_frame
    keys = [*(change.key for change in found.changed), *(masked.key for masked in found.masked), *found.set_up]
    named = found.scorer.score(keys, found.state.memory)
    columns, values = named.columns, named.posterior.values
    if not frame.held.shape[1]:
        return system.residual(columns, values)
    other = ~np.isin(
        columns, found.frame
    )  # the frame is where the reflectors put it, not where the fit to the readings moves it
    on_rows, on_base = (
        (side[:, :, columns[other]] @ values[other]).ravel()
        for side in (system.columns, system.base_columns[: len(found.linear_problem.on_base)])
    )
    return (_residual_of_prior(found) - frame.without(on_rows, on_base)).reshape(-1, 3)


def tool_error_by_effect(found: Explanation, values: np.ndarray) -> dict[str, float]:
    """Tool error that each effect of the model causes in this run, in the frame of `errors_of`, um.

    Args:
        found: an explanation of the run.
        values: of the model's effects, (w,) in usual sizes.

    Returns:
        Key of the effect -> root mean square; 'total' for all together.
    """
    layout, system = found.at.fitted.layout, found.system
    owner, made = layout.owner[: len(values)], {}
    for index, term in enumerate((*layout.terms, None)):
        mine = values if term is None else np.where(owner == index, values, 0.0)
        work = system.in_mm(_shift_of(found, mine).reshape(-1, 3))
        made[TOTAL if term is None else term.effect.key] = rms(work)["total"]
    return made
