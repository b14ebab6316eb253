"""The columns of a run for checking: first cells as written in the file, and the values that they were read as."""

from collections.abc import Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ptt.errors import PttError
from ptt.show.studio.units import unit_in_words

if TYPE_CHECKING:
    import pandas as pd

    from ptt.run.readers import Mapping
    from ptt.run.table import Table

SAMPLE = 3  # rows that are shown
BETWEEN = " \N{MIDDLE DOT} "  # separates values, as a comma may be the file's decimal sign
HEAD = 400  # lines in which titles and first rows are found, so that a long file is not read whole again
ColumnRow = tuple[str, str, str, str, str]  # as `column_rows` returns


def column_rows(table: "Table", run: str) -> list[ColumnRow]:
    """A row for each column of a run that was used.

    Args:
        table: the table that was read.
        run: path of the first of its files.

    Returns:
        Title, meaning, unit in the file, first cells as written there, and the same values in the unit that they were
        converted to, '' where they were not converted.
    """
    from ptt.run.readers.columns import UNITS, dimension_of, standard_unit
    from ptt.run.table import take_rows
    from ptt.run.written import table_to_frame
    from ptt.show.report.facts import columns_of_table

    answers = table.understood.mapping
    lines, cells = _head(run, answers)
    there = [np.flatnonzero(table.line == line)[:1] for line in lines]  # rows may have been sorted by time
    few = table_to_frame(take_rows(table, np.concatenate([*there, np.zeros(0, dtype=np.int64)])))
    found = []
    for column in columns_of_table(table):
        quantity, unit = answers.columns.get(column.title, column.title), answers.units.get(column.title, "")
        own = standard_unit(quantity) if unit in UNITS.get(dimension_of(quantity), {}) else unit
        values = "" if unit == own else _values(few, quantity, unit_in_words(own))
        written = BETWEEN.join(cells.get(column.title, ()))
        found.append((column.title, column.meaning, unit_in_words(unit), written, values))
    return found


def _head(run: str, answers: "Mapping") -> tuple[list[int], dict[str, list[str]]]:
    """Line numbers of the first rows of a file, and title -> their cells; both empty where they cannot be found."""
    from ptt.run.readers.head import titles_of
    from ptt.run.readers.separators import split_line
    from ptt.run.readers.spatial_analyzer import is_spatial_analyzer, reshape
    from ptt.run.readers.text import raw_text

    encoding = answers.encoding or "utf-8"
    with suppress(PttError, OSError, UnicodeError):
        with Path(run).open(encoding=encoding) as file:
            raw = raw_text("".join(islice(file, HEAD)).removeprefix("\ufeff"), encoding, run, answers)
        raw, titles, _ = titles_of(reshape(raw)[0] if is_spatial_analyzer(raw) else raw)
        rows = [split_line(line, raw.delimiter) for line in raw.body[:SAMPLE]]
        return raw.line[:SAMPLE].tolist(), {title: _column(rows, index) for index, title in enumerate(titles)}
    return [], {}


def _column(rows: Sequence[Sequence[str]], index: int) -> list[str]:
    return [row[index] if index < len(row) else "" for row in rows]


def _values(few: "pd.DataFrame", quantity: str, unit: str) -> str:
    from ptt.run.readers.columns import file_title

    title = file_title(quantity)
    return f"{BETWEEN.join(f'{value:.6g}' for value in few[title])} {unit}" if title in few.columns else ""
