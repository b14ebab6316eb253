"""Copied rows: a file pasted after itself, or named twice."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from ptt.run.table import Table

SAID = (
    "target", "command", "measured", "time_s", "payload_kg", "temp_c", "feed_mm_s", "direction", "torque", "std",
    "repeat",
)  # fmt: skip
"""Columns of numbers of all that was commanded, read and recorded."""

PASTED = 12  # rows that repeat in sequence to the last digit, impossible for real readings
TAKEN = "taken as repeats, but copies say nothing about the scatter of readings"
ONCE = f"{TAKEN}; all rows come again, so that they count once"


def taken_as(lines: Sequence[str]) -> str:
    """How copied rows are treated, in words.

    Args:
        lines: of a file, each as it is written.
    """
    return ONCE if period(pd.factorize(np.asarray(lines, dtype=object))[0]) < len(lines) else TAKEN


def pasted_rows(table: "Table") -> np.ndarray:
    """Rows of a table that repeats itself as a whole, to the last digit, after the first period.

    Equal readings of one pose may be repeats on a coarse display, but a repetition of all rows is a copy without new
    information, whatever its run.

    Args:
        table: n rows.

    Returns:
        (n,) bool.
    """
    numbers = [getattr(table, name) for name in SAID]
    told = pd.DataFrame(np.column_stack([values for values in numbers if values is not None]) + 0.0)
    extra = {f"extra {number}": values for number, values in enumerate(table.extra.values())}
    lines = pd.util.hash_pandas_object(told.assign(role=table.role, called=table.name, **extra), index=False).to_numpy()
    once, filed = period(lines), np.argsort(table.line, kind="stable")
    if once == table.rows and len(np.unique(table.line)) == table.rows:  # sorted by time, copies stand side by side
        return np.argsort(filed, kind="stable") >= period(lines[filed])
    return np.arange(table.rows) >= once


def period(lines: np.ndarray) -> int:
    """Period of a sequence that repeats as a whole.

    Args:
        lines: hash of each row, (n,) int.

    Returns:
        Number of rows of one period; n where there is none, or one shorter than PASTED.
    """
    rows = len(lines)
    if not (lines[1:] == lines[:1]).any():  # what comes again begins with its first row
        return rows
    for times in range(rows // max(len(np.unique(lines)), 1), 1, -1):
        once = rows // times
        if once * times == rows and (lines[once:] == lines[:-once]).all():
            return once if once >= PASTED else rows
    return rows
