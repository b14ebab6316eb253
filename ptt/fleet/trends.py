"""Drifts and jumps of one machine's values from run to run, by forward selection in generalised least squares.

Of p values x each run gives the normal equations I x = h (`ptt.fleet.task.Testimony`): its sum of squares is
x I x - 2 h x and a constant. A machine that does not change has one level x = a for all runs; a value that drifts adds
b (t - t0), one that jumps c [t >= t1]. All are fitted to all runs with the full matrices, so that directions which a
run cannot determine (a homing offset against the tracker's z) have no weight, and one slider that moves does not show
as a third of it on each. Movements are added one by one, the p-value of the best multiplied by the number of candidates
(Bonferroni).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ptt.fitting.stated import INFORMATION_ROUNDING
from ptt.fleet.scatter import RIDGE, scatter_of_all, scatter_of_one
from ptt.fleet.seen import seen_by

ALPHA = 0.01  # significance level for one machine: chance of a false movement
MOST_MOVEMENTS = 8  # looked for on one machine


@dataclass(frozen=True)
class Series:
    """What n runs of one machine say of its p values, in units of their usual sizes.

    Attributes:
        names: of the values.
        days: when each run was measured, (n,) days since 1970.
        information: information matrix of each run, (n, p, p); zeros where a run's model lacks a value.
        score: right-hand side of each run's normal equations, (n, p).
    """

    names: tuple[str, ...]
    days: np.ndarray
    information: np.ndarray
    score: np.ndarray


@dataclass(frozen=True)
class Movement:
    """A drift or jump of one value.

    Attributes:
        place: index of the value among the names.
        kind: 'drift' or 'jump'.
        day: of a jump the date of the first run after it, of a drift the mean date, days since 1970.
        before: of a jump the date of the last run before it; NaN for a drift.
        size: usual sizes per day (drift) or usual sizes (jump).
        std: standard error of the size, widened where runs scatter by more than their stated errors.
        p_value: after Bonferroni's correction.
    """

    place: int
    kind: Literal["drift", "jump"]
    day: float
    before: float
    size: float
    std: float
    p_value: float


@dataclass(frozen=True)
class Moves:
    """The movements of one machine, and its p values in n runs, in units of their usual sizes.

    Attributes:
        movements: in the order in which they were found.
        values: (n, p), of each run alone; along directions that it does not determine, as fitted to all runs; NaN where
            it does not measure a value.
        std: stated standard errors of what each run determines of them, (n, p); infinite where it does not measure a
            value.
        unseen: share of each value that a run does not determine, (n, p), 0 to 1; NaN where its model lacks the value.
        course: as fitted to all runs (level, drifts and jumps), (n, p).
        scatter: how much more than their stated errors the runs scatter, at least one.
    """

    movements: tuple[Movement, ...]
    values: np.ndarray
    std: np.ndarray
    unseen: np.ndarray
    course: np.ndarray
    scatter: float

    @property
    def marginal_std(self) -> np.ndarray:
        """Standard errors of the values themselves, (n, p): in what is not determined each may be as large as usual."""
        return np.asarray(np.hypot(self.std, np.sqrt(self.unseen)))


@dataclass(frozen=True)
class Candidate:
    """A movement that may be added to the fit.

    Attributes:
        place: index of the value.
        kind: 'drift' or 'jump'.
        regressor: the movement in each run for a size of one, (n,).
        day: as in `Movement`.
        before: as in `Movement`.
    """

    place: int
    kind: Literal["drift", "jump"]
    regressor: np.ndarray
    day: float
    before: float = float("nan")


def movements(series: Series) -> Moves:
    """Find the drifts and jumps of one machine.

    Args:
        series: its runs, by date.

    Returns:
        The movements, and the values of each run.
    """
    candidates = _candidates(series)
    chosen: list[Candidate] = []
    tried = max(len(candidates), 1)
    found: list[float] = []
    for _ in range(MOST_MOVEMENTS):
        best = _best(series, chosen, candidates)
        if best is None or best[1] * tried > ALPHA:
            break
        chosen.append(best[0])
        found.append(min(best[1] * tried, 1.0))
    return _told(series, chosen, found)


def _candidates(series: Series) -> list[Candidate]:
    """For each value that at least three runs tell, a straight line in time, and a step at each date but the first."""
    days, own = series.days, []
    line = days - days.mean()
    for place in range(len(series.names)):
        told = series.information[:, place, place] > 0.0
        if told.sum() < 3 or np.ptp(days[told]) == 0.0:
            continue
        own.append(Candidate(place, "drift", line, float(days.mean())))
        for day in np.unique(days[told])[1:]:
            before = float(days[told & (days < day)].max())
            own.append(Candidate(place, "jump", (days >= day).astype(float), float(day), before))
    return own


def _best(
    series: Series, chosen: Sequence[Candidate], candidates: Sequence[Candidate]
) -> tuple[Candidate, float] | None:
    """The candidate that reduces the sum of squares most beside the chosen ones, and its uncorrected p-value."""
    _, inverse, rest = _solve(series, chosen)
    best, most = None, -np.inf
    for candidate in candidates:
        place, regressor = candidate.place, candidate.regressor
        cross = _cross(series, candidate, chosen)
        information = float((regressor**2) @ series.information[:, place, place])
        left = information - float(cross @ inverse @ cross)
        if left <= RIDGE * information:
            continue
        score = abs(float(regressor @ rest[:, place])) / np.sqrt(left)
        # A jump's date is fitted too: in the ranking 2 log(number of dates) is taken off twice its log likelihood.
        rank = score**2 - (2.0 * np.log(max(len(np.unique(series.days)) - 1, 1)) if candidate.kind == "jump" else 0.0)
        if rank > most:
            most, best = rank, (candidate, score)
    if best is None:
        return None
    candidate, score = best
    _, _, after = _solve(series, [*chosen, candidate])  # the scatter is that of the residuals with it in the fit
    every = scatter_of_all(series.information, after, len(chosen) + 1)
    own = scatter_of_one(series.information, after, candidate.place, candidate.regressor)
    return candidate, max(every.chance(score), own.chance(score))


def _solve(series: Series, chosen: Sequence[Candidate]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit levels and the sizes of the chosen m movements.

    Returns:
        Levels and sizes (p + m,), the pseudo-inverse of their normal matrix, and each run's score about the fit (n, p).
    """
    count = len(series.names)
    size = count + len(chosen)
    normal, right = np.zeros((size, size)), np.zeros(size)
    normal[:count, :count] = series.information.sum(axis=0)
    right[:count] = series.score.sum(axis=0)
    for at, each in enumerate(chosen, count):
        normal[at] = _cross(series, each, chosen)
        normal[:count, at] = normal[at, :count]
        right[at] = each.regressor @ series.score[:, each.place]
    inverse = np.linalg.pinv(normal, rcond=RIDGE, hermitian=True)
    values = inverse @ right
    course = _course(series, values, chosen)
    return values, inverse, series.score - np.einsum("npq,nq->np", series.information, course)


