"""Cholesky factors of normal equations, and inverses by them."""

import numpy as np
from scipy.linalg import lapack

RANK_TOLERANCE = 1e-12  # share of the largest eigenvalue of a Gram matrix below which a direction is rounding


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a positive definite normal matrix, (P, P)."""
    return invert(factor_of(matrix, 0.0))


def factor_of(gram: np.ndarray, more: np.ndarray | float) -> np.ndarray:
    """Lower Cholesky factor of a Gram matrix plus a diagonal, raised slightly further where rounding requires it.

    The scaling of the columns does not affect its accuracy: the factor of scaled columns is the scaled factor.

    Args:
        gram: (P, P).
        more: added to the diagonal, one for all or (P,).

    Returns:
        L with L L^T = gram + diag(more), (P, P).

    Raises:
        LinAlgError: the sum is not positive definite.
    """
    if not len(gram):
        return gram
    extra, diagonal = 0.0, gram.diagonal() + more
    for _ in range(8):
        matrix = gram.copy()
        matrix.ravel()[:: len(gram) + 1] = diagonal * (1.0 + extra)
        factor, failed = lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)  # transposed: LAPACK's memory order
        if not failed:
            return np.asarray(factor)
        extra = max(10.0 * extra, len(gram) * 1e-16)
    raise np.linalg.LinAlgError("normal equations are not positive definite")


def invert(lower: np.ndarray) -> np.ndarray:
    """(L L^T)^-1 of a lower Cholesky factor, (P, P)."""
    if not len(lower):
        return lower
    half = np.asarray(lapack.dpotri(lower, lower=1)[0])  # its upper triangle is zero
    return half + half.T - np.diag(half.diagonal())
