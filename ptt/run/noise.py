"""The noise floor: covariance of one reading by repeats, std columns or the machine file, and where it comes from."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ptt.record import Record
from ptt.run.holdout import pose_groups, visit_groups
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
ROUNDING = 1e-9  # share of the summed variances below which the variance of a direction is rounding
NOTHING = 1e-18  # mm^2: no reading is better than a nanometre
STEPS = tuple(digit * 10.0**-power for power in range(1, 5) for digit in (5.0, 2.0, 1.0))  # mm, steps of last digits
ON_STEP = 1e-5  # share of a step by which a reading may be off a whole number of steps
FIRST = 1000  # readings that are tested before all of them are
SAME_WARMTH = 0.5  # K
SAME_LOAD = 0.01  # kg
SAME_FEED = 1e-3  # mm/s
SATURATED = "saturated model"  # source: the residual of everything that could be fitted at once
REPEATS = "repeats"  # source: scatter of repeats
GUESSED = "first guess"  # source: none; used as weights in a fit, never reported
VISITED = f"{SATURATED}; readings of one visit scatter by less"  # source where no pose was visited a second time
COARSEST = 0.01  # mm: a coarser step is not that of a tracker's last digit
READABLE = 1e-4  # mm: no tracker resolves less, the air alone moves its beam by more
DEFAULT_SIGMA = 0.005  # mm, one coordinate of a hand-held reflector: the first guess


@dataclass(frozen=True)
class Noise(Record):
    """Scatter of one reading.

    Attributes:
        covariance: (3, 3) mm^2 of the coordinates of one reading, in the base frame.
        source: where it comes from: 'repeats', 'std columns', 'machine file', 'saturated model' (perhaps with a remark
            behind it), 'first guess' where there is nothing.
        freedom: its degrees of freedom, of coordinates for a saturated model, of readings (three coordinates) for
            repeats; infinite where it was stated.
        stated: source and total (mm) that std columns or the machine file state instead; None where they do not.
        least: mm^2, lower bound of the variance of one coordinate, by resolution.
    """

    keys: ClassVar[str] = "x: sigma.0 [um], y: sigma.1 [um], z: sigma.2 [um], total: total [um], source"

    covariance: np.ndarray
    source: str
    freedom: float = np.inf
    stated: tuple[str, float] | None = None
    least: float = NOTHING

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviation of each coordinate, (3,) mm."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def total(self) -> float:
        """Root of the summed variances, mm: the noise floor of `total` errors."""
        return float(np.sqrt(np.trace(self.covariance)))

    @cached_property
    def whitener(self) -> np.ndarray:
        """Whitening matrix W, (3, 3) 1/mm: W^T W is the inverse covariance; its rows are the principal axes."""
        least = max(ROUNDING * float(np.trace(self.covariance)), NOTHING)
        squares, ways = np.linalg.eigh(at_least(self.covariance, least))
        return np.asarray(ways.T / np.sqrt(squares)[:, None])

    def log_density(self, rows: int) -> float:
        """Normalisation of the log likelihood of a number of readings: -rows/2 log det(covariance).

        The log likelihood is this less half of chi-squared, up to a constant that does not depend on the noise; so
        explanations with different noise compare.
        """
        return rows * float(np.linalg.slogdet(self.whitener)[1])


def source_in_words(source: str) -> str:
    """Where a noise comes from, within a sentence: 'repeats', but 'the machine file', 'the std columns'."""
    return source if source == REPEATS else f"the {source}"


def guessed_noise() -> Noise:
    """The noise to start with where none is known."""
    return Noise(np.eye(3) * DEFAULT_SIGMA**2, GUESSED)


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


def at_least(covariance: np.ndarray, variance: float) -> np.ndarray:
    """A covariance with its eigenvalues raised to a lower bound, (3, 3) mm^2; unchanged where none is below.

    Args:
        covariance: (3, 3) mm^2.
        variance: the bound, mm^2.
    """
    sizes, ways = np.linalg.eigh(covariance)
    if sizes[0] >= variance:
        return covariance
    return np.asarray((ways * np.maximum(sizes, variance)) @ ways.T)


def step_of(reading: np.ndarray) -> float:
    """Resolution of readings: the step of their last digit, mm.

    Args:
        reading: (n, 3) mm, in the tracker's own axes.

    Returns:
        The largest of the usual decimal steps of which all readings are whole multiples; zero where there is none.
    """
    for step in STEPS:
        if _are_whole(reading[:FIRST], step) and _are_whole(reading, step):
            return step
    return 0.0


def _are_whole(reading: np.ndarray, step: float) -> bool:
    steps = reading / step
    return bool((np.abs(steps - np.round(steps)) < ON_STEP).all())


def least_variance(reading: np.ndarray, stated: float = np.inf) -> float:
    """Lower bound of the variance of one coordinate by resolution, mm^2.

    Args:
        reading: (n, 3) mm.
        stated: known variance of one coordinate, mm^2: an instrument may resolve less than any tracker.

    Returns:
        That of rounding to the last digit, or that of the best tracker.
    """
    step = step_of(reading)
    return max(step**2 / 12.0 if step <= COARSEST else 0.0, min(READABLE**2, stated))


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


def noise_from_std(table: "Table") -> Noise | None:
    """Take the tracker's own standard deviations.

    Args:
        table: n rows.

    Returns:
        The noise, or None without `x_std, y_std, z_std`.
    """
    if table.std is None:
        return None
    rows = table.std[(table.std > 0.0).all(axis=1) & (table.role != "base")]  # zero stands for unknown
    if not len(rows):
        return None
    return Noise(np.diag(np.median(rows**2, axis=0)) + 1e-14 * np.eye(3), "std columns")


def given_noise(table: "Table", measured: np.ndarray, direction: np.ndarray, sigma: float | None) -> Noise | None:
    """The noise floor from the data or the machine file.

    A tracker's own standard deviations, taken while the machine stands, do not contain what differs from visit to
    visit; where repeats scatter by more, the repeats are used.

    Args:
        table: n rows.
        measured: readings in the base frame, (n, 3) mm.
        direction: directions of arrival, (n, k).
        sigma: the machine file's figure for one coordinate, mm.

    Returns:
        The noise; None where only a saturated model can give it.
    """
    known = _given_noise(table, measured, direction, sigma)
    if known is None:
        return None
    read = table.measured[np.isfinite(table.measured).all(axis=1) & (table.role != "base")]
    least = least_variance(read, known.total**2 / 3.0)
    return replace(known, covariance=at_least(known.covariance, least), least=least)


def _given_noise(table: "Table", measured: np.ndarray, direction: np.ndarray, sigma: float | None) -> Noise | None:
    repeats = noise_from_repeats(table, measured, direction)
    columns, file = noise_from_std(table), Noise(np.eye(3) * sigma**2, "machine file") if sigma is not None else None
    if columns is not None and (repeats is None or repeats.total <= columns.total):
        return columns
    if repeats is None:
        return file
    stated = columns or file
    return repeats if stated is None else replace(repeats, stated=(stated.source, stated.total))


def _deviations(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, int]:
    count = np.bincount(group)
    mean = np.column_stack([np.bincount(group, column) for column in values.T]) / np.maximum(count, 1)[:, None]
    return values - mean[group], int(len(values) - (count > 0).sum())


def _unbiased(deviation: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deviations scaled from group means to the true means, by sqrt(n / (n - 1)), and which rows have repeats."""
    size = np.bincount(group)[group]
    return deviation * np.sqrt(size / np.maximum(size - 1.0, 1.0))[:, None], size > 1
