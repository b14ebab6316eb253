"""What moves from run to run: one machine's values as level, drifts and jumps, chosen one by one on all runs together.

Each run says about p values x that its rows' sum of squares is x I x - 2 h x (`ptt.fleet.task.Testimony`). A machine
that stays as it is has one x = a for all runs; a value that drifts adds b (t - t0), one that jumps c [t >= t1]. Both
are least squares over runs with the full matrices, so that what a run cannot tell apart (a homing offset from the
tracker's z) weighs nothing, and one slider that moves is not said as a third of it on each. Generalised least squares,
forward selection with Bonferroni's bound on what was tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ptt.fleet.scatter import RIDGE, scatter_of_all, scatter_of_one
from ptt.fleet.seen import seen_inverse

ALPHA = 0.01  # chance that a machine on which nothing moves is said to move
MOST_MOVEMENTS = 8  # that are looked for on one machine


@dataclass(frozen=True)
class Series:
    """One machine's runs.

    Attributes:
        names: (p) of the values.
        days: (n,) when each run was measured, days.
        information: (n, p, p), in usual sizes; zero where a run's model has no such value.
        score: (n, p).
    """

    names: tuple[str, ...]
    days: np.ndarray
    information: np.ndarray
    score: np.ndarray


@dataclass(frozen=True)
class Movement:
    """One value that moves.

    Attributes:
        place: its number among the names.
        kind: 'drift' or 'jump'.
        day: of a jump, the first run behind it; of a drift the middle of the runs.
        before: of a jump, the last run before it; NaN of a drift.
        size: usual sizes a day (drift) or usual sizes (jump).
        std: of the size; wider where runs scatter by more than their rows say.
        p_value: after multiplicity.
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
    """What moves on one machine.

    Attributes:
        movements: in the order in which they were found.
        values: (n, p) usual sizes, as each run alone has them; in what it does not see, where the runs together put it.
        std: (n, p) of these, as the run's rows state it; infinite where a run says nothing.
        course: (n, p) usual sizes, level, drifts and jumps.
        scatter: times their stated errors by which runs scatter, at least one.
    """

    movements: tuple[Movement, ...]
    values: np.ndarray
    std: np.ndarray
    course: np.ndarray
    scatter: float


@dataclass(frozen=True)
class Course:
    """A way in which one value may move.

    Attributes:
        place: its number.
        kind: 'drift' or 'jump'.
        course: (n,) how it would move, per unit of its size.
        day: as of `Movement`.
        before: as of `Movement`.
    """

    place: int
    kind: Literal["drift", "jump"]
    course: np.ndarray
    day: float
    before: float = float("nan")


def movements(series: Series) -> Moves:
    """Find what moves.

    Args:
        series: one machine's runs, by date.

    Returns:
        What moves, and each run's values.
    """
    candidates = _candidates(series)
    chosen: list[Course] = []
    tried = max(len(candidates), 1)
    found: list[float] = []
    for _ in range(MOST_MOVEMENTS):
        best = _best(series, chosen, candidates)
        if best is None or best[1] * tried > ALPHA:
            break
        chosen.append(best[0])
        found.append(min(best[1] * tried, 1.0))
    return _told(series, chosen, found)


def _candidates(series: Series) -> list[Course]:
    """Every value with a line, and with a step before each run but the first."""
    days, own = series.days, []
    line = days - days.mean()
    for place in range(len(series.names)):
        told = series.information[:, place, place] > 0.0
        if told.sum() < 3 or np.ptp(days[told]) == 0.0:
            continue
        own.append(Course(place, "drift", line, float(days.mean())))
        for day in np.unique(days[told])[1:]:
            before = float(days[told & (days < day)].max())
            own.append(Course(place, "jump", (days >= day).astype(float), float(day), before))
    return own


