"""p-values far into the tail, of the largest of many statistics, and under autocorrelated (slow) error."""

from functools import lru_cache

import numpy as np
from scipy import fft, special

from ptt.run.tails import chi2_isf

EULER = 0.5772156649015329
GATE = 0.02  # p-value below which the power of the slow cosines counts as more than white
SURE = 16.0  # end of the table in -log(1 - share); larger shares have its last p-value


def minus_log_p(share: np.ndarray, dims: int, freedom: int) -> np.ndarray:
    """Minus the natural log of the p-value of a share of variance (coefficient of determination).

    In white noise the share that `dims` columns explain follows a beta distribution (dims / 2, freedom / 2).

    Args:
        share: any shape, 0 to 1.
        dims: number of columns fitted.
        freedom: degrees of freedom left.

    Returns:
        -log p, of the same shape.
    """
    grid, log = _table(dims, freedom)
    return np.interp(-np.log1p(-np.clip(share, 0.0, 1.0 - 1e-7)), grid, log)


@lru_cache(maxsize=256)
def _table(dims: int, freedom: int) -> tuple[np.ndarray, np.ndarray]:
    grid = np.concatenate([np.linspace(0.0, 1.0, 600), np.linspace(1.005, SURE, 400)])
    a, b = dims / 2.0, max(freedom, 1) / 2.0
    exact = special.betainc(b, a, np.exp(-grid))
    tail = -b * grid + (a - 1.0) * np.log(-np.expm1(-np.maximum(grid, 1e-9))) - np.log(b) - special.betaln(a, b)
    return grid, -np.where(exact > 1e-280, np.log(np.maximum(exact, 1e-300)), tail)


def gumbel_tail(found: np.ndarray | float, largest: np.ndarray) -> np.ndarray:
    """p-value of a statistic -log p against the largest one of each permutation.

    Args:
        found: -log p, any shape.
        largest: largest -log p over all tests in each of B permutations, (B,).

    Returns:
        Of the same shape: tail of the Gumbel distribution fitted by moments. Its scale is at least 1, since -log p of a
        true null hypothesis is exponential with scale 1.
    """
    scale = max(float(np.std(largest, ddof=1)) * np.sqrt(6.0) / np.pi, 1.0)
    place = float(np.mean(largest)) - EULER * scale
    return -np.expm1(-np.exp(-(np.asarray(found) - place) / scale))


def slow_excess(left: np.ndarray, slow: int, removed: np.ndarray | None = None) -> np.ndarray:
    """Excess power of the slow part of an error over white noise, by its discrete cosine transform over the rows.

    A drift, as a random walk, has power falling as 1 / k^2 over the cosines k; a shorter memory has level power. Both
    spectra are scaled to the excess, and the larger one counts at each k.

    Args:
        left: residual in travel order, (n,).
        slow: number of lowest cosines that count as slow.
        removed: degrees of freedom that a fitted curve took out of each slow cosine, (slow,); None for none.

    Returns:
        Power of each slow cosine over the mean power of the others, less one, (slow,); zeros where the slow part is not
        significant.
    """
    taken = np.zeros(slow) if removed is None else np.minimum(removed, 0.9)
    power = np.square(fft.dct(left, norm="ortho"))[1:]
    quick = float(power[slow:].mean())
    if quick <= 0.0:
        return np.zeros(slow)
    excess = float(power[:slow].sum()) / quick
    if excess < chi2_isf(GATE, slow - taken.sum()):
        return np.zeros(slow)
    falling = 1.0 / np.arange(1, slow + 1) ** 2
    above = excess - (1.0 - taken).sum()
    return np.maximum(above / ((1.0 - taken) * falling).sum() * falling, above / (1.0 - taken).sum())


def slow_spectrum(columns: np.ndarray, slow: int, *, whole: bool = True) -> np.ndarray:
    """Power of columns in each of the lowest cosines over the rows, the constant left out.

    Args:
        columns: (n,) or (n, d), orthonormal.
        slow: number of cosines.
        whole: whether as shares of the columns' whole power.

    Returns:
        (slow,).
    """
    power = np.square(fft.dct(columns.reshape(len(columns), -1), norm="ortho", axis=0)).sum(axis=1)[1:]
    return np.asarray(power[:slow] / max(float(power.sum()), 1e-300) if whole else power[:slow])


def variance_inflation(spectrum: np.ndarray, excess: np.ndarray) -> float:
    """Variance of a fitted curve under slow error over that under white noise.

    Args:
        spectrum: share of the curve's power in each slow cosine, (slow,).
        excess: of `slow_excess`, (slow,).

    Returns:
        The ratio, at least 1.
    """
    return 1.0 + float(spectrum @ excess)
