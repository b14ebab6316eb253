"""Points in the order of a balanced k-d tree that needs no pointers."""

import numpy as np


def tree_order(points: np.ndarray) -> np.ndarray:
    """Order in which the middle of every range is the median along its depth's axis, smaller values before it.

    Args:
        points: (d, m).

    Returns:
        (d,) row numbers.
    """
    order = np.arange(len(points))

    def sort(first: int, end: int, depth: int) -> None:
        if end - first < 2:
            return
        axis, middle = depth % points.shape[1], (first + end) // 2
        part = order[first:end]
        order[first:end] = part[np.argpartition(points[part, axis], middle - first)]
        sort(first, middle, depth + 1)
        sort(middle + 1, end, depth + 1)

    sort(0, len(order), 0)
    return order
