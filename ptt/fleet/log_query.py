"""SQL queries of a log's Parquet file."""

from pathlib import Path
from typing import Any

import numpy as np

from ptt.errors import InputError
from ptt.fleet.database import duckdb, in_memory

SOURCE = "read_parquet($1, file_row_number = true)"
HEADER = 2  # line number of the first row in a file whose first line is its titles


def ask_log(path: Path, query: str) -> dict[str, np.ndarray]:
    """The columns that a query of a log returns, each (n,), masked where empty.

    Args:
        path: Parquet file.
        query: SQL query of `SOURCE`.

    Raises:
        InputError: it cannot be read.
    """
    package = duckdb()
    with in_memory() as connection:
        try:
            columns: dict[str, Any] = connection.execute(query, [str(path)]).fetchnumpy()
        except package.Error as error:
            fix = "see docs/files.md; a CSV is copied to Parquet by `ptt fleet fit`"
            raise InputError(f"cannot be read: {str(error).splitlines()[0]}", where=str(path), fix=fix) from None
    return columns


def ask_rows(path: Path, query: str) -> list[dict[str, Any]]:
    """The rows that a query of a log returns, each as column -> value; arguments and errors as `ask_log`."""
    columns = ask_log(path, query)
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def types_of(path: Path) -> dict[str, str]:
    """Title -> type, as DuckDB calls it, of a log's columns."""
    found = ask_rows(path, f"SELECT column_name AS name, column_type AS type FROM (DESCRIBE SELECT * FROM {SOURCE})")
    return {str(row["name"]): str(row["type"]) for row in found if row["name"] != "file_row_number"}


def quoted(title: str) -> str:
    """A title as SQL names a column."""
    return '"' + title.replace('"', '""') + '"'
