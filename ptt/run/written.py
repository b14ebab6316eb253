"""Writing a table as CSV, block by block, so that a long file is never in memory as a whole."""

import csv
import io
from collections.abc import Iterator
from collections.abc import Mapping as Dictionary
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from ptt.errors import TableError
from ptt.files import write_parts
from ptt.run.axes import AXES
from ptt.run.cores import map_cores
from ptt.run.readers.columns import file_title
from ptt.run.readers.mapping import IGNORE
from ptt.run.table import Table

QUATERNION = ("qx", "qy", "qz", "qw")
ROWS = 20_000  # of a block: some MB of text

Columns = Dictionary[str, np.ndarray]  # title -> (n,)


def table_to_frame(table: Table) -> pd.DataFrame:
    """Columns of the file format, in its units and order; columns without content are left out."""
    return pd.DataFrame(columns_of(table))


def write_table(table: Table, path: str | Path, *, as_read: bool = False) -> None:
    """Write a tracker CSV that reads back the same, bit for bit; the file appears whole or not at all.

    Args:
        table: what to write.
        path: where to.
        as_read: whether the columns are those of the file that it was read from, in its order, empty ones too.

    Raises:
        InputError: the folder cannot be written.
        TableError: a name holds a line break.
    """
    for texts in (table.name, np.asarray(table.run_label), *table.extra.values()):
        broken = [text for text in texts.tolist() if "\n" in text or "\r" in text]
        if broken:
            raise TableError(f"line break in {broken[0]!r}", where=str(path), fix="remove it")
    write_parts(path, text_parts(columns_as_read(table) if as_read else columns_of(table)))


def columns_of(table: Table, whole: bool = False) -> dict[str, np.ndarray]:
    """Columns of a table in the units and order of the file format.

    Args:
        table: n rows.
        whole: whether empty columns are included.

    Returns:
        Title -> (n,), most of them views of the table.
    """
    columns: dict[str, np.ndarray] = {}
    put = partial(_put, columns, whole)
    angle = "_rad" if table.joint_prefix == "q" else ""
    put([f"{axis}_cmd" for axis in AXES], table.target)
    put([f"{table.joint_prefix}{i + 1}_cmd{angle}" for i in range(table.joints)], table.command)
    put([f"{axis}_meas" for axis in AXES], table.measured)
    if whole or (table.name != "").any():
        columns["name"] = table.name
    if whole or (table.role != "pose").any():
        columns["role"] = table.role
    if whole or table.run_label != ("",):
        columns["run"] = np.asarray(table.run_label)[table.run]
    for title in ("repeat", "time_s", "payload_kg", "temp_c", "feed_mm_s"):
        put([title], getattr(table, title))
    for title, values in (("dir", table.direction), ("tau", table.torque)):
        put([f"{title}{i + 1}" for i in range(0 if values is None else values.shape[1])], values)
    put([f"{axis}_std" for axis in AXES], table.std)
    put([f"{axis}_meas" for axis in QUATERNION], table.orientation_measured)
    put([f"{axis}_cmd" for axis in QUATERNION], table.orientation_command)
    return columns | dict(table.extra)


def columns_as_read(table: Table) -> dict[str, np.ndarray]:
    """Columns in the order of the file that they were read from, all included, then columns that it did not have.

    Args:
        table: n rows.

    Returns:
        Title, as the format has it -> (n,).
    """
    read = table.understood.mapping.columns
    titles = [title if quantity == IGNORE else file_title(quantity) for title, quantity in read.items()]
    every, filled = columns_of(table, whole=True), columns_of(table)
    own = (title for title, values in filled.items() if not _is_empty(values))
    columns = {title: every[title] for title in (*titles, *own) if title in every}
    return columns | {title: _counted(columns[title]) for title in ("repeat",) if title in columns}


def text_of(columns: Columns, titles: bool = True) -> bytes:
    """CSV of some rows, as pandas writes it.

    Args:
        columns: title -> (n,); NaN is an empty cell, every other number reads back the same.
        titles: whether the row of titles comes first.

    Returns:
        UTF-8.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    if titles:
        writer.writerow(columns)
    writer.writerows(zip(*(_cells(values) for values in columns.values()), strict=True))
    return text.getvalue().encode("utf-8")


def text_parts(columns: Columns) -> Iterator[bytes]:
    """CSV of many rows, block by block, as many at once as there are cores.

    Args:
        columns: title -> (n,).

    Returns:
        What `text_of` makes of all of them, cut between rows.
    """
    rows = len(next(iter(columns.values()), ()))
    return map_cores(partial(_text_from, columns), range(0, max(rows, 1), ROWS))


def _text_from(columns: Columns, first: int) -> bytes:
    return text_of({title: values[first : first + ROWS] for title, values in columns.items()}, first == 0)


def _put(columns: dict[str, np.ndarray], whole: bool, titles: list[str], values: np.ndarray | None) -> None:
    if values is not None and (whole or not np.isnan(values).all()):
        columns.update(zip(titles, values.reshape(len(values), -1).T, strict=True))


def _is_empty(values: np.ndarray) -> bool:
    return values.dtype.kind == "f" and bool(np.isnan(values).all())


def _counted(values: np.ndarray) -> np.ndarray:
    """Whole numbers without a decimal point, None where there is none."""
    there = ~np.isnan(values)
    if (values[there] % 1.0 != 0.0).any():
        return values
    counted = np.full(len(values), None, dtype=object)
    counted[there] = [int(value) for value in values[there]]
    return counted


def _cells(values: np.ndarray) -> list[object]:
    """Values as the csv module writes them: it puts nothing for None, and `repr` for a number."""
    if values.dtype.kind != "f" or not (empty := np.isnan(values)).any():
        return list(values.tolist())
    cells = values.astype(object)
    cells[empty] = None
    return list(cells.tolist())
