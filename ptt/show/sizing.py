"""Thinning of rows for pictures, and round factors for enlarged arrows."""

import numpy as np


def spread(count: int, most: int) -> np.ndarray:
    """At most `most` of the row numbers 0 to `count` - 1, evenly spaced, (m,) int."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(most, count)).astype(int))


def round_down(value: float, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> float:
    """Largest number not above a positive value that is one of `steps` times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in steps if step * power <= value * (1.0 + 1e-9)))
