"""Rows by their lines in the file, for messages."""

import numpy as np

from ptt.run.table import Table

MOST_ROWS = 5  # listed in a message


def named_rows(table: Table, rows: np.ndarray) -> str:
    """Some rows by the lines of their files.

    Args:
        table: the table.
        rows: (m,) indices, or (n,) bool.

    Returns:
        For example 'run.csv lines 41, 97 and 3 more'; of several files 'a.csv line 41; b.csv lines 3 and 9'; '' for
        none.
    """
    index = np.flatnonzero(rows) if np.asarray(rows).dtype == bool else np.asarray(rows, dtype=int)
    files: dict[str, list[str]] = {}
    for row in index[:MOST_ROWS]:
        files.setdefault(table.place(int(row)).rpartition(" row ")[0], []).append(str(table.line[row]))
    more = len(index) - MOST_ROWS
    parts = [f"{file} line{'s' * (len(lines) > 1)} {_listed(lines, more > 0)}" for file, lines in files.items()]
    return "; ".join(parts) + (f" and {more} more" if more > 0 else "")


def _listed(lines: list[str], more: bool) -> str:
    return ", ".join(lines) if more or len(lines) == 1 else f"{', '.join(lines[:-1])} and {lines[-1]}"
