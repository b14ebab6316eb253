"""Chance: log p-values far into the tail, the largest of many, and what slow error adds."""

from functools import lru_cache

import numpy as np
from scipy import fft, special

from ptt.run.tails import chi2_isf

EULER = 0.5772156649015329
GATE = 0.02  # chance at which slow power counts as more than white
SURE = 16.0  # -log(1 - share) beyond which shares are not told apart


def log_chance(share: np.ndarray, dims: int, freedom: int) -> np.ndarray:
    """Minus the log of the chance that noise gives a share so large.

    The share of `dims` directions in white noise follows a beta distribution (dims / 2, freedom / 2).

    Args:
        share: any shape, 0 to 1.
        dims: directions fitted.
        freedom: directions left.

    Returns:
        The same shape, natural log.
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
    """Chance that the largest of many reaches what was found.

    Args:
        found: any shape, log chances.
        largest: (B,) largest log chance of each permutation.

    Returns:
        The same shape: tail of the Gumbel distribution fitted by moments. Its scale is at least 1, which log chances
        have by construction where noise is Gaussian.
    """
    scale = max(float(np.std(largest, ddof=1)) * np.sqrt(6.0) / np.pi, 1.0)
    place = float(np.mean(largest)) - EULER * scale
    return -np.expm1(-np.exp(-(np.asarray(found) - place) / scale))


def slow_excess(left: np.ndarray, slow: int, removed: np.ndarray | None = None) -> np.ndarray:
    """How far the slow part of an error stands above its quick part.

    The power of drift falls as 1 / k^2 over the cosines k of the travel, like a random walk's; that of a shorter memory
    is level. The larger of the two laws counts at each k.

    Args:
        left: (n,) error in travel order.
        slow: how many of the slowest cosines count as slow.
        removed: (slow,) share of one direction that a fitted curve took out of each cosine, None for none.

    Returns:
        (slow,) power of each slow cosine over the quick power, less one; zero where the slow part is no larger than
        chance makes it.
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
    """What columns hold of each of the slowest cosines of the travel, the constant left out.

    Args:
        columns: (n,) or (n, d), orthonormal.
        slow: how many cosines.
        whole: as shares of all that the columns hold.

    Returns:
        (slow,).
    """
    power = np.square(fft.dct(columns.reshape(len(columns), -1), norm="ortho", axis=0)).sum(axis=1)[1:]
    return np.asarray(power[:slow] / max(float(power.sum()), 1e-300) if whole else power[:slow])


def spread(spectrum: np.ndarray, excess: np.ndarray) -> float:
    """How much more a fitted curve scatters under slow error than under white.

    Args:
        spectrum: (slow,) share of the curve in each slow cosine.
        excess: (slow,) of `slow_excess`.

    Returns:
        Variance ratio, at least 1.
    """
    return 1.0 + float(spectrum @ excess)
