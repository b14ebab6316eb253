"""Gross errors: readings that neither the present model nor any effect that might be missing explains."""

import numpy as np

from ptt.dependence.way import last_moves
from ptt.fitting.outliers import LOST_CHANCE, linear_residual
from ptt.fitting.stretches import AGREE_SHARE, agree_by_chance, alike_visits
from ptt.run.problem import Problem
from ptt.run.same_pose import same_places
from ptt.run.tails import chi2_isf, chi2_median, poisson_sf

NOISE_TAIL = 2.0  # factor on the limit: real noise has longer tails than a normal distribution, and such rows are kept
MAJORITY = 0.5  # share of the visits of a pose, or of the rows under a load, from which the pose or load is to blame
LEAST_COMPANY = 2  # alike rows among the four nearest in travel from which a row belongs to a stretch
MOST_FAR_ROWS = 0.12  # share of the rows beyond which far rows are no exceptions
LEVEL_COLUMNS = 2  # last columns of `places_of`, which come in levels: load and feed
CROWD_CHANCE = 0.03  # p-value, over all measures of place, below which far rows next to each other are no accident
PLACE_CHANCE = 1e-3  # p-value below which readings set aside as gross errors lie at one place
ALONG_COSINE = 0.8  # cosine of two shifts, either way, from which one cause may have made both: 1 in 5 random pairs
SPACE_NEIGHBOURS = 2  # neighbours in space of each far row: of a small place they are among its own rows
STRETCH_GAP = 2  # rows apart in travel up to which rows count as one stretch
SATURATED_COORDINATES = 2.5  # coordinates per column of a saturated model, below which it could explain anything


def gross_errors(
    columns: np.ndarray,
    values: np.ndarray,
    rows: np.ndarray,
    simple: np.ndarray,
    saturated: np.ndarray,
    places: np.ndarray,
) -> np.ndarray:
    """Find gross errors.

    A row far from the present model may be a broken beam or the trace of what is missing (rows just after a reversal,
    for instance). So it counts as gross only if a model with everything that might be missing is far from it too. Where
    rows are too few for that, the present model decides.

    Args:
        columns: (n, 3, P) whitened, in usual sizes.
        values: (n, 3) whitened.
        rows: rows that count, (n,) bool.
        simple: indices of the columns of the present model.
        saturated: indices of the columns of the saturated model.
        places: of the rows, from `places_of`, (n, c).

    Returns:
        (n,) bool.
    """
    far, left = far_rows(columns, values, rows, simple)
    if far.any() and 3 * rows.sum() > SATURATED_COORDINATES * len(saturated):
        far, left = far_rows(columns, values, rows, saturated)
    return alone(far, left, rows, places)


