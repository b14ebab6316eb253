"""Gross errors: readings that neither the present model nor any effect that might be missing can explain."""

import numpy as np

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

    A row that the present model misses by far may be a broken beam or the very trace of what is missing (the rows
    just after a reversal, say). So it only counts as gross if a model with everything that might be missing misses it
    too; where rows are too few for that, the present model decides.

    Args:
        columns: (n, 3, P) whitened, in usual sizes.
        values: (n, 3) whitened.
        rows: rows that count, (n,) bool.
        simple: columns of the present model.
        saturated: columns of the saturated model.
        places: of the rows, as `places_of` has them, (n, c).

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
    """Rows far from a robust fit: least squares reweighted with Cauchy weights, row by row.

    Args:
        columns: (n, 3, P) whitened, in usual sizes; a prior one usual size wide holds what the rows do not see.
        values: (n, 3) whitened.
        rows: rows that count, (n,) bool.
        chosen: columns of the model.

    Returns:
        (n,) bool, and what the fit leaves, (n, 3), zero on rows that do not count.
    """
    width = len(chosen)
    left = np.zeros_like(values)
    left[rows], _ = linear_residual(values[rows], columns[rows][..., chosen], np.zeros(width), np.eye(width))
    return stand_out(left, rows), left


def stand_out(left: np.ndarray, rows: np.ndarray, least: float = 1.0) -> np.ndarray:
    """Rows that lie far outside the bulk of what is left.

    Args:
        left: (n, 3) in units of noise.
        rows: rows that count, (n,) bool.
        least: variance that the bulk has at the least: what is known of the noise before anything is explained.

    Returns:
        (n,) bool.
    """
    squared = np.square(left).sum(axis=1)
    width = max(least, float(np.median(squared[rows])) / chi2_median(3)) if rows.any() else 1.0
    return rows & (squared > NOISE_TAIL * width * chi2_isf(LOST_CHANCE / max(int(rows.sum()), 1), 3))


def alone(far: np.ndarray, left: np.ndarray, used: np.ndarray, places: np.ndarray, gone: int = 0) -> np.ndarray:
    """Far rows that stand alone: several in a row with one shift are a knock, a slip or another reflector.

    Broken beams may follow each other too, but each is off by something of its own. They also come wherever the machine
    stands, however it came and whatever it carries: far rows that crowd in one place or under one load, or that most
    visits of a pose have alike, are that place's or load's.

    Args:
        far: (n,) bool.
        left: what a model leaves, (n, 3) in units of noise.
        used: rows whose readings count, (n,) bool.
        places: of the rows, as `places_of` has them, (n, c).
        gone: how many other rows were set aside already.

    Returns:
        (n,) bool; none where so many are far that the model is to blame.
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
    """Whether some of the used rows, (n,) bool each, are few enough to be gross errors: chance may spoil some more."""
    most = MOST_FAR_ROWS * float(used.sum())
    return bool(far.sum() <= most + np.sqrt(most))


def places_of(problem: Problem) -> np.ndarray:
    """Where the machine stood at each row, how far it came, and what it carried how fast, (n, 2 k + 5).

    Tool position, joint values, steps of joints; load and feed, zero where nobody recorded them.
    """
    q, p, table = problem.view.q.numpy(), problem.view.p.numpy(), problem.table
    levels = [np.zeros(len(q)) if each is None else np.nan_to_num(each) for each in (table.payload_kg, table.feed_mm_s)]
    return np.column_stack([p, q, np.abs(np.diff(q, axis=0, prepend=q[:1])), *levels])


def _again(far: np.ndarray, left: np.ndarray, used: np.ndarray, places: np.ndarray, gone: int) -> np.ndarray:
    """Far rows that miss a pose as most other visits of it do; broken beams agree by chance alone, and not mostly."""
    pose = same_places(places[:, :3])
    alike, visits = alike_visits(far, left, pose), np.bincount(pose, used)
    share = (far.sum() + gone) / max(used.sum() + gone, 1)
    if agree_by_chance(alike.sum() / 2.0, share, visits):
        return np.zeros_like(far)
    return (alike > 0) & (alike + 1 >= MAJORITY * visits[pose])


def _under_one_load(far: np.ndarray, used: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Far rows of a load or a feed that has more of them than chance would put there: most of its rows, at that."""
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
    """Far rows next to each other in one measure of place and off along one line: more than chance would put there."""
    crowded, rows = np.zeros_like(far), np.flatnonzero(used)
    expected = far.sum() ** 2 / max(len(rows), 1) * _share_along(left[far & used])
    chance = CROWD_CHANCE / (places.shape[1] - LEVEL_COLUMNS + 1)
    for column in places.T[:-LEVEL_COLUMNS]:
        order = rows[np.argsort(column[rows], kind="stable")]
        pairs = far[order[1:]] & far[order[:-1]]
        one, two = order[1:][pairs], order[:-1][pairs]
        along = _along(left[one], left[two])
        if poisson_sf(along.sum() - 1, expected) < chance:
            crowded[one[along]] = True
            crowded[two[along]] = True
    near, accident = in_one_place(far, left, used, places[:, :3])
    return crowded | (near & (accident < chance))


def _along(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Whether shifts (..., 3) lie along one line, either way: a place errs along its own, a broken beam to any side."""
    size = np.linalg.norm(one, axis=-1) * np.linalg.norm(two, axis=-1)
    return np.abs((one * two).sum(axis=-1)) > ALONG_COSINE * size


def _share_along(left: np.ndarray) -> float:
    """Share of the pairs of shifts (m, 3) along one line, wherever they are: all, where trackers err along the beam."""
    own, count = 1.0 - ALONG_COSINE, len(left)
    if count < 2:
        return own
    ways = left / np.maximum(np.linalg.norm(left, axis=1), 1e-300)[:, None]
    pairs = (np.abs(ways @ ways.T) > ALONG_COSINE).sum() - count  # each with itself
    return max(own, float(pairs) / (count * (count - 1)))


def in_one_place(far: np.ndarray, left: np.ndarray, used: np.ndarray, tool: np.ndarray) -> tuple[np.ndarray, float]:
    """Far rows that have others, passed at another time and off along one line, among their neighbours in space.

    Args:
        far: (n,) bool.
        left: how far each is off, (n, 3).
        used: rows whose readings count, (n,) bool.
        tool: where each was taken, (n, 3) mm.

    Returns:
        (n,) bool; and the chance that as many of their neighbours are far wherever they lie.
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


def has_a_place(gross: np.ndarray, left: np.ndarray, problem: Problem) -> bool:
    """Whether readings that were set aside lie next to each other in space, off along one line; broken beams do not.

    Args:
        gross: (n,) bool.
        left: how far each is off, (n, 3); NaN where nobody knows.
        problem: n rows.
    """
    known = gross & np.isfinite(left).all(axis=1)
    return in_one_place(known, left, problem.used, problem.view.p.numpy())[1] < PLACE_CHANCE
