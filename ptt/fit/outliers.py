"""Gross errors: rows so far off that no noise explains them."""

import numpy as np
from scipy import linalg, stats

CHANCE = 1e-3  # chance that a sound table of readings loses one row to the rule
ROUNDS = 8
KNEE = 6.0  # squared distance, in units of the bulk, at which a row counts half (Cauchy)


def inside(whitened: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Rows that noise can explain.

    Args:
        whitened: residual in units of noise, (n, 3), NaN where not observed.
        used: rows that may count, (n,) bool.

    Returns:
        (n,) bool, a part of `used`. Where the bulk lies wider than noise, so does the limit.
    """
    squared, width = _distances(whitened, used)
    limit = stats.chi2.isf(CHANCE / max(used.sum(), 1), 3) * width
    return used & (np.nan_to_num(squared, nan=np.inf) <= limit)


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
    pull = np.eye(width) * 1e-9
    for _ in range(ROUNDS):
        heavy = (columns * weight[:, None, None]).reshape(-1, width)
        normal = heavy.T @ flat + base_columns.T @ base_columns
        side = heavy.T @ rows.ravel() + base_columns.T @ base_rows
        step = linalg.solve(normal + pull * np.trace(normal), side, assume_a="pos")
        left = rows - (flat @ step).reshape(-1, 3)
        before, weight = weight, _weights(left)
        if np.abs(weight - before).max(initial=0.0) < 0.02:
            break
    return left, weight


def _weights(left: np.ndarray) -> np.ndarray:
    squared, spread = _distances(left, np.ones(len(left), dtype=bool))
    return 1.0 / (1.0 + squared / (KNEE * spread))


def _distances(whitened: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, float]:
    """Squared distance of each row in noise units, and how much wider than noise the bulk of them lies."""
    squared = np.einsum("nc,nc->n", whitened, whitened)
    if not used.any():
        return squared, 1.0
    return squared, max(1.0, float(np.median(squared[used])) / MEDIAN)


MEDIAN = float(stats.chi2.median(3))
