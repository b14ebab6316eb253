"""Gross errors: rows so far off that no noise explains them."""

import numpy as np
from scipy import linalg

from ptt.fitting.factor import factor_of
from ptt.fitting.stretches import confirmed_by_pose, in_a_row, shifted_stretches
from ptt.run.noise import Noise
from ptt.run.problem import Problem
from ptt.run.tails import chi2_isf, chi2_median, chi2_ppf

LOST_CHANCE = 1e-3  # probability that a sound table of readings loses one row as a gross error
MOST_EXCEPTIONS = 1.0 / 12.0  # share of rows beyond which far rows are no exceptions: trackers lose far fewer readings
# factor on the limit: what a model misses is not normal, its tails reach up to twice as far as those of noise
MISFIT_TAIL = 4.0
REWEIGHTINGS = 8  # rounds of iteratively reweighted least squares
CAUCHY_KNEE = 6.0  # squared distance, in units of the bulk, at which a row has weight one half
CHI2_MEDIAN = chi2_median(3)  # of a squared distance in three coordinates


def inside(
    whitened: np.ndarray, used: np.ndarray, problem: Problem | None = None, noise: Noise | None = None
) -> np.ndarray:
    """Rows that are no gross errors.

    A gross error is an exception: an error of more than one row in twelve is the machine's or the model's, and so is
    one that successive rows or two visits of a pose have. Also left out is a stretch that is sound but for one common
    shift (another reflector, a knock).

    Args:
        whitened: residual in units of noise, (n, 3), NaN where not observed.
        used: rows that may count, (n,) bool.
        problem: the readings, for their order and poses; None where not known.
        noise: unit of the residual; None: no stretch is left out.

    Returns:
        (n,) bool, a subset of `used`. The limit widens with the bulk of the rows.
    """
    squared, _ = _distances(whitened, used)
    squared = np.where(used, np.nan_to_num(squared, nan=np.inf), 0.0)
    far = squared > _limit(squared[used])
    if not far.any():
        return used.copy()
    apart = np.zeros_like(used)
    if problem is not None and noise is not None:
        for part in shifted_stretches(whitened, far, problem, _limit(squared[used]), noise):
            apart[part] = True
    rest = used & ~apart
    gross = rest & (squared > _limit(squared[rest], MOST_EXCEPTIONS))
    if problem is not None and gross.any():
        machine = confirmed_by_pose(gross, whitened, problem)
        for part in in_a_row(far & ~apart, problem):
            machine[part] = True
        gross &= ~machine | np.isinf(squared)
    return rest & ~gross


def _limit(squared: np.ndarray, exceptions: float = 0.5) -> float:
    """Squared distance beyond which a row is far; scaled by the median row, and by the row that exceptions leave."""
    count = len(squared)
    bulk = count - max(1, int(np.ceil(exceptions * count)))
    if bulk < 1:
        return np.inf
    wide = np.sort(squared)[bulk - 1] / chi2_ppf((bulk - 0.5) / count, 3)
    return limit_of(max(1.0, float(wide), float(np.median(squared)) / CHI2_MEDIAN), count)


def limit_of(width: float, rows: int) -> float:
    """Squared distance, in units of noise, beyond which no noise explains a row.

    Args:
        width: of the bulk of the rows, in units of noise squared, at least one.
        rows: how many there are.
    """
    tail = 1.0 + (MISFIT_TAIL - 1.0) * min(width - 1.0, 1.0)
    return float(chi2_isf(LOST_CHANCE / rows, 3)) * width * tail


def linear_residual(
    rows: np.ndarray, columns: np.ndarray, base_rows: np.ndarray, base_columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Residual of a linear problem after iteratively reweighted least squares, Cauchy weights by row.

    Args:
        rows: (m, 3) in units of noise.
        columns: (m, 3, u).
        base_rows: (k,) rows that are trusted.
        base_columns: (k, u).

    Returns:
        Residual (m, 3) and weight of each row, (m,), between 0 and 1.
    """
    width = columns.shape[-1]
    flat = columns.reshape(rows.size, width)
    weight, left = np.ones(len(rows)), rows
    if not width:
        return left, _weights(left)
    for _ in range(REWEIGHTINGS):
        heavy = (columns * weight[:, None, None]).reshape(-1, width)
        normal = heavy.T @ flat + base_columns.T @ base_columns
        side = heavy.T @ rows.ravel() + base_columns.T @ base_rows
        # Each column is held by a part of its own strength: one of the strongest would hold weak ones where they are.
        factor = factor_of(normal, 1e-9 * (1.0 + normal.diagonal()))
        step = linalg.cho_solve((factor, True), side)
        left = rows - (flat @ step).reshape(-1, 3)
        before, weight = weight, _weights(left)
        if np.abs(weight - before).max(initial=0.0) < 0.02:
            break
    return left, weight


def _weights(left: np.ndarray) -> np.ndarray:
    squared, spread = _distances(left, np.ones(len(left), dtype=bool))
    return 1.0 / (1.0 + squared / (CAUCHY_KNEE * spread))


def _distances(whitened: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, float]:
    """Squared distance of each row in noise units, and how much wider than noise the bulk of them lies."""
    squared = np.einsum("nc,nc->n", whitened, whitened)
    if not used.any():
        return squared, 1.0
    return squared, max(1.0, float(np.median(squared[used])) / CHI2_MEDIAN)
