"""Gross errors: readings that neither the present model nor any effect that might be missing can explain."""

import numpy as np
from scipy import linalg, stats

CHANCE = 1e-3  # chance that a table of sound readings loses one
ROUNDS = 8
PLENTY = 2.5  # coordinates for each column of a saturated model, below which it could explain anything


def gross_errors(
    columns: np.ndarray, values: np.ndarray, rows: np.ndarray, simple: np.ndarray, saturated: np.ndarray
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

    Returns:
        (n,) bool.
    """
    far = far_rows(columns, values, rows, simple)
    if far.any() and 3 * rows.sum() > PLENTY * len(saturated):
        far = far_rows(columns, values, rows, saturated)
    return far


def far_rows(columns: np.ndarray, values: np.ndarray, rows: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Rows far from a robust fit: least squares reweighted with Cauchy weights, row by row.

    Args:
        columns: (n, 3, P) whitened, in usual sizes; a prior one usual size wide holds what the rows do not see.
        values: (n, 3) whitened.
        rows: rows that count, (n,) bool.
        chosen: columns of the model.

    Returns:
        (n,) bool.
    """
    flat, value = columns[rows][..., chosen], values[rows]
    weight, left = np.ones(len(value)), value
    squared, spread = np.square(value).sum(axis=1), 1.0
    for _ in range(ROUNDS if flat.shape[-1] else 0):
        heavy = (flat * weight[:, None, None]).reshape(-1, flat.shape[-1])
        normal = heavy.T @ flat.reshape(-1, flat.shape[-1]) + np.eye(flat.shape[-1])
        left = value - flat @ linalg.solve(normal, heavy.T @ value.ravel(), assume_a="pos")
        squared = np.square(left).sum(axis=1)
        spread = max(float(np.median(squared)) / stats.chi2.median(3), 1e-12)
        weight = 1.0 / (1.0 + squared / (6.0 * spread))
    far = np.zeros(len(values), dtype=bool)
    far[rows] = squared > stats.chi2.isf(CHANCE / max(len(value), 1), 3) * max(1.0, spread)
    return far
