"""A run's table written as columns of a Parquet file, and these read back bit for bit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ptt.errors import InputError
from ptt.fleet.database import duckdb, in_memory
from ptt.run.from_columns import EXTRA
from ptt.run.table import Table
from ptt.run.written import table_to_frame

OWN = ("machine", "run_sha256", "line")  # columns that the file has beside those of a tracker CSV
TEXTS = ("name", "role", "run", *OWN)  # of all columns of its own


def write_readings(table: Table, machine: str, run: str, path: Path) -> None:
    """Write a table as Parquet, whole or not at all: the columns of a tracker CSV, those of `OWN`, and the user's own.

    Args:
        table: one run.
        machine: name of the machine.
        run: SHA-256 of the run's file.
        path: file to write.
    """
    extra = {EXTRA + title: values for title, values in table.extra.items()}
    frame = table_to_frame(table.replace(extra={})).assign(line=table.line, **extra)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    with in_memory() as connection:
        connection.register("readings", frame)
        query = "COPY (SELECT ? AS machine, ? AS run_sha256, * FROM readings) TO ? (FORMAT parquet)"
        connection.execute(query, [machine, run, str(part)])
        connection.unregister("readings")
    part.replace(path)


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """The columns of a run as arrays (n,): empty cells are NaN, of texts ''.

    Args:
        path: Parquet file of `write_readings`.

    Returns:
        Title -> values, without 'machine' and 'run_sha256'; the user's own have `EXTRA` before their titles.

    Raises:
        InputError: it is gone or damaged.
    """
    package = duckdb()
    with in_memory() as connection:
        try:
            columns = connection.execute("SELECT * FROM read_parquet(?)", [str(path)]).fetchnumpy()
        except package.Error as error:
            what = "readings of the store are damaged" if path.exists() else "readings of the store are missing"
            raise InputError(what, where=str(path), fix="put the file back from a copy of the store") from error
    plain = {name: each for name, each in plain_columns(columns).items() if name not in ("machine", "run_sha256")}
    return {EXTRA + name if _is_unmarked(name, each) else name: each for name, each in plain.items()}


def _is_unmarked(name: str, values: np.ndarray) -> bool:
    """Whether a column is the user's own in a file of an earlier program, which did not mark it: it is kept as text."""
    return values.dtype.kind == "U" and name not in TEXTS and not name.startswith(EXTRA)


def plain_columns(columns: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Columns as DuckDB returns them (masked where empty) as plain arrays with NaN or '' in empty cells.

    Whole numbers with an empty cell among them, which have no NaN, come as texts: they may be names.
    """
    return {name: _plain(values) for name, values in columns.items()}


def _plain(values: Any) -> np.ndarray:
    if isinstance(values, np.ma.MaskedArray):
        values = values if values.dtype.kind in "fO" else values.astype(object)
        values = values.filled(np.nan if values.dtype.kind == "f" else "")
    return np.asarray(values, dtype=str) if values.dtype == object else np.asarray(values)
