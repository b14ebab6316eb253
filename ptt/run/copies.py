"""Copied rows: a file pasted after itself, or named twice."""

import numpy as np
import pandas as pd

from ptt.run.pasted import period
from ptt.run.table import Table

SAID = (
    "target", "command", "measured", "time_s", "payload_kg", "temp_c", "feed_mm_s", "direction", "torque", "std",
    "repeat",
)  # fmt: skip
"""Columns of numbers of all that was commanded, read and recorded."""


def pasted_rows(table: Table) -> np.ndarray:
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
