"""Clustering of values that count as the same: pose, temperature, load, time. One rule for the whole program."""

import numpy as np

SAME_POSE = 1e-3  # mm (rad): targets (commands) closer than this are one pose; no machine is positioned that finely
ROUNDING = 1e-6  # relative slack of a tolerance: 0.301 - 0.300 in binary is a little more than 0.001
WIDEST = 2.0  # tolerances: a chain of neighbours wider than this is a path, not a pose


def number_alike(values: np.ndarray, tolerance: float, within: np.ndarray | None = None) -> np.ndarray:
    """Number clusters of rows by single linkage, column by column.

    Rows are linked where no column differs by more than the tolerance, and through further rows; so no grid of cells
    with edges is involved. A cluster wider than `WIDEST` tolerances, such as a densely sampled path, is cut into equal
    parts no wider than the tolerance.

    Args:
        values: (n,) or (n, m); NaN equals NaN only.
        tolerance: in the unit of the values.
        within: (n,) int, rows with different numbers are never in one cluster; None for no such restriction.

    Returns:
        (n,) int from 0, in order of first appearance.
    """
    if not len(values):
        return np.zeros(0, dtype=np.int64)
    columns = list(np.asarray(values, dtype=float).reshape(len(values), -1).T)
    group = np.zeros(len(values), dtype=np.int64) if within is None else number_rows(np.asarray(within)[:, None])
    unchanged, turn = 0, 0
    while unchanged < len(columns):
        count = group.max()
        group = _cut_at_gaps(group, columns[turn % len(columns)], tolerance * (1.0 + ROUNDING))
        unchanged, turn = (0 if group.max() > count else unchanged + 1), turn + 1
    for column in columns:
        group = _cut_if_wide(group, column, tolerance)
    return number_rows(group[:, None])


def same_places(place: np.ndarray) -> np.ndarray:
    """Number the poses of positions or joint values.

    Args:
        place: (n, 3) mm or (n, k) mm or rad.

    Returns:
        (n,) int from 0, in order of first appearance.
    """
    return number_alike(place, SAME_POSE)


def count_places(place: np.ndarray) -> int:
    """How many poses there are among (n, 3) places."""
    return int(same_places(place).max(initial=-1)) + 1


def number_rows(keys: np.ndarray) -> np.ndarray:
    """Number the different rows of a table of whole numbers in order of first appearance.

    Args:
        keys: (n, m) int.

    Returns:
        (n,) int from 0; equal rows have equal numbers.
    """
    order = np.lexsort(keys.T[::-1])
    start = np.concatenate([np.ones(min(len(keys), 1), dtype=bool), (np.diff(keys[order], axis=0) != 0).any(axis=1)])
    first = order[start]  # lexsort is stable: the earliest row of each kind
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    number = np.empty(len(keys), dtype=np.int64)
    number[order] = rank[np.cumsum(start) - 1]
    return number


def _cut_at_gaps(group: np.ndarray, column: np.ndarray, gap: float) -> np.ndarray:
    order = np.lexsort((column, group))
    value, missing = column[order], np.isnan(column[order])
    new = (np.diff(group[order]) != 0) | (missing[1:] != missing[:-1]) | (np.diff(value) > gap)
    number = np.empty_like(group)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    return number


def _cut_if_wide(group: np.ndarray, column: np.ndarray, tolerance: float) -> np.ndarray:
    """Groups with those wider than `WIDEST` tolerances cut into equal parts no wider than one tolerance."""
    count = int(group.max()) + 1
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.fmin.at(low, group, column)
    np.fmax.at(high, group, column)
    width = np.where(high > low, high - low, 0.0)
    parts = np.where(width > WIDEST * tolerance, np.ceil(width / tolerance), 1.0)
    if (parts == 1.0).all():
        return group
    share = np.nan_to_num((column - low[group]) / np.where(width > 0.0, width, 1.0)[group])
    part = np.minimum(np.floor(share * parts[group]), parts[group] - 1.0).astype(np.int64)
    return number_rows(np.column_stack([group, part]))