def _best(series: Series, chosen: Sequence[Course], candidates: Sequence[Course]) -> tuple[Course, float] | None:
    """The candidate that takes most of what the chosen ones leave, and its chance before multiplicity."""
    _, inverse, rest = _solve(series, chosen)
    best, most = None, -np.inf
    for candidate in candidates:
        place, course = candidate.place, candidate.course
        cross = _cross(series, candidate, chosen)
        information = float((course**2) @ series.information[:, place, place])
        left = information - float(cross @ inverse @ cross)
        if left <= RIDGE * information:
            continue
        score = abs(float(course @ rest[:, place])) / np.sqrt(left)
        # The time of a jump is searched: a unit of twice the log likelihood for each e-fold of places, twice.
        rank = score**2 - (2.0 * np.log(max(len(np.unique(series.days)) - 1, 1)) if candidate.kind == "jump" else 0.0)
        if rank > most:
            most, best = rank, (candidate, score)
    if best is None:
        return None
    candidate, score = best
    _, _, after = _solve(series, [*chosen, candidate])  # what it does not take is what it has to be judged by
    every = scatter_of_all(series.information, after, len(chosen) + 1)
    own = scatter_of_one(series.information, after, candidate.place, candidate.course)
    return candidate, max(every.chance(score), own.chance(score))


def _solve(series: Series, chosen: Sequence[Course]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Levels and sizes of the chosen, the inverse of their normal matrix, and each run's score about them, (n, p)."""
    count = len(series.names)
    size = count + len(chosen)
    normal, right = np.zeros((size, size)), np.zeros(size)
    normal[:count, :count] = series.information.sum(axis=0)
    right[:count] = series.score.sum(axis=0)
    for at, each in enumerate(chosen, count):
        normal[at] = _cross(series, each, chosen)
        normal[:count, at] = normal[at, :count]
        right[at] = each.course @ series.score[:, each.place]
    inverse = np.linalg.pinv(normal, rcond=RIDGE, hermitian=True)
    values = inverse @ right
    course = _course(series, values, chosen)
    return values, inverse, series.score - np.einsum("npq,nq->np", series.information, course)


def _course(series: Series, values: np.ndarray, chosen: Sequence[Course]) -> np.ndarray:
    course = np.tile(values[: len(series.names)], (len(series.days), 1))
    for size, each in zip(values[len(series.names) :], chosen, strict=True):
        course[:, each.place] += size * each.course
    return course


def _cross(series: Series, candidate: Course, chosen: Sequence[Course]) -> np.ndarray:
    """What one way shares with all levels and the chosen ways, (p + m,): a row of the normal matrix."""
    place, course = candidate.place, candidate.course
    levels = np.einsum("n,np->p", course, series.information[:, place])
    sizes = [float((course * each.course) @ series.information[:, place, each.place]) for each in chosen]
    return np.concatenate([levels, sizes])


def _told(series: Series, chosen: Sequence[Course], chances: Sequence[float]) -> Moves:
    values, inverse, rest = _solve(series, chosen)
    scatter = scatter_of_all(series.information, rest, len(chosen)).wider
    course = _course(series, values, chosen)
    count, moves = len(series.names), []
    seen, std = _by_run(series, course, rest)
    for number, each in enumerate(chosen):
        wide = max(scatter, scatter_of_one(series.information, rest, each.place, each.course).wider)
        error = wide * float(np.sqrt(max(inverse[count + number, count + number], 0.0)))
        size = float(values[count + number])
        moves.append(Movement(each.place, each.kind, each.day, each.before, size, error, chances[number]))
    return Moves(tuple(moves), seen, std, course, scatter)


def _by_run(series: Series, course: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of each run and their standard errors, (n, p) each, NaN and infinite where it says nothing.

    All are free beside each other: what a value does that no movement says would else tilt those that look like it.
    """
    values, std = np.full(course.shape, np.nan), np.full(course.shape, np.inf)
    for number, information in enumerate(series.information):
        inverse, told = seen_inverse(information)
        values[number, told] = (course[number] + inverse @ rest[number])[told]
        std[number, told] = np.sqrt(np.maximum(np.diag(inverse), 0.0))[told]
    return values, std
