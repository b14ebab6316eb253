"""Standardising the inputs, so that one spread means the same along each of them."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

CONSTANT_BELOW = 1e-6  # of the largest spread: an input that varies less is rounding, not information


def input_scaling(inputs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation per input.

    An input that is constant in training would be divided by zero; it is scaled like the widest one, so that a
    departure from the constant counts as much as a departure along an input that was seen to vary.

    Args:
        inputs: (n, m), any unit per column.

    Returns:
        mean (m,) and scale (m,) in the columns' units; scaled input = (input - mean) / scale.
    """
    mean, deviation = inputs.mean(axis=0), inputs.std(axis=0)
    largest = float(deviation.max())
    if largest == 0.0:
        return mean, np.ones_like(deviation)
    return mean, np.where(deviation > CONSTANT_BELOW * largest, deviation, largest)
