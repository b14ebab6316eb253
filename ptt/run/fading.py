"""First-order lag over uneven steps: exponential forgetting with time, or with travel, from row to row."""

import numpy as np


def kept_shares(step: np.ndarray, starts: np.ndarray, reach: float) -> np.ndarray:
    """Decay factor from the row before to each row: exp(-step / reach).

    Args:
        step: time or travel since the row before, (n,); a negative step counts as none.
        starts: (n,) bool, rows that keep nothing, as the first does in any case.
        reach: time or travel constant, in the unit of the steps.

    Returns:
        (n,), 0 to 1.
    """
    keep = np.where(starts, 0.0, np.exp(-np.maximum(step, 0.0) / reach))
    keep[:1] = 0.0
    return keep


def trailing(values: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """Low-pass of values: y_i = keep_i y_(i-1) + (1 - keep_i) values_i.

    Args:
        values: (n,) or (n, m).
        keep: (n,), as `kept_shares` gives it.

    Returns:
        The same shape, in the unit of the values.
    """
    from scipy.linalg import solve_banded  # only a diagnosis needs it

    bands = np.ones((2, len(keep)))
    bands[1, :-1] = -keep[1:]
    return np.asarray(solve_banded((1, 0), bands, ((1.0 - keep) * values.T).T))