def far_rows(
    columns: np.ndarray, values: np.ndarray, rows: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows far from a robust fit: iteratively reweighted least squares with Cauchy weights by row.

    Args:
        columns: (n, 3, P) whitened, in usual sizes; the prior standard deviation of each is one.
        values: (n, 3) whitened.
        rows: rows that count, (n,) bool.
        chosen: indices of the columns of the model.

    Returns:
        (n,) bool, and the residual, (n, 3), zero on rows that do not count.
    """
    width = len(chosen)
    left = np.zeros_like(values)
    left[rows], _ = linear_residual(values[rows], columns[rows][..., chosen], np.zeros(width), np.eye(width))
    return stand_out(left, rows), left


def stand_out(left: np.ndarray, rows: np.ndarray, least: float = 1.0) -> np.ndarray:
    """Rows whose residual lies far outside the bulk.

    Args:
        left: residual, (n, 3) in units of noise.
        rows: rows that count, (n,) bool.
        least: lower bound of the bulk's variance, as known of the noise before anything is explained.

    Returns:
        (n,) bool.
    """
    squared = np.square(left).sum(axis=1)
    variance = max(least, float(np.median(squared[rows])) / chi2_median(3)) if rows.any() else 1.0
    return rows & (squared > NOISE_TAIL * variance * chi2_isf(LOST_CHANCE / max(int(rows.sum()), 1), 3))


def alone(far: np.ndarray, left: np.ndarray, used: np.ndarray, places: np.ndarray, gone: int = 0) -> np.ndarray:
    """Far rows that stand alone, and so are gross errors rather than something systematic.

    Several in a row with one shift are a knock, a slip or another reflector; broken beams may follow each other too,
    but each is off differently. Broken beams also come at any place, direction of arrival and load: far rows that crowd
    in one place or under one load, or that most visits of a pose have alike, belong to that place or load.

    Args:
        far: (n,) bool.
        left: residual, (n, 3) in units of noise.
        used: rows whose readings count, (n,) bool.
        places: of the rows, from `places_of`, (n, c).
        gone: how many other rows were set aside already.

    Returns:
        (n,) bool; none where so many rows are far that the model is to blame.
    """
    company, size, count = np.zeros(len(far), dtype=int), np.linalg.norm(left, axis=1), len(far)
    for step in range(1, STRETCH_GAP + 1):
        near, before = np.arange(step, count), np.arange(count - step)
        apart = np.linalg.norm(left[near] - left[before], axis=1)
        alike = far[near] & far[before] & (apart < AGREE_SHARE * np.maximum(size[near], size[before]))
        company[near] += alike
        company[before] += alike
    lone = far & (company < LEAST_COMPANY) & ~_crowded(far, left, used, places) & ~_again(far, left, used, places, gone)
    lone &= ~_under_one_load(far, used, places)
    return lone if are_exceptions(lone, used) else np.zeros_like(far)


def are_exceptions(far: np.ndarray, used: np.ndarray) -> bool:
    """Whether far rows are few enough to be gross errors, one standard deviation allowed; (n,) bool each."""
    most = MOST_FAR_ROWS * float(used.sum())
    return bool(far.sum() <= most + np.sqrt(most))


def places_of(problem: Problem) -> np.ndarray:
    """Tool position, joint values, steps of the joints, duration of the last move, load and feed of each row.

    Load and feed are zero where they were not recorded; the duration is left out where it is the same of all rows.

    Returns:
        (n, 2 k + 5), with the duration (n, 2 k + 6).
    """
    q, p, table = problem.view.q.numpy(), problem.view.p.numpy(), problem.table
    levels = [np.zeros(len(q)) if each is None else np.nan_to_num(each) for each in (table.payload_kg, table.feed_mm_s)]
    pause = _pauses(problem)
    pauses = [pause] if np.ptp(pause) > 0.0 else []
    return np.column_stack([p, q, np.abs(np.diff(q, axis=0, prepend=q[:1])), *pauses, *levels])


def _again(far: np.ndarray, left: np.ndarray, used: np.ndarray, places: np.ndarray, gone: int) -> np.ndarray:
    """Far rows that are off like most other visits of their pose, and more often than broken beams agree by chance."""
    pose = same_places(places[:, :3])
    alike, visits = alike_visits(far, left, pose), np.bincount(pose, used)
    share = (far.sum() + gone) / max(used.sum() + gone, 1)
    if agree_by_chance(alike.sum() / 2.0, share, visits):
        return np.zeros_like(far)
    return (alike > 0) & (alike + 1 >= MAJORITY * visits[pose])


def _under_one_load(far: np.ndarray, used: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Far rows of a load or feed most of whose rows are far, and more than chance would have it."""
    found = np.zeros_like(far)
    for column in places.T[-LEVEL_COLUMNS:]:
        levels = np.unique(column[used])
        for level in levels if len(levels) > 1 else ():
            own = used & (column == level)
            many, others = int((far & own).sum()), used & ~own
            share = (far & others).sum() / max(others.sum(), 1)
            expected = own.sum() * max(share, 1.0 / len(far))
            if many > MAJORITY * own.sum() and poisson_sf(many - 1, expected) < CROWD_CHANCE / len(levels):
                found |= far & own
    return found


def _crowded(far: np.ndarray, left: np.ndarray, used: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Far rows that are neighbours in a measure of place and off along one line, more often than by chance."""
    crowded, chance = np.zeros_like(far), CROWD_CHANCE / (places.shape[1] - LEVEL_COLUMNS + 1)
    for column in places.T[:-LEVEL_COLUMNS]:
        beside, accident = beside_each_other(far, left, used, column)
        crowded |= beside & (accident < chance)
    near, accident = in_one_place(far, left, used, places[:, :3])
    return crowded | (near & (accident < chance))


def beside_each_other(
    far: np.ndarray, left: np.ndarray, used: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, float]:
    """Far rows next to each other in the order of a variable that are off along one line.

    Args:
        far: (n,) bool.
        left: how far each is off, (n, 3).
        used: rows whose readings count, (n,) bool.
        values: of the variable, (n,).

    Returns:
        (n,) bool; and the p-value of so many pairs if gross errors were spread at random.
    """
    beside, rows = np.zeros_like(far), np.flatnonzero(used | far)
    expected = far.sum() ** 2 / max(len(rows), 1) * _share_along(left[far])
    mixed = np.random.default_rng(0).permutation(len(rows))  # equal values in no order, least of all that of travel
    order = rows[np.lexsort((mixed, values[rows]))]
    pairs = far[order[1:]] & far[order[:-1]]
    one, two = order[1:][pairs], order[:-1][pairs]
    along = _along(left[one], left[two])
    beside[one[along]] = True
    beside[two[along]] = True
    return beside, float(poisson_sf(along.sum() - 1, expected))


def _along(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Whether two shifts (..., 3) lie along one line, either way, as errors of one place do, unlike broken beams."""
    size = np.linalg.norm(one, axis=-1) * np.linalg.norm(two, axis=-1)
    return np.abs((one * two).sum(axis=-1)) > ALONG_COSINE * size


def _share_along(left: np.ndarray) -> float:
    """Share of all pairs of shifts (m, 3) along one line: large where a tracker errs along its beam."""
    own, count = 1.0 - ALONG_COSINE, len(left)
    if count < 2:
        return own
    ways = left / np.maximum(np.linalg.norm(left, axis=1), 1e-300)[:, None]
    pairs = (np.abs(ways @ ways.T) > ALONG_COSINE).sum() - count  # each with itself
    return max(own, float(pairs) / (count * (count - 1)))


def in_one_place(far: np.ndarray, left: np.ndarray, used: np.ndarray, tool: np.ndarray) -> tuple[np.ndarray, float]:
    """Far rows with far neighbours in space that were passed at another time and are off along the same line.

    Args:
        far: (n,) bool.
        left: how far each is off, (n, 3).
        used: rows whose readings count, (n,) bool.
        tool: where each was taken, (n, 3) mm.

    Returns:
        (n,) bool; and the p-value of so many pairs if gross errors were spread at random.
    """
    near, rows, here = np.zeros(len(far), dtype=int), np.flatnonzero(used), np.flatnonzero(far & used)
    if len(here) < 2:
        return near > 0, 1.0
    from scipy.spatial import cKDTree  # only where there is something to ask: it takes a while to load

    place = tool[rows] / np.maximum(np.ptp(tool[rows], axis=0), 1e-9)
    count = min(
        SPACE_NEIGHBOURS + 2 * STRETCH_GAP + 1, len(rows)
    )  # what follows in time is among them, and judged as a stretch
    _, nearest = cKDTree(place).query(place[np.searchsorted(rows, here)], k=count)
    for row, others in zip(here, rows[nearest], strict=True):
        beside = others[np.abs(others - row) > STRETCH_GAP][:SPACE_NEIGHBOURS]
        near[row] = (far[beside] & _along(left[beside], left[row])).sum()
    pairs = SPACE_NEIGHBOURS / 2.0  # of each row: of two neighbours each counts the other
    expected = pairs * len(here) ** 2 / len(rows) * _share_along(left[here])
    return near > 0, float(poisson_sf(near.sum() // 2 - 1, expected))


def common_place(gross: np.ndarray, left: np.ndarray, problem: Problem) -> str | None:
    """Where readings set aside that are off along one line are neighbours, in words: broken beams come anywhere.

    Args:
        gross: (n,) bool.
        left: how far each is off, (n, 3); NaN where not known.
        problem: n rows.

    Returns:
        A clause; None where they are spread.
    """
    known, used = gross & np.isfinite(left).all(axis=1), problem.used
    if in_one_place(known, left, used, problem.view.p.numpy())[1] < PLACE_CHANCE:
        return "lie next to each other in space"
    pause = _pauses(problem)
    if known.sum() < 2 or not np.ptp(pause):
        return None
    alike = beside_each_other(known, left, used, pause)[1] < PLACE_CHANCE
    return "come after moves or rests of like duration" if alike else None


def _pauses(problem: Problem) -> np.ndarray:
    """Duration of the last move to each row, with any rest before it, (n,); zero before the first move of a run."""
    view = problem.view
    return np.nan_to_num(last_moves(view.p.numpy(), view.time.numpy(), view.starts.numpy())[1])
