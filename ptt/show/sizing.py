"""How much a picture shows: as many rows as it holds, and a round factor that makes arrows well seen."""

import numpy as np


def spread(count: int, most: int) -> np.ndarray:
    """At most so many of `count` row numbers, (m,) int, spread evenly over all of them."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(most, count)).astype(int))


def round_down(value: float, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> float:
    """Largest of some steps times a power of ten that is no larger than a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in steps if step * power <= value * (1.0 + 1e-9)))