def _course(series: Series, values: np.ndarray, chosen: Sequence[Candidate]) -> np.ndarray:
    """The values in each run by the fitted levels and sizes, (n, p)."""
    course = np.tile(values[: len(series.names)], (len(series.days), 1))
    for size, each in zip(values[len(series.names) :], chosen, strict=True):
        course[:, each.place] += size * each.regressor
    return course


def _cross(series: Series, candidate: Candidate, chosen: Sequence[Candidate]) -> np.ndarray:
    """A candidate's row of the normal matrix, against all levels and the chosen movements, (p + m,)."""
    place, regressor = candidate.place, candidate.regressor
    levels = np.einsum("n,np->p", regressor, series.information[:, place])
    sizes = [float((regressor * each.regressor) @ series.information[:, place, each.place]) for each in chosen]
    return np.concatenate([levels, sizes])


def _told(series: Series, chosen: Sequence[Candidate], chances: Sequence[float]) -> Moves:
    values, inverse, rest = _solve(series, chosen)
    scatter = scatter_of_all(series.information, rest, len(chosen)).birge_ratio
    course = _course(series, values, chosen)
    count, moves = len(series.names), []
    values_of_runs, std, unseen = _by_run(series, course, rest)
    for number, each in enumerate(chosen):
        wide = max(scatter, scatter_of_one(series.information, rest, each.place, each.regressor).birge_ratio)
        error = wide * float(np.sqrt(max(inverse[count + number, count + number], 0.0)))
        size = float(values[count + number])
        moves.append(Movement(each.place, each.kind, each.day, each.before, size, error, chances[number]))
    return Moves(tuple(moves), values_of_runs, std, unseen, course, scatter)


def _by_run(series: Series, course: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of each run, their standard errors, and the share of each that it does not determine, (n, p) each.

    NaN and infinite where it does not measure a value. The values of a run are fitted jointly: fitted one by one, a
    change of one that no movement describes would also shift those that are correlated with it.
    """
    values, std = np.full(course.shape, np.nan), np.full(course.shape, np.inf)
    unseen = np.full(course.shape, np.nan)
    for number, information in enumerate(series.information):
        seen, own = seen_by(information), np.diag(information)
        known = own > INFORMATION_ROUNDING * own.max(initial=0.0)  # else the model lacks it, or the run cannot test it
        values[number, seen.told] = (course[number] + seen.inverse @ rest[number])[seen.told]
        std[number, seen.told] = seen.std[seen.told]
        unseen[number, known] = seen.unseen[known]
    return values, std, unseen
