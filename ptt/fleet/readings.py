"""A run's table written as columns of a Parquet file, and read back bit for bit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ptt.errors import InputError
from ptt.fleet.database import duckdb, in_memory
from ptt.run.axes import AXES
from ptt.run.table import Table, make_table
from ptt.run.written import QUATERNION, table_to_frame

Columns = Mapping[str, np.ndarray]
OWN = ("machine", "run_sha256", "line")  # columns that the file has beside those of a tracker CSV
PLAIN = ("repeat", "time_s", "payload_kg", "temp_c", "feed_mm_s")  # columns that are fields of a table as they stand
MOST_JOINTS = 32  # columns of joints are looked for up to, and without, this number


def write_readings(table: Table, machine: str, run: str, path: Path) -> None:
    """Write a table as Parquet, whole or not at all: the columns of a tracker CSV, and those of `OWN`.

    Args:
        table: one run.
        machine: name of the machine.
        run: SHA-256 of the run's file.
        path: file to write.
    """
    frame = table_to_frame(table).drop(columns=[title for title in table.extra if title in OWN])
    frame = frame.assign(line=table.line)
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
        Title -> values, without 'machine' and 'run_sha256'.

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
    return {name: each for name, each in plain_columns(columns).items() if name not in ("machine", "run_sha256")}


def plain_columns(columns: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Columns as DuckDB returns them (masked where empty) as plain arrays with NaN or '' in empty cells."""
    return {name: _plain(values) for name, values in columns.items()}


def columns_to_table(columns: Columns, file: str, run: str) -> Table:
    """The table of a run from its columns: the inverse of `write_readings`.

    Args:
        columns: from `read_columns`.
        file: name of the run's file, for messages.
        run: SHA-256 of that file.

    Returns:
        The table, without columns that have no meaning for the program.
    """
    prefix = "q" if "q1_cmd_rad" in columns else "b"
    angle = "_rad" if prefix == "q" else ""
    joints = range(1, MOST_JOINTS)
    rows = len(columns["line"])
    labels, codes = _runs(columns.get("run"), rows)
    target = _stack(columns, [f"{axis}_cmd" for axis in AXES])
    fields: dict[str, Any] = {
        "run": codes,
        "run_label": labels,
        "run_sha256": (run,) * len(labels),
        "direction": _stack(columns, [name for i in joints if (name := f"dir{i}") in columns]),
        "torque": _stack(columns, [name for i in joints if (name := f"tau{i}") in columns]),
        "std": _stack(columns, [f"{axis}_std" for axis in AXES]),
        "orientation_measured": _stack(columns, [f"{axis}_meas" for axis in QUATERNION]),
        "orientation_command": _stack(columns, [f"{axis}_cmd" for axis in QUATERNION]),
        "line": columns["line"],
        "source": file,
        "joint_prefix": prefix,
        **{name: columns[name] for name in (*PLAIN, "name", "role") if name in columns},
    }
    return make_table(
        np.full((rows, 3), np.nan) if target is None else target,
        _stack(columns, [name for i in joints if (name := f"{prefix}{i}_cmd{angle}") in columns]),
        _stack(columns, [f"{axis}_meas" for axis in AXES]),
        **fields,
    )


def _plain(values: Any) -> np.ndarray:
    texts = values.dtype == object
    if isinstance(values, np.ma.MaskedArray):
        values = values.filled("" if texts else np.nan)
    return np.asarray(values, dtype=str) if texts else np.asarray(values)


def _stack(columns: Columns, names: list[str]) -> np.ndarray | None:
    """Columns side by side, (n, k), NaN for those that are missing; None where all are."""
    there = [name for name in names if name in columns]
    if not there:
        return None
    empty = np.full(len(columns["line"]), np.nan)
    return np.stack([columns.get(name, empty) for name in names], axis=1)


def _runs(names: np.ndarray | None, rows: int) -> tuple[tuple[str, ...], np.ndarray]:
    """Labels in order of appearance, and the code of each row."""
    if names is None:
        return ("",), np.zeros(rows, dtype=np.int64)
    labels, first, codes = np.unique(names, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return tuple(str(label) for label in labels[order]), np.argsort(order)[codes.reshape(-1)]
