"""Which row a row goes by that says nothing itself: the machine stands as it stood while a reflector is read."""

import numpy as np


def rows_beside(known: np.ndarray) -> np.ndarray:
    """For each row the last one up to it that is known, at the beginning the first that will be.

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
