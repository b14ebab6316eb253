"""Gross errors: readings that neither the present model nor any effect that might be missing can explain."""

import numpy as np

from ptt.fit.outliers import inside, linear_residual

COMPANY = 2  # far rows among the four nearest from which a row is one of a stretch
MOST = 0.12  # share of rows beyond which far rows are no exceptions
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
    width = len(chosen)
    left, _ = linear_residual(values[rows], columns[rows][..., chosen], np.zeros(width), np.eye(width))
    far = np.zeros(len(values), dtype=bool)
    far[rows] = ~inside(left, np.ones(len(left), dtype=bool))
    return far


def alone(far: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Far rows that stand alone: several in a row are a knock, a slip or another reflector, not broken beams.

    Args:
        far: (n,) bool.
        used: rows whose readings count, (n,) bool.

    Returns:
        (n,) bool; none where so many are far that the model is to blame.
    """
    near = np.convolve(far, [1, 1, 0, 1, 1], mode="same")[: len(far)]
    lone = far & (near < COMPANY)
    return lone if lone.sum() <= MOST * used.sum() else np.zeros_like(far)
