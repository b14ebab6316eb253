"""Rows below the readings that are none: statistics of the columns, closing remarks."""

import re

from ptt.errors import TableError, shown
from ptt.run.readers.separators import is_number, split_line
from ptt.run.readers.text import RawText
from ptt.run.readers.titles import split_unit
from ptt.run.readers.words import EXTREMES, STATISTICS


def refuse_footer(raw: RawText, width: int) -> None:
    """Refuse rows at the end that are named like statistics, or that hold no number and are of another width.

    A mean taken for a reading would bias the fit. A point may be called 'max': that alone is no footer.

    Args:
        raw: the lines.
        width: cells of a row.

    Raises:
        TableError: there are such rows, all of them named at once.
    """
    start, certain = len(raw.body), False
    for index in reversed(range(len(raw.body))):
        cells = split_line(raw.body[index], raw.delimiter)
        name, numbers = _name(cells), any(is_number(cell, raw.delimiter) for cell in cells)
        sure = name in STATISTICS or (not numbers and len(cells) != width)
        if sure or name in EXTREMES:
            start, certain = index, certain or sure
        elif numbers:
            break
    if certain:
        _refuse(raw, start)


def _name(cells: list[str]) -> str:
    """The first words of a row in one spelling: `Std.-Abw. [mm]` is stdabw."""
    first = next(filter(None, cells), "").partition(":")[0]
    return re.sub(r"[\s_.\-]+", "", split_unit(first)[0])


def _refuse(raw: RawText, start: int) -> None:
    first, last = raw.line[start], raw.line[-1]
    cells = split_line(raw.body[start], raw.delimiter)
    said, named = next(filter(None, cells), ""), _name(cells) in (*STATISTICS, *EXTREMES)
    raise TableError(
        f"not readings but a footer, it seems ('{shown(said)}')",
        where=f"{raw.source} row {first}" if first == last else f"{raw.source} rows {first} to {last}",
        fix=f"remove {'the row' if first == last else 'these rows'}"
        + named * "; a point that is called so needs another name",
    )
