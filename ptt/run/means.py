"""Means of groups of rows, and what the rows are about them."""

import numpy as np


def group_means(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means of the rows of each group.

    Args:
        values: (n,) or (n, m).
        group: (n,) int, groups in any numbering.

    Returns:
        Place of each row's group in the order of their numbers, (n,) int, and the mean of each, (g,) or (g, m).
    """
    number = np.unique(group, return_inverse=True)[1].reshape(-1)
    size = np.bincount(number)
    if values.ndim == 1:
        return number, np.bincount(number, values, len(size)) / size
    mean = np.empty((len(size), values.shape[1]))
    for place, column in enumerate(values.T):
        mean[:, place] = np.bincount(number, column, len(size)) / size
    return number, mean


def about_means(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Values, (n,) or (n, m), less the mean of their group, (n,) int."""
    number, mean = group_means(values, group)
    return np.asarray(values - mean[number])
