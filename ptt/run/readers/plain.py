"""Reader of a plain CSV, as of logs of scales and axes: complete rows, bounded numbers."""

import csv
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ptt.errors import TableError, shown
from ptt.files import read_bytes
from ptt.run.readers.columns import GREATEST

FIX = "write a comma-separated UTF-8 file with one header line"


def read_plain(path: Path | str) -> pd.DataFrame:
    """Read a comma-separated file as text, so that a bad cell can be quoted as it stands.

    Args:
        path: the file.

    Returns:
        Texts by title, in lower case and stripped; the index is the line in the file. Lines without a cell are skipped.

    Raises:
        TableError: no such file, not such a text, a title twice, no rows, a row that is short or long, an open quote.
    """
    source = str(path)
    lines = _lines(path, source)
    rows = {
        number: _cells(line, f"{source} row {number}") for number, line in enumerate(lines, 1) if line.strip(" ,\t")
    }
    if len(rows) < 2:
        raise TableError("no rows", where=source, fix="is this the right file? Export it again with its readings")
    first, *numbers = rows
    titles = [title.lower() for title in rows[first]]
    for title in titles:
        if title and titles.count(title) > 1:
            raise TableError(f"column '{shown(title)}' appears twice", where=source, fix="remove or rename one")
    for number in numbers:
        if len(rows[number]) != len(titles):
            what = f"{len(rows[number])} cells where {len(titles)} are expected"
            raise TableError(what, where=f"{source} row {number}", fix="empty cells keep their comma")
    return pd.DataFrame([rows[number] for number in numbers], index=numbers, columns=titles, dtype=str)


def numbers_of(
    table: pd.DataFrame, column: str, source: str, dimension: str = "length", *, empty: bool = False
) -> NDArray[np.float64]:
    """One column as numbers.

    Args:
        table: from `read_plain`.
        column: its title.
        source: the file, for messages.
        dimension: what bounds it, a key of `ptt.run.readers.columns.GREATEST`.
        empty: whether a cell may be empty.

    Returns:
        (n,) float64, NaN where a cell is empty.

    Raises:
        TableError: a cell that is no number, or one beyond any machine, by row and column.
    """
    texts = table[column].to_numpy(dtype=object)
    values = np.array(
        pd.to_numeric(table[column].where(table[column].str.len() < 100, "x"), errors="coerce"), dtype=float
    )
    missing = texts == ""
    bad = np.flatnonzero(~(np.abs(values) <= GREATEST[dimension]) & ~(empty & missing))
    if not len(bad):
        return np.where(missing, np.nan, values)
    text = str(texts[bad[0]])
    finite = np.isfinite(values[bad[0]])
    what = f"{shown(text)} is beyond any machine" if finite else f"not a number ('{shown(text)}')"
    raise TableError(what, where=f"{source} row {table.index[bad[0]]}, column {column}", fix="mend or remove the row")


def _lines(path: Path | str, source: str) -> list[str]:
    try:
        text = read_bytes(path, TableError).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TableError(f"not a readable CSV ({error})", where=source, fix=FIX) from None
    if "\0" in text:
        raise TableError("not a text file", where=source, fix=FIX)
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _cells(line: str, where: str) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(",")]
    try:
        return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True, strict=True))]
    except csv.Error:
        raise TableError("a quote is opened and not closed", where=where, fix="close or remove it") from None
