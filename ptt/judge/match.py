"""Rows of two runs that are the same pose, by name or by target."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from ptt.machine import MachineFile
from ptt.run.same_pose import same_places
from ptt.run.table import Table
from ptt.run.target_frame import in_base, target_frames
from ptt.run.wanted import placed


def match_rows(
    before: Table, after: Table, usable_before: np.ndarray, usable_after: np.ndarray
) -> tuple[np.ndarray, np.ndarray, dict[str, list[str]]]:
    """Pair rows by name where both runs name their poses, else by target; repeats by their order.

    Args:
        before: n rows.
        after: m rows.
        usable_before: rows to be paired, (n,) bool.
        usable_after: rows to be paired, (m,) bool.

    Returns:
        Row numbers in `before` and in `after`, and the rows left over, in words, under 'before' and 'after'.
    """
    by_name = bool(set(before.name[usable_before]) & set(after.name[usable_after]) - {""})
    place = same_places(np.concatenate([before.target, after.target]))
    places = place[: before.rows], place[before.rows :]
    keys = [
        _keys(table, usable, by_name, own)
        for table, usable, own in zip((before, after), (usable_before, usable_after), places, strict=True)
    ]
    second_of = keys[1]
    pairs = [(row, second_of[key]) for key, row in keys[0].items() if key in second_of]
    open_ = [np.isnan(table.target).any(axis=1) for table in (before, after)]
    pairs = [(i, j) for i, j in pairs if places[0][i] == places[1][j] or open_[0][i] or open_[1][j]]
    first, second = ([pair[side] for pair in pairs] for side in (0, 1))
    unmatched = {
        "before": _left_over(before, set(keys[0].values()) - set(first)),
        "after": _left_over(after, set(keys[1].values()) - set(second)),
    }
    return np.array(first, dtype=int), np.array(second, dtype=int), unmatched


def targets_of(table: Table, file: MachineFile | None) -> np.ndarray:
    """Targets of a run in the base frame, (n, 3) mm; of rows with joint commands only, where the drawing puts the tool.

    Without a machine file they are taken as stated.
    """
    if file is None:
        return table.target
    return in_base(placed(file, table), target_frames(file, table, corrected=True)).target


def _keys(table: Table, usable: np.ndarray, by_name: bool, place: np.ndarray) -> dict[tuple[Any, int], int]:
    """(name or number of the place, occurrence) -> row."""
    seen: Counter[Any] = Counter()
    keys = {}
    for row in np.flatnonzero(usable):
        key = str(table.name[row]) if by_name and table.name[row] else int(place[row])
        keys[(key, seen[key])] = int(row)
        seen[key] += 1
    return keys


def _left_over(table: Table, rows: Sequence[int] | set[int]) -> list[str]:
    return [f"{table.place(row)} {table.name[row]}".strip() for row in sorted(rows)]
