"""The noise floor: what repeats scatter by, and where the figure comes from."""

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

NEAR_IN_TIME = 1800.0  # s: repeats further apart than this have seen drift and warmth come between
ROUNDS = 6  # of leaving out repeats that are far off
CHANCE = 1e-3  # that the farthest of all repeats is left out where all are sound
ENOUGH = 30  # degrees of freedom below which repeats alone do not make a noise floor
ROUNDING = 1e-9  # of the summed variances: what scatters by less in some direction than others' rounding
NOTHING = 1e-18  # mm^2: no reading is better than a nanometre
STEPS = tuple(digit * 10.0**-power for power in range(1, 5) for digit in (5.0, 2.0, 1.0))  # mm, that readings come in
ON_STEP = 1e-5  # of a step: how near a reading lies to a whole number of them
FIRST = 1000  # readings asked before all are
SAME_WARMTH = 0.5  # K
SAME_LOAD = 0.01  # kg
SAME_FEED = 1e-3  # mm/s
SATURATED = "saturated model"  # source of a noise that nothing tells but what everything at once leaves
REPEATS = "repeats"  # source of a noise that repeats tell
GUESSED = "first guess"  # source of one that nothing tells: used to weigh by, never told
VISITED = f"{SATURATED}; readings of one visit scatter by less"  # where no pose was visited again to tell it
COARSEST = 0.01  # mm, of a tracker's last digit: readings that all lie on coarser steps are targets
READABLE = 1e-4  # mm: no tracker reads finer, the air alone moves its beam by more
DEFAULT_SIGMA = 0.005  # mm, one coordinate of a hand-held reflector: used only to start with, never reported


@dataclass(frozen=True)
class Noise(Record):
    """Scatter of one reading.

    Attributes:
        covariance: (3, 3) mm^2 of the coordinates of one reading, in the base frame.
        source: where it comes from: 'repeats', 'std columns', 'machine file', 'saturated model', with what it outdoes
            behind that; 'first guess' where nothing tells it.
        freedom: degrees of freedom behind it, of coordinates for a saturated model, of readings (three coordinates)
            for repeats; infinite where it was given.
        stated: what the std columns or the machine file state in its stead, its source and total in mm; None where
            nothing else does.
        least: mm^2, variance of one coordinate that no explanation leaves less of.
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
        """W with W^T W the inverse covariance and W W^T diagonal, (3, 3) 1/mm: its rows are the noise's own axes."""
        least = max(ROUNDING * float(np.trace(self.covariance)), NOTHING)
        squares, ways = np.linalg.eigh(at_least(self.covariance, least))
        return np.asarray(ways.T / np.sqrt(squares)[:, None])

    def log_density(self, rows: int) -> float:
        """Logarithm of the density of so many readings that meet what is predicted, 1/mm each coordinate.

        Less half of chi-squared, and apart from what no noise changes, it is that of any readings, so that explanations
        with different noise and rows compare.
        """
        return rows * float(np.linalg.slogdet(self.whitener)[1])


def source_in_words(source: str) -> str:
    """Where a noise comes from, within a sentence: 'repeats', but 'the machine file', 'the std columns'."""
    return source if source == REPEATS else f"the {source}"


def guessed_noise() -> Noise:
    """A noise to start with, where nothing tells it."""
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
        The noise, or None with fewer than `ENOUGH` degrees of freedom.
    """
    usable = np.isfinite(measured).all(axis=1) & (table.role != "base")
    group = repeat_groups(table, direction)
    usable &= first_of_copies(table, group)
    apart = usable & first_rows(visit_groups(table), usable)
    pooled = _pooled(measured[apart], group[apart]) or _pooled(measured[usable], group[usable])
    if pooled is None:
        return None
    step = step_of(table.measured[usable])
    return replace(pooled, covariance=at_least(pooled.covariance, step**2 / 12.0))


def _pooled(values: np.ndarray, group: np.ndarray) -> Noise | None:
    """Scatter of readings (m, 3) about the means of their groups (m,); None with fewer than `ENOUGH` degrees."""
    group = np.unique(group, return_inverse=True)[1].reshape(-1)
    kept = np.ones(len(values), dtype=bool)
    for _ in range(ROUNDS):
        deviation, freedom = _deviations(values[kept], group[kept])
        if freedom < ENOUGH:
            return None
        covariance = deviation.T @ deviation / freedom
        lifted, repeated = _lifted(deviation, group[kept])
        scale = np.maximum(median_sigma(lifted[repeated], axis=0), 1e-9)
        far = ((lifted / scale) ** 2).max(axis=1) > chi2_isf(CHANCE / len(values), 1)
        if not far.any():
            break
        kept[np.flatnonzero(kept)[far]] = False
    return Noise(covariance, REPEATS, float(freedom))


def at_least(covariance: np.ndarray, variance: float) -> np.ndarray:
    """A covariance with no direction of less than some variance, (3, 3) mm^2; as it is where it has none.

    Args:
        covariance: (3, 3) mm^2.
        variance: mm^2.
    """
    sizes, ways = np.linalg.eigh(covariance)
    if sizes[0] >= variance:
        return covariance
    return np.asarray((ways * np.maximum(sizes, variance)) @ ways.T)


def step_of(reading: np.ndarray) -> float:
    """The step that readings come in, mm: repeats within one step look alike, and are not.

    Args:
        reading: (n, 3) mm, in the tracker's own axes.

    Returns:
        The largest of the usual decimal steps that all of them are whole numbers of; zero where none is.
    """
    for step in STEPS:
        if _are_whole(reading[:FIRST], step) and _are_whole(reading, step):
            return step
    return 0.0


def _are_whole(reading: np.ndarray, step: float) -> bool:
    steps = reading / step
    return bool((np.abs(steps - np.round(steps)) < ON_STEP).all())


def least_variance(reading: np.ndarray, stated: float = np.inf) -> float:
    """Variance that readings of a tracker have at the least, mm^2.

    Args:
        reading: (n, 3) mm.
        stated: variance that is known of one coordinate, mm^2: a scale may read finer than any tracker.

    Returns:
        What their last digit leaves, or a tracker's own finest.
    """
    step = step_of(reading)
    return max(step**2 / 12.0 if step <= COARSEST else 0.0, min(READABLE**2, stated))


def first_of_copies(table: "Table", group: np.ndarray) -> np.ndarray:
    """Rows that are no copy, to the last digit, of an earlier reading of their group.

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
    rows = table.std[(table.std > 0.0).all(axis=1) & (table.role != "base")]  # zero is what a tracker does not know
    if not len(rows):
        return None
    return Noise(np.diag(np.median(rows**2, axis=0)) + 1e-14 * np.eye(3), "std columns")


def given_noise(table: "Table", measured: np.ndarray, direction: np.ndarray, sigma: float | None) -> Noise | None:
    """The noise floor as far as the data or the machine file tell it.

    Standard deviations of single held poses leave out what differs from visit to visit; where repeats scatter by
    more, the repeats count.

    Args:
        table: n rows.
        measured: readings in the base frame, (n, 3) mm.
        direction: directions of arrival, (n, k).
        sigma: the machine file's figure for one coordinate, mm.

    Returns:
        The noise, or None where only a saturated model can tell.
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


def _lifted(deviation: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deviations from group means as large as those from the true means would be, and which rows have company."""
    size = np.bincount(group)[group]
    return deviation * np.sqrt(size / np.maximum(size - 1.0, 1.0))[:, None], size > 1
