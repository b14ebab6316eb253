"""Held-out rows: whole blocks of travel, all repeats of a pose together, never random rows."""

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ptt.mechanisms.three_ptt import LEGS
from ptt.run.same_pose import number_rows, same_places

if TYPE_CHECKING:
    from ptt.run.table import Table

BLOCKS = 10  # of travel, by default
APIECE = 5  # blocks for each tracker frame, so that the rows not held out still determine it
MOST_BLOCKS = 40  # of runs in chunks the sums over each are kept side by side
_numbered: "WeakKeyDictionary[Table, np.ndarray]" = WeakKeyDictionary()  # cache: a long table takes seconds


def pose_groups(table: "Table") -> np.ndarray:
    """Number the poses of a table.

    Args:
        table: n rows.

    Returns:
        (n,) int: equal for rows with the same target (the same commands where there is no target, or of an arm, whose
        posture a position does not tell), numbered in order of first appearance; -1 for base reflectors. Read-only,
        since it is cached.
    """
    groups = _numbered.get(table)
    if groups is None:
        groups = _number_poses(table)
        groups.flags.writeable = False
        _numbered[table] = groups
    return groups


def _number_poses(table: "Table") -> np.ndarray:
    groups = same_places(_places(table))
    used = table.role != "base"
    groups[used] = number_rows(groups[used, None])
    groups[~used] = -1
    return groups


def visit_groups(table: "Table") -> np.ndarray:
    """Number the visits of a table: consecutive rows at one pose, between which the machine did not move.

    Args:
        table: n rows in travel order.

    Returns:
        (n,) int, from 0 in order of travel; -1 for base reflectors, which no machine moves to.
    """
    pose = pose_groups(table)
    used = pose >= 0
    visits, run = pose.copy(), np.asarray(table.run)[used]
    visits[used] = np.cumsum((np.diff(pose[used], prepend=-1) != 0) | (np.diff(run, prepend=run[:1]) != 0)) - 1
    return visits


def sharing_groups(table: "Table", counted: np.ndarray) -> tuple[np.ndarray, bool]:
    """Groups of rows that may share an error which no model explains (random effects): by pose, or only by visit.

    Readings of one visit share the positioning error of that visit. That an error belongs to the pose shows only where
    the machine comes back to it.

    Args:
        table: n rows in travel order.
        counted: readings that count, (n,) bool.

    Returns:
        (n,) int, group of each row; and whether groups are visits, because most readings that repeat another do so
        without a move between.
    """
    pose, visit = pose_groups(table), visit_groups(table)
    poses, visits = len(np.unique(pose[counted])), len(np.unique(visit[counted]))
    return (visit, True) if counted.sum() - visits > visits - poses else (pose, False)


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


def blocks_beside(frames: int) -> int:
    """Number of blocks to cut a table into, so that no block holds most of the rows that determine a tracker frame.

    Args:
        frames: number of frames that are fitted; enough blocks for up to eight of them.
    """
    return min(max(BLOCKS, APIECE * frames), MOST_BLOCKS)


def folds(table: "Table", count: int, among: int = BLOCKS) -> list[np.ndarray]:
    """Deal the blocks of a table into folds of a cross-validation.

    Neighbouring blocks go to different parts, so that a part hides some of every stretch of travel and no run whole.

    Args:
        table: n rows in travel order.
        count: number of folds, at most.
        among: number of blocks that are dealt.

    Returns:
        Rows of each fold, (n,) bool; base reflectors are in none.
    """
    block = blocks(table, max(count, among))
    number = int(block.max(initial=-1)) + 1
    parts = [(block >= 0) & (block % count == index) for index in range(min(count, number))]
    return [part for part in parts if part.any()]


def _places(table: "Table") -> np.ndarray:
    """Columns that distinguish the poses of a table: targets, or commands where these determine more or stand alone."""
    if table.command is None:
        return table.target
    told, of_arm = np.isfinite(table.target).all(axis=1), table.joint_prefix == "q" or table.joints > LEGS
    if not told.any() or (of_arm and np.isfinite(table.command).all()):
        return table.command
    return (
        table.target if told.all() else np.column_stack([table.target, np.where(told[:, None], np.nan, table.command)])
    )
