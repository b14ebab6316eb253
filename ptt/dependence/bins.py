"""Bins of a variable, and the means of a residual in them with their band."""

import numpy as np

ROUNDING = 1e-3  # of the range of a variable, within which values are one level
BINS = 12  # of a curve over a variable
HALF = 1.96  # half-width of a 95 % confidence interval, in standard errors


def binned_curve(values: np.ndarray, residual: np.ndarray, count: int = BINS) -> np.ndarray:
    """Binned means with their confidence band.

    Args:
        values: the variable, (n,).
        residual: (n,) mm.
        count: number of bins, see `bins_of`.

    Returns:
        (m, 3) centres, means, half-widths of the 95 % confidence band of each mean.
    """
    number, centre = bins_of(values, count)
    size = np.bincount(number).astype(float)
    mean = np.bincount(number, residual) / size
    spread = np.bincount(number, np.square(residual - mean[number])) / np.maximum(size - 1.0, 1.0)
    pooled = np.square(residual - mean[number]).sum() / max(len(residual) - len(size), 1)
    # The variance of few rows is shrunk towards the pooled one, with the weight of four rows.
    spread = (spread * (size - 1.0) + 4.0 * pooled) / (size + 3.0)
    return np.column_stack([centre, mean, HALF * np.sqrt(spread / size)])


def bins_of(values: np.ndarray, count: int = BINS) -> tuple[np.ndarray, np.ndarray]:
    """Sort values into bins with equal numbers of rows, or one for each level where there are no more levels than bins.

    Levels within `ROUNDING` of each other are one.

    Args:
        values: (n,).
        count: number of bins, at most.

    Returns:
        Bin of each value, (n,) int, and mean of the values in each bin, (m,).
    """
    levels = np.unique(values)
    cuts = levels[1:] if len(levels) <= count else np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    apart = np.diff(cuts, prepend=levels[0]) > ROUNDING * (levels[-1] - levels[0])
    cuts = cuts[apart]  # differences by the rounding of a table are none
    number = np.unique(np.searchsorted(cuts, values, side="right"), return_inverse=True)[1].reshape(-1)
    return number, np.bincount(number, values) / np.bincount(number)
