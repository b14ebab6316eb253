"""Spatial autocorrelation: whether neighbouring poses have similar errors, as from a worn spot or warm air."""

import numpy as np

from ptt.run.problem import Problem
from ptt.run.same_pose import same_places
from ptt.run.tails import normal_sf

NEAREST = 4  # neighbours in space that each pose is compared with
COMPARED_POSES = 20  # poses from which neighbours can be near
# Poses passed within so many rows, or within one such part of the run, are not compared: they share drift
SOON_ROWS, RUN_PARTS = 2, 10
MOST_ROWS = 3000  # rows compared at most: the number of pairs grows with their square
# Standard deviations of one axis at which the length of an error is capped, so that gross ones do not decide
LONGEST_ERROR = 4.0


def off_alike(problem: Problem, residual: np.ndarray) -> tuple[float, tuple[float, ...]]:
    """Test whether mean errors of poses agree with those of neighbouring poses that were visited at another time.

    A network over position needs many poses to learn a small region, and a curve along one axis mixes it with all else
    at that coordinate. Here the errors of neighbours only have to point the same way. The sum of their scalar products
    has the sum of squared products as variance, since products of independent errors have random signs.

    Source: Moran, Notes on continuous stochastic phenomena, Biometrika 37 (1950), for vectors and random signs.

    Args:
        problem: n rows.
        residual: (n, 3) mm; NaN on rows left out.

    Returns:
        The p-value, 1 where poses are too few; and the position of the pose that agrees most, x, y, z in mm.
    """
    rows = np.flatnonzero(np.isfinite(residual).all(axis=1))
    rows = thin(rows, MOST_ROWS)
    pose = same_places(problem.view.p.numpy()[rows])
    visits = np.bincount(pose)
    if len(visits) < COMPARED_POSES:
        return 1.0, ()
    place = _by_pose(problem.view.p.numpy()[rows], pose) / visits[:, None]
    left = residual[rows] - residual[rows].mean(axis=0)  # a common error is of no particular place
    error = _by_pose(left, pose) / np.sqrt(visits)[:, None]
    error = error / np.sqrt(np.square(error).mean(axis=0).clip(1e-18))
    error *= np.minimum(1.0, LONGEST_ERROR / np.linalg.norm(error, axis=1).clip(1e-12))[:, None]
    one, other = _neighbours(place, rows, pose, max(SOON_ROWS, problem.table.rows / RUN_PARTS))
    agree = (error[one] * error[other]).sum(axis=1)
    most = np.argmax(np.bincount(np.append(one, other), np.append(agree, agree), len(place)))
    return normal_sf(float(agree.sum() / np.sqrt(np.square(agree).sum().clip(1e-12)))), tuple(place[most].tolist())


def thin(rows: np.ndarray, most: int) -> np.ndarray:
    """At most so many of some row numbers, (m,) int, evenly spaced."""
    return rows[:: max(1, -(-len(rows) // most))]


def _by_pose(values: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Sums of values (m, 3) over the visits of each pose, (k, 3)."""
    return np.stack([np.bincount(pose, column) for column in values.T], axis=1)


def _neighbours(place: np.ndarray, rows: np.ndarray, pose: np.ndarray, soon: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of poses, one among the nearest of the other, none of whose visits are close in time.

    Args:
        place: of each pose, (k, 3) mm.
        rows: numbers of the readings, (m,).
        pose: of each of them, (m,) int.
        soon: rows up to which two readings are close in time.
    """
    order, pairs = np.argsort(pose, kind="stable"), set()
    first = np.searchsorted(pose[order], np.arange(len(place)))
    for number in range(len(place)):
        since = np.abs(rows[:, None] - rows[pose == number]).min(axis=1)
        apart = np.square(place - place[number]).sum(axis=1)
        apart[np.minimum.reduceat(since[order], first) <= soon] = np.inf
        near = np.argpartition(apart, min(NEAREST, len(apart) - 1))[:NEAREST]
        pairs |= {(min(number, other), max(number, other)) for other in near.tolist() if np.isfinite(apart[other])}
    one, other = np.array(sorted(pairs), dtype=int).reshape(-1, 2).T
    return one, other
