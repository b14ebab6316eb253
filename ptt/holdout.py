"""Held-out rows: whole blocks of travel, all repeats of a pose together, never random rows."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ptt.table import Table

BLOCKS = 10
SAME_POSE = 1e-3  # mm (rad): targets (commands) closer than this are one pose
PLACED = 3  # joints up to which the tool position tells the pose


def pose_groups(table: "Table") -> np.ndarray:
    """Number the poses of a table.

    Args:
        table: n rows.

    Returns:
        (n,) int: equal for rows with the same target (the same commands where there is no target, or where an arm
        has so many joints that a position does not tell its pose), numbered in order of first appearance; -1 for
        base reflectors.
    """
    place = np.where(np.isfinite(table.target), table.target, 0.0)
    if table.command is not None:
        command = np.asarray(table.command)
        if not np.isfinite(table.target).any() or (command.shape[1] > PLACED and np.isfinite(command).all()):
            place = command
    keys = np.round(place / SAME_POSE).astype(np.int64)
    groups = number_rows(keys)
    groups[table.role == "base"] = -1
    return _renumber(groups)


def blocks(table: "Table", count: int = BLOCKS) -> np.ndarray:
    """Cut a table into blocks of travel that hold all repeats of each of their poses.

    Args:
        table: n rows in travel order.
        count: how many blocks, at most.

    Returns:
        (n,) int from 0; -1 for base reflectors, which are never held out.
    """
    group = pose_groups(table)
    used = group >= 0
    if not used.any():
        return group
    size = np.bincount(group[used])
    before = np.cumsum(size) - size
    count = max(1, min(count, len(size)))
    block_of_group = np.minimum((before + size / 2.0) * count // size.sum(), count - 1).astype(int)
    return np.where(used, block_of_group[np.maximum(group, 0)], -1)


def folds(table: "Table", count: int, among: int = BLOCKS) -> list[np.ndarray]:
    """Deal the blocks of a table into parts that are hidden in turn.

    Neighbouring blocks go to different parts, so that a part hides some of every stretch of travel and no run whole.

    Args:
        table: n rows in travel order.
        count: how many parts, at most.
        among: how many blocks are dealt.

    Returns:
        (n,) bool for each part; base reflectors are in none.
    """
    block = blocks(table, max(count, among))
    number = int(block.max(initial=-1)) + 1
    parts = [(block >= 0) & (block % count == index) for index in range(min(count, number))]
    return [part for part in parts if part.any()]


def number_rows(keys: np.ndarray) -> np.ndarray:
    """Number the different rows of a table of whole numbers in their sorted order.

    Args:
        keys: (n, m) int.

    Returns:
        (n,) int; equal rows have equal numbers.
    """
    order = np.lexsort(keys.T[::-1])
    new = (np.diff(keys[order], axis=0) != 0).any(axis=1)
    number = np.empty(len(keys), dtype=int)
    number[order] = np.concatenate([np.zeros(min(len(keys), 1), dtype=int), np.cumsum(new)])
    return number


def _renumber(groups: np.ndarray) -> np.ndarray:
    """Number groups in order of first appearance, leaving -1 alone."""
    used = groups >= 0
    if not used.any():
        return groups
    values, first, inverse = np.unique(groups[used], return_index=True, return_inverse=True)
    rank = np.empty(len(values), dtype=int)
    rank[np.argsort(first)] = np.arange(len(values))
    result = groups.copy()
    result[used] = rank[inverse]
    return result
