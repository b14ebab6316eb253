"""Copies: rows of a file that was pasted behind itself, or that was named twice."""

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

PASTED = 12  # rows that no tracker reads a second time to the last digit, each in its turn


TAKEN = "taken as repeats, but copies say nothing about the scatter of readings"
ONCE = f"{TAKEN}; all rows come again, so that they count once"


def taken_as(lines: Sequence[str]) -> str:
    """What becomes of rows that are copies of others, in words.

    Args:
        lines: of a file, each as it is written.
    """
    return ONCE if period(pd.factorize(np.asarray(lines, dtype=object))[0]) < len(lines) else TAKEN


def pasted_rows(table: "Table") -> np.ndarray:
    """Rows that say, each in its turn, what those before say to the last digit.

    A pose that a coarse display reads alike is a repeat, but all rows of a file once more are copies, which tell
    nothing new. Of which run they are is no difference.

    Args:
        table: n rows.

    Returns:
        (n,) bool.
    """
    numbers = [getattr(table, name) for name in SAID]
    told = pd.DataFrame(np.column_stack([values for values in numbers if values is not None]) + 0.0)
    extra = {f"extra {number}": values for number, values in enumerate(table.extra.values())}
    lines = pd.util.hash_pandas_object(told.assign(role=table.role, called=table.name, **extra), index=False).to_numpy()
    return np.arange(table.rows) >= period(lines)


def period(lines: np.ndarray) -> int:
    """How many rows come before all of them come again.

    Args:
        lines: what each says, (n,) int.

    Returns:
        That many; n where they do not, or are few.
    """
    rows = len(lines)
    if not (lines[1:] == lines[:1]).any():  # what comes again begins with its first row
        return rows
    for times in range(rows // max(len(np.unique(lines)), 1), 1, -1):
        once = rows // times
        if once * times == rows and (lines[once:] == lines[:-once]).all():
            return once if once >= PASTED else rows
    return rows
