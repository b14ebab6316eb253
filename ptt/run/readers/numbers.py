"""Conversion of cells to numbers; the first cell that is none is an error with file, row and column."""

import io
import re
from typing import Any, NoReturn, cast

import numpy as np
import pandas as pd

from ptt.errors import TableError, shown
from ptt.run.readers.columns import Column, greatest, least, split_joint, standard_unit
from ptt.run.readers.layout import GOALS
from ptt.run.readers.separators import POINT_NUMBER, cell_counts, plain_number, split_line
from ptt.run.readers.stamps import is_stamp
from ptt.run.readers.text import RawText
from ptt.run.readers.titles import UNIT_OF_WORD, normalise, stated_unit

ROWS = 50_000  # lines parsed at once, which takes about 100 MB
# pandas 3 reads floats exactly by default and warns about the option; before that the option is needed
_EXACT: dict[str, Any] = {"float_precision": "round_trip"} if int(pd.__version__.split(".")[0]) < 3 else {}


def read_cells(raw: RawText, columns: list[Column]) -> dict[int, np.ndarray]:
    """Read every column of a file.

    Args:
        raw: the lines.
        columns: what each column holds.

    Returns:
        Column index -> (n,) float64, NaN where a cell is empty, for numbers; (n,) str for text, stamps and the rest.

    Raises:
        TableError: a row too long or too short, text, NaN or infinity in a column of numbers.
    """
    _check_widths(raw, len(columns))
    parts = [_read_part(raw.part(first, first + ROWS), columns) for first in range(0, len(raw.body), ROWS)]
    if len(parts) == 1:
        return parts[0]
    return {index: np.concatenate([part.pop(index) for part in parts]) for index in list(parts[0])}


def _read_part(raw: RawText, columns: list[Column]) -> dict[int, np.ndarray]:
    """Columns of some lines of a file: text takes ten times the memory of its numbers, so a file is read in parts."""
    numeric = [column.index for column in columns if _is_numeric(column)]
    texts = [column.index for column in columns if column.index not in numeric]
    options: dict[str, Any] = {
        "header": None,
        "names": list(range(len(columns))),
        "index_col": False,
        "sep": r"\s+" if raw.delimiter == " " else raw.delimiter,
        "decimal": raw.decimal,
        "dtype": dict.fromkeys(texts, str),
        "na_values": {index: [""] for index in numeric},
        "keep_default_na": False,
        "skipinitialspace": True,
        "skip_blank_lines": False,
        "low_memory": False,
    }
    frame = cast(pd.DataFrame, pd.read_csv(io.StringIO("\n".join(raw.body) + "\n"), **options, **_EXACT))
    numbers = {index: _to_float(frame[index], raw, columns[index]) for index in numeric}
    return numbers | {index: _stripped(frame[index]) for index in texts}


def _stripped(cells: pd.Series) -> np.ndarray:
    """Texts without surrounding blanks, each distinct one stripped once."""
    codes, known = pd.factorize(cells, use_na_sentinel=False)
    return np.array([str(text).strip() for text in known], dtype=str)[codes]


def _is_numeric(column: Column) -> bool:
    return column.quantity not in ("", "name", "role", "run") and column.unit != "stamp"


def _check_widths(raw: RawText, width: int) -> None:
    wrong = np.flatnonzero(cell_counts(raw.body, raw.delimiter) != width)
    if not wrong.size:
        return
    cells = split_line(raw.body[wrong[0]], raw.delimiter)
    fix = "empty cells keep their delimiter"
    if raw.delimiter == "," and len(cells) > width:
        fix = "write numbers with a decimal point, or separate the columns with semicolons"
    raise TableError(
        f"{len(cells)} cells where {width} are expected", where=f"{raw.source} row {raw.line[wrong[0]]}", fix=fix
    )


def _to_float(cells: pd.Series, raw: RawText, column: Column) -> np.ndarray:
    if cells.dtype in (np.float64, np.int64):
        values = cells.to_numpy(dtype=np.float64)
    else:
        values = _from_texts(cells, raw, column)
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        _refuse(raw, column, int(infinite[0]))
    return values


def _from_texts(cells: pd.Series, raw: RawText, column: Column) -> np.ndarray:
    """A column that pandas does not read as numbers throughout, cell by cell."""
    values = np.full(len(cells), np.nan)
    for row, (cell, filled) in enumerate(zip(cells.tolist(), cells.notna().tolist(), strict=True)):
        if filled:
            text = cell.strip() if isinstance(cell, str) else split_line(raw.body[row], raw.delimiter)[column.index]
            plain = plain_number(text, raw.decimal, raw.thousands)
            if plain is None or not POINT_NUMBER.fullmatch(plain):
                _refuse(raw, column, row)
            values[row] = float(plain)
    return values


def refuse_beyond(raw: RawText, column: Column, values: np.ndarray) -> None:
    """Refuse impossible numbers before anything is computed from them.

    Args:
        raw: the lines.
        column: which column.
        values: (n,) in the program's unit.

    Raises:
        TableError: one beyond the bound of its dimension, by row and column.
    """
    most, low, unit = (
        greatest(column.quantity),
        least(column.quantity),
        standard_unit(column.quantity).replace("_", "/"),
    )
    empty = "mark it with an empty cell"
    for wrong, why, fix in (
        (np.abs(values) > most, f"is beyond any machine (at most {most:g} {unit})", f"correct it, or {empty}"),
        (values < low, f"is less than there can be ({low:g} {unit})", f"{empty} where it is not known"),
    ):
        if wrong.any():
            value, where = _cell(raw, column, int(wrong.argmax()))
            raise TableError(f"{shown(value)} {why}", where=where, fix=fix)


def _cell(raw: RawText, column: Column, row: int) -> tuple[str, str]:
    """What a cell says, and where it is, in words."""
    value = split_line(raw.body[row], raw.delimiter)[column.index]
    return value, f"{raw.source} row {raw.line[row]}, column {shown(column.title)}"


def _refuse(raw: RawText, column: Column, row: int) -> NoReturn:
    value, where = _cell(raw, column, row)
    raise TableError(f"not a number ('{shown(value)}')", where=where, fix=_way_out(raw, column, value))


def _way_out(raw: RawText, column: Column, value: str) -> str:
    """Advice on a cell that is no number; commands and targets must not be empty either."""
    if raw.header and value == raw.header[column.index]:
        return "this looks like the row of titles once more: remove it"
    if raw.thousands and raw.thousands in value:
        return f"'{raw.thousands}' groups thousands in this file and '{raw.decimal}' is its decimal sign: write it so"
    if raw.decimal == "," and "." in value:
        return "the decimal sign is a comma, so the point may group thousands: write the number without it"
    if "," in value and value.replace(",", "", 1).strip("+-").isdigit():
        return "write numbers with a decimal point"
    if column.quantity == "time" and is_stamp(value):
        return "call the column 'time', which may hold dates and times of day"
    number = re.match(r"[+-]?[\d.,]+", value)
    if number and UNIT_OF_WORD.get(normalise(value[number.end() :])):
        unit = value[number.end() :].strip()
        said = "" if stated_unit(column.title) else f", and the unit in the title: '{shown(column.title)} [{unit}]'"
        return f"write the number alone{said}"
    if split_joint(column.quantity):
        return "write what was sent"
    return (
        "write the target"
        if column.quantity in GOALS
        else "leave the cell empty: the row keeps its place in the travel"
    )
