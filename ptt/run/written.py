"""Columns of the file format, and their text a block of rows at a time: a long file never lies in memory whole."""

import csv
import io
from collections.abc import Iterator
from collections.abc import Mapping as Dictionary
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ptt.run.cores import map_cores

if TYPE_CHECKING:
    from ptt.run.table import Table

COORDINATES = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
ROWS = 20_000  # of a block: some MB of text

Columns = Dictionary[str, np.ndarray]  # title -> (n,)


def columns_of(table: "Table") -> dict[str, np.ndarray]:
    """Columns of a table as its file has them, in units and order of the format; those without content are left out.

    Args:
        table: n rows.

    Returns:
        Title -> (n,), most of them views of the table.
    """
    columns: dict[str, np.ndarray] = {}
    angle = "_rad" if table.joint_prefix == "q" else ""
    _put(columns, [f"{axis}_cmd" for axis in COORDINATES], table.target)
    _put(columns, [f"{table.joint_prefix}{i + 1}_cmd{angle}" for i in range(table.joints)], table.command)
    _put(columns, [f"{axis}_meas" for axis in COORDINATES], table.measured)
    if (table.name != "").any():
        columns["name"] = table.name
    if (table.role != "pose").any():
        columns["role"] = table.role
    if table.run_label != ("",):
        columns["run"] = np.asarray(table.run_label)[table.run]
    for title in ("repeat", "time_s", "payload_kg", "temp_c", "feed_mm_s"):
        _put(columns, [title], getattr(table, title))
    for title, values in (("dir", table.direction), ("tau", table.torque)):
        _put(columns, [f"{title}{i + 1}" for i in range(0 if values is None else values.shape[1])], values)
    _put(columns, [f"{axis}_std" for axis in COORDINATES], table.std)
    _put(columns, [f"{axis}_meas" for axis in QUATERNION], table.orientation_measured)
    _put(columns, [f"{axis}_cmd" for axis in QUATERNION], table.orientation_command)
    return columns | dict(table.extra)


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


def _put(columns: dict[str, np.ndarray], titles: list[str], values: np.ndarray | None) -> None:
    if values is not None and not np.isnan(values).all():
        columns.update(zip(titles, values.reshape(len(values), -1).T, strict=True))


def _cells(values: np.ndarray) -> list[object]:
    """Values as the csv module writes them: it puts nothing for None, and `repr` for a number."""
    if values.dtype.kind != "f" or not (empty := np.isnan(values)).any():
        return list(values.tolist())
    cells = values.astype(object)
    cells[empty] = None
    return list(cells.tolist())
