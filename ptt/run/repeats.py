"""Readings that repeat one another, and the noise that they tell."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ptt.run.holdout import pose_groups, visit_groups
from ptt.run.means import group_means
from ptt.run.noise import NOTHING, REPEATS, ROUNDING, Noise, at_least, step_of
from ptt.run.same_pose import number_alike, number_rows
from ptt.run.tails import chi2_isf, median_sigma

if TYPE_CHECKING:
    from ptt.run.table import Table

NEAR_IN_TIME = 1800.0  # s: between repeats further apart drift and temperature change
ROUNDS = 6  # of leaving out outliers among repeats
CHANCE = 1e-3  # that the farthest of all repeats is left out although all are sound
# Standard errors by which, along one direction, steps from repeat to repeat have to fall short of white noise: white
# repeats do in one run of a thousand
SLOW_ERRORS = 4.0
# Ratio of the variance of steps to that of white repeats from which they are taken for white: less of a drift changes
# the noise by less than a third
MOST_STEPS = 0.5
STEPS_FREEDOM = 2.0 / 3.0  # degrees of freedom of successive differences over those of deviations (von Neumann)
ENOUGH = 30  # fewest degrees of freedom of repeats that alone give a noise floor
SAME_WARMTH = 0.5  # K
SAME_LOAD = 0.01  # kg
SAME_FEED = 1e-3  # mm/s


def repeat_groups(table: "Table", direction: np.ndarray) -> np.ndarray:
    """Number the groups of true repeats.

    Args:
        table: n rows.
        direction: directions of arrival, (n, k).

    Returns:
        (n,) int; equal for rows that repeat each other: same target, arrival, payload, temperature, speed and run,
        near in time.
    """
    keys = np.column_stack([pose_groups(table), table.run, direction.astype(np.int64)])
    group = number_rows(keys)
    for values, tolerance in (
        (table.payload_kg, SAME_LOAD),
        (table.temp_c, SAME_WARMTH),
        (table.feed_mm_s, SAME_FEED),
        (table.time_s, NEAR_IN_TIME),
    ):
        if values is not None:
            group = number_alike(values, tolerance, within=group)
    return group


def noise_from_repeats(table: "Table", measured: np.ndarray, direction: np.ndarray) -> Noise | None:
    """Pool the scatter of true repeats.

    Deviations far outside the others (a broken beam) are left out before pooling. A reading that repeats another to
    its last digit is a copied row, which says nothing of the scatter, and counts once. Readings of one visit leave out
    what differs from visit to visit: where enough poses were visited again, one reading of each visit counts.

    Args:
        table: n rows.
        measured: readings in the base frame, (n, 3) mm, NaN where not observed.
        direction: directions of arrival, (n, k).

    Returns:
        The noise; None with fewer than `ENOUGH` degrees of freedom.
    """
    usable = np.isfinite(measured).all(axis=1) & (table.role != "base")
    group = repeat_groups(table, direction)
    usable &= first_of_copies(table, group)
    apart = usable & first_rows(visit_groups(table), usable)
    rounded = step_of(table.measured[usable]) ** 2 / 12.0
    # Readings of one visit have what is slow in common, so how far they step says nothing of the time between visits.
    pooled = _pooled(measured[apart], group[apart], rounded) or _pooled(measured[usable], group[usable], None)
    return pooled and replace(pooled, covariance=at_least(pooled.covariance, rounded))


def _pooled(values: np.ndarray, group: np.ndarray, rounded: float | None) -> Noise | None:
    """Scatter of readings (m, 3) about the means of their groups (m,); None with fewer than `ENOUGH` degrees.

    What they drift by together is left out, given the variance (mm^2) of rounding; None leaves it in.
    """
    group = np.unique(group, return_inverse=True)[1].reshape(-1)
    kept = np.ones(len(values), dtype=bool)
    for _ in range(ROUNDS):
        own = group[kept]
        deviation, freedom = _deviations(values[kept], own)
        if freedom < ENOUGH:
            return None
        covariance = deviation.T @ deviation / freedom
        unbiased, repeated = _unbiased(deviation, own)
        scale = np.maximum(median_sigma(unbiased[repeated], axis=0), 1e-9)
        far = ((unbiased / scale) ** 2).max(axis=1) > chi2_isf(CHANCE / len(values), 1)
        if not far.any():
            break
        kept[np.flatnonzero(kept)[far]] = False
    pooled = Noise(covariance, REPEATS, float(freedom))
    return pooled if rounded is None else _white_part(pooled, deviation[repeated], own[repeated], rounded)


def _white_part(pooled: Noise, deviation: np.ndarray, group: np.ndarray, rounded: float) -> Noise:
    """The part of the scatter of repeats that is new with each reading, where most of it is a common drift; else all.

    What changes slowly moves one repeat as it moves the next, of whatever pose: successive deviations then differ by
    less than they scatter. J. von Neumann, Ann. Math. Stat. 12 (1941), 367: the mean square successive difference.

    Args:
        pooled: the scatter of deviations from the means of their poses.
        deviation: these deviations in the order of reading, (m, 3) mm.
        group: what each repeats, (m,).
        rounded: variance of rounding, mm^2: a direction that scatters by no more has no steps to tell.

    Returns:
        The noise; with two thirds of the degrees of freedom where it is that of successive differences.
    """
    taken = 1.0 / np.bincount(group)[group]  # share of its variance that a reading's own mean takes from it
    expected = np.where(group[1:] == group[:-1], 2.0, 2.0 - taken[1:] - taken[:-1])
    steps = np.diff(deviation, axis=0)
    covariance = steps.T @ steps / expected.sum()
    floor = max(rounded, ROUNDING * float(np.trace(pooled.covariance)), NOTHING) * np.eye(3)
    whitener = replace(pooled, covariance=pooled.covariance + floor).whitener
    ratio = float(np.linalg.eigvalsh(whitener @ (covariance + floor) @ whitener.T)[0])
    if ratio > min(MOST_STEPS, 1.0 - SLOW_ERRORS / np.sqrt(pooled.freedom)):
        return pooled
    return Noise(covariance, REPEATS, STEPS_FREEDOM * pooled.freedom)


def first_of_copies(table: "Table", group: np.ndarray) -> np.ndarray:
    """Rows that do not repeat, to the last digit, an earlier reading of their group.

    Args:
        table: n rows.
        group: (n,) int, repeats of each other.

    Returns:
        (n,) bool.
    """
    bits = np.ascontiguousarray(table.measured, dtype=np.float64).view(np.int64)
    return first_rows(number_rows(np.column_stack([group, bits])), np.ones(table.rows, dtype=bool))


def first_rows(group: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The first row of each group among some.

    Args:
        group: (n,) int.
        rows: (n,) bool.

    Returns:
        (n,) bool.
    """
    first, there = np.zeros(len(group), dtype=bool), np.flatnonzero(rows)
    first[there[np.unique(group[there], return_index=True)[1]]] = True
    return first


def _deviations(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, int]:
    number, mean = group_means(values, group)
    return values - mean[number], len(values) - len(mean)


def _unbiased(deviation: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deviations scaled from group means to the true means, by sqrt(n / (n - 1)), and which rows have repeats."""
    size = np.bincount(group)[group]
    return deviation * np.sqrt(size / np.maximum(size - 1.0, 1.0))[:, None], size > 1
