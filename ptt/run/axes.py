"""The axes of a tool position, by the names that figures of an error have, and how large errors along them are."""

from collections.abc import Sequence

import numpy as np

AXES = ("x", "y", "z")
AXES_TOTAL = (*AXES, "total")  # total: the root of the sum of their squares


def rms(error: np.ndarray, rows: np.ndarray | Sequence[bool] | None = None) -> dict[str, float]:
    """Root mean square of errors per axis and in total, in micrometres.

    Args:
        error: (n, 3) mm.
        rows: which rows count, (n,) bool; None for all.

    Returns:
        x, y, z, and total = sqrt(x^2 + y^2 + z^2).
    """
    squares = np.mean(np.square(error if rows is None else error[np.asarray(rows)]), axis=0)
    x, y, z = (float(value) * 1e3 for value in np.sqrt(squares))
    return {"x": x, "y": y, "z": z, "total": float(np.sqrt(squares.sum())) * 1e3}


def rms_length(vectors: np.ndarray) -> float:
    """Root mean square length of (n, 3) vectors, in their own unit."""
    return float(np.sqrt(np.square(vectors).sum(axis=1).mean()))
