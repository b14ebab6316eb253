"""Rows of a table that was pasted after itself."""

import numpy as np
import pandas as pd

from ptt.run.copies import SAID, period
from ptt.run.table import Table


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
    return np.arange(table.rows) >= period(lines)
