"""Which row stands for a row without information of its own: while the machine does not move, the one before."""

import numpy as np


def rows_beside(known: np.ndarray) -> np.ndarray:
    """Index of the last known row up to each row; before the first known row, of that one.

    Args:
        known: (n,) bool.

    Returns:
        (n,) int; the row itself where none is known at all.
    """
    rows = np.arange(len(known))
    if not known.any():
        return rows
    last = np.maximum.accumulate(np.where(known, rows, -1))
    return np.where(last < 0, int(np.argmax(known)), last)
