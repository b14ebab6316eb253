"""Smooth basis functions over a range scaled to -1 .. 1."""

import numpy as np

LEAST_EXTREME = 3  # rows that have to lie as far out as a value for it to count in full

MODULATION_DEGREE = 4  # degree of what only modulates something else
MODULATION_DECAY = 0.7  # size of each of its polynomials over the one before


def column_ends(values: np.ndarray) -> np.ndarray:
    """Lowest and highest value of each column, (2, ...), NaN left aside."""
    return np.array([np.nanmin(values, axis=0), np.nanmax(values, axis=0)])


def scaled(values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Values mapped so that the ends (2, ...) of their range lie at -1 and 1, clipped to these."""
    low, high = ends
    return np.asarray(np.clip((2.0 * values - low - high) / np.maximum(high - low, 1e-9), -1.0, 1.0))


def reined(values: np.ndarray) -> np.ndarray:
    """Values with the two outermost at either end clipped to twice the third outermost's distance from the median.

    What one or two rows show alone is no law: a function with leverage there would take whatever error they have.

    Args:
        values: (n, ...) of columns; NaN where unknown.
    """
    known = np.isfinite(values).sum(axis=0)
    if (known < 2 * LEAST_EXTREME).any():
        return values
    wanted = np.unique([LEAST_EXTREME - 1, *np.ravel(known - LEAST_EXTREME)])
    order, middle = np.partition(values, wanted, axis=0), np.nanmedian(values, axis=0)  # NaN goes last
    third = np.take_along_axis(order, np.expand_dims(known - LEAST_EXTREME, 0), axis=0)[0]
    return np.asarray(np.clip(values, 2.0 * order[LEAST_EXTREME - 1] - middle, 2.0 * third - middle))


def legendre(values: np.ndarray, degree: int) -> np.ndarray:
    """Legendre polynomials of unit mean square over the range, (n, degree + 1)."""
    return np.asarray(np.polynomial.legendre.legvander(values, degree) * np.sqrt(2.0 * np.arange(degree + 1) + 1.0))


def modulation(values: np.ndarray) -> np.ndarray:
    """Legendre polynomials of decreasing size, to modulate something else, (n, `MODULATION_DEGREE` + 1)."""
    return legendre(values, MODULATION_DEGREE) * MODULATION_DECAY ** np.arange(MODULATION_DEGREE + 1)


def cosines(values: np.ndarray, count: int) -> np.ndarray:
    """Cosines over the range, the k-th of size 1/k, so that the curve is smooth and its slope rough, (n, count)."""
    order = np.arange(1, count + 1)
    return np.asarray(np.sqrt(2.0) * np.cos(0.5 * np.pi * order * (values[:, None] + 1.0)) / order)


def harmonics(angle: np.ndarray, count: int = 2) -> np.ndarray:
    """First harmonics of an angle in rad, the m-th of size 1/m, (n, 2 count)."""
    return np.column_stack([f(m * angle) / m for m in range(1, count + 1) for f in (np.cos, np.sin)])


def product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """All products of shapes (n, a) and (n, b), (n, a b)."""
    return (left[:, :, None] * right[:, None, :]).reshape(len(left), -1)


def unit(values: np.ndarray) -> np.ndarray:
    """Values scaled to unit mean square."""
    return values / max(float(np.sqrt(np.square(values).mean())), 1e-9)
