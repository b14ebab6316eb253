"""Tails and quantiles of the distributions that decide, from scipy.special: scipy.stats takes seconds to load."""

import numpy as np
from scipy import special

Values = np.ndarray | float
QUARTILE = 0.6745  # within which half of all normal deviates lie


def chi2_sf(x: Values, freedom: Values) -> np.ndarray:
    """Chance that chi-squared of so many degrees of freedom exceeds x."""
    return np.asarray(special.chdtrc(freedom, np.maximum(x, 0.0)))


def chi2_isf(chance: Values, freedom: Values) -> np.ndarray:
    """Upper quantile: value that chi-squared exceeds with this chance."""
    return np.asarray(special.chdtri(freedom, chance))


def chi2_ppf(share: Values, freedom: Values) -> np.ndarray:
    """Quantile: value that chi-squared stays below with this chance."""
    return np.asarray(2.0 * special.gammaincinv(np.asarray(freedom) / 2.0, share))


def chi2_median(freedom: float) -> float:
    """Median of chi-squared."""
    return float(chi2_ppf(0.5, freedom))


def median_sigma(deviation: np.ndarray, axis: int | None = None) -> np.ndarray:
    """Robust standard deviation of normal deviates by the median of their absolute values.

    Args:
        deviation: from their centre, of any shape.
        axis: to take the median along; None for all of them.

    Returns:
        In the unit of the deviates, () or without that axis.
    """
    return np.asarray(np.median(np.abs(deviation), axis=axis) / QUARTILE)


def f_sf(x: Values, above: Values, below: Values) -> np.ndarray:
    """Chance that a ratio of two mean squares, of so many degrees of freedom each, exceeds x."""
    return np.asarray(special.fdtrc(above, below, np.maximum(x, 0.0)))


def f_cdf(x: Values, above: Values, below: Values) -> np.ndarray:
    """Chance that a ratio of two mean squares stays below x."""
    return np.asarray(special.fdtr(above, below, np.maximum(x, 0.0)))


def f_ppf(share: Values, above: Values, below: Values) -> np.ndarray:
    """Value of F that a share of its distribution lies below; arguments as of `f_sf`."""
    return np.asarray(special.fdtri(above, below, share))


def t_ppf(share: float, freedom: float) -> float:
    """Quantile of Student's t; infinite degrees of freedom give the normal one."""
    return float(special.ndtri(share) if np.isinf(freedom) else special.stdtrit(freedom, share))


def normal_sf(x: float) -> float:
    """Chance that a normal deviate exceeds x."""
    return float(special.ndtr(-x))


def poisson_sf(count: float, expected: float) -> float:
    """Chance that a Poisson count with this mean exceeds `count`."""
    return 1.0 if count < 0 else float(special.pdtrc(np.floor(count), expected))
