"""Where a step or a bump lies along a variable, and the period of a wave: what is near the best trial is tried.

Everywhere `base` (n, k) are columns that are fitted beside the shape, `residual` (n,) is in mm, `values` (n,) are those
of the variable, in its unit, and `share` is of the residual's variance, base and shape together, 0 to 1.
"""

import numpy as np

from ptt.dependence.periods import harmonics, refine_frequency
from ptt.dependence.regressors import raised_cosine

EDGE = 3.84  # chi-squared of one degree of freedom, 95 %
LEAST_BESIDE = 4  # rows that a bump has on either side


def scaled(values: np.ndarray) -> np.ndarray:
    """Values of a variable as -1 to 1 over their range, (n,)."""
    return 2.0 * (values - values.min()) / np.ptp(values) - 1.0


def _share(columns: np.ndarray, residual: np.ndarray) -> float:
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1.0 - float(left @ left) / max(float(residual @ residual), 1e-300)


def locate_period(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, frequency: float, effective_rows: float
) -> tuple[float, float, float]:
    """Find the period of a wave.

    Args:
        base: columns fitted beside it.
        residual: what is followed.
        values: the variable.
        frequency: the best trial's, one over the variable's unit.
        effective_rows: effective number of independent rows.

    Returns:
        Period in the variable's unit, share, and extra parameters: two for a second harmonic where the information
        criterion prefers it.
    """
    rest = residual - base @ np.linalg.lstsq(base, residual, rcond=None)[0]
    frequency = refine_frequency(values, rest, frequency)
    one = _share(np.column_stack([base, harmonics(values, np.array([frequency]))]), residual)
    two = _share(np.column_stack([base, harmonics(values, np.array([frequency, 2.0 * frequency]))]), residual)
    better = effective_rows * np.log(max(1.0 - two, 1e-9) / max(1.0 - one, 1e-9)) + 2.0 * np.log(effective_rows) < 0
    return (1.0 / frequency, two, 2.0) if better else (1.0 / frequency, one, 0.0)


def locate_step(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, near: float
) -> tuple[tuple[float, float], float]:
    """Find a step.

    Args:
        base: columns fitted beside it.
        residual: what is followed.
        values: the variable.
        near: the best trial's place, in the variable's unit.

    Returns:
        95 % confidence interval of its place in the variable's unit, and its share.
    """
    levels = np.unique(values)
    at = int(np.searchsorted(levels, near))
    reach = max(len(levels) // 20, 3)
    last = np.arange(max(at - reach, 0), min(at + reach + 1, len(levels) - 1))
    column = (values[:, None] > (levels[last] + levels[last + 1]) / 2).astype(float)
    share = _added_shares(base, residual, column)
    best = int(np.argmax(share))
    spread = (1.0 - share[best]) / max(len(values) - base.shape[1] - 1, 1)
    inside = last[share >= share[best] - EDGE * spread]
    return (float(levels[inside.min()]), float(levels[inside.max() + 1])), float(share[best])


def locate_bump(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, low: float, high: float
) -> tuple[str, tuple[float, float] | None, float]:
    """Find a bump, or what it is instead where most rows lie in it and hardly one on a side.

    A few readings after long rests would otherwise be told as a bump of all the others.

    Args:
        base: columns fitted beside it.
        residual: what is followed.
        values: the variable.
        low: where the best trial begins, in the variable's unit.
        high: where it ends.

    Returns:
        'bump', 'step' or 'smooth'; its ends, or the confidence interval of the step, or None; its share.
    """
    feet, share = _feet(base, residual, values, (low + high) / 2, high - low)
    beside = int((values < feet[0]).sum()), int((values > feet[1]).sum())
    if min(beside) >= LEAST_BESIDE or 2 * sum(beside) > len(values):
        return "bump", feet, share
    towards = feet[1] if beside[0] < beside[1] else feet[0]
    place, taken = locate_step(base, residual, values, 0.25 * (feet[0] + feet[1]) + 0.5 * towards)
    return ("step", place, taken) if taken >= share else ("smooth", None, share)


def _feet(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, middle: float, width: float
) -> tuple[tuple[float, float], float]:
    """Ends of the best bump among places and widths around a trial, and its share."""
    shift, stretch = np.meshgrid(np.linspace(-0.4, 0.4, 9), (0.7, 0.85, 1.0, 1.2, 1.4))
    middles, widths = middle + shift.ravel() * width, stretch.ravel() * width
    share = _added_shares(base, residual, raised_cosine(values, middles, widths).astype(float))
    best = int(np.argmax(share))
    feet = (float(middles[best] - widths[best] / 2), float(middles[best] + widths[best] / 2))
    return feet, float(share[best])


def _added_shares(base: np.ndarray, residual: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Share of variance of base and one further column, for every column, (m,)."""
    basis = np.linalg.qr(base)[0]
    left = residual - basis @ (basis.T @ residual)
    clean = columns - basis @ (basis.T @ columns)
    length = np.square(clean).sum(axis=0)
    taken = np.square(clean.T @ left) / np.where(length > 1e-9 * len(residual), length, np.inf)
    return 1.0 - (float(left @ left) - taken) / max(float(residual @ residual), 1e-300)
