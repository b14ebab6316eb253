"""Copies: rows that say in every column what an earlier one says, as of a file that was pasted twice."""

import numpy as np
import pandas as pd

from ptt.run.table import Table

SAID = (
    "target", "command", "measured", "time_s", "payload_kg", "temp_c", "feed_mm_s", "direction", "torque", "std",
    "repeat",
)  # fmt: skip


def copied_rows(table: Table) -> np.ndarray:
    """Rows that equal an earlier one to the last digit of all that was commanded, read and recorded.

    No tracker reads a place twice to the last digit of three coordinates but by rounding, and what rounding did to one
    reading it did to the other: such rows say what one of them says. Of which run they are is no difference, nor is
    where a file has them.

    Args:
        table: n rows.

    Returns:
        (n,) bool; rows without a reading are no copies.
    """
    numbers = [getattr(table, name) for name in SAID]
    columns = np.column_stack([values for values in numbers if values is not None])
    frame = pd.DataFrame(columns).assign(role=table.role, called=table.name, **_extra(table))
    return np.asarray(frame.duplicated().to_numpy() & np.isfinite(table.measured).all(axis=1))


def _extra(table: Table) -> dict[str, np.ndarray]:
    return {f"extra {number}": values for number, values in enumerate(table.extra.values())}
