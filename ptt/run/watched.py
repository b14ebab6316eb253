"""Columns of the user's own on which an error may depend (--context)."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.readers.mapping import NOT_USED, Understood
from ptt.run.table import Table

OWN = re.compile(r"[bq]\d+|direction\d+|speed\d*|velocity|payload|(memory of )?temperature|time|run|[xyz]")

# What a diagnosis itself calls so: told of a column, it would be taken for that
TAKEN = re.compile(r"direction|(way|turn)( [xyz])?|reversal")


def watch(table: Table, titles: Sequence[str]) -> Table:
    """Mark columns of the user's own as something that the error may depend on.

    Args:
        table: n rows, read.
        titles: of the columns, as the file has them.

    Returns:
        The table that names them.

    Raises:
        TableError: there is no such column, a pose has no number in it, it never varies, or its title is that of
            something that the program looks at itself.
    """
    for title in titles:
        if OWN.fullmatch(title):
            raise TableError(f"'{title}' is examined in any case", where=table.source, fix="leave it out of --context")
        if TAKEN.fullmatch(title):
            what = f"'{title}' is the program's own word for how the machine moves"
            raise TableError(what, where=table.source, fix="give the column another title")
        if title not in table.extra:
            raise TableError(f"no column '{shown(title)}' to examine", where=table.source, fix=_way_out(table, title))
    if not titles:
        return table
    watching = table.replace(watched=tuple(dict.fromkeys(titles)), understood=_understood(table.understood, titles))
    for title, values in watched_values(watching).items():
        blank = np.flatnonzero(~np.isfinite(values) & (table.role == "pose"))
        if len(blank):
            what = f"'{shown(str(table.extra[title][blank[0]]))}' is not a number"
            where = table.place(int(blank[0]), title)
            raise TableError(what, where=where, fix="give every pose one, or leave the column out of --context")
        if np.ptp(values[table.role == "pose"]) == 0.0:
            what = f"column '{shown(title)}' is the same in all rows: nothing can depend on it"
            raise TableError(what, where=table.source, fix="leave it out of --context")
    return watching


def watched_values(table: Table) -> dict[str, np.ndarray]:
    """Numbers of the columns that are watched.

    Args:
        table: n rows.

    Returns:
        title -> (n,), NaN where a cell holds no number.
    """
    comma = table.understood.mapping.decimal == ","
    return {title: np.array([_number(text, comma) for text in table.extra[title]]) for title in table.watched}


def _understood(understood: Understood, titles: Sequence[str]) -> Understood:
    ignored = tuple(title for title in understood.ignored if title not in titles)
    told = f"{NOT_USED}{', '.join(understood.ignored)}"
    lines = [line for line in understood.lines if line != told]
    left = [f"{NOT_USED}{', '.join(ignored)}"] if ignored else []
    return replace(understood, lines=(*lines, *left, f"also examined: {', '.join(titles)}"), ignored=ignored)


def _number(text: str, comma: bool) -> float:
    try:
        value = float(text.replace(",", ".") if comma else text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _way_out(table: Table, title: str) -> str:
    near = get_close_matches(title, list(table.extra), 1)
    if near:
        return f"did you mean '{shown(near[0])}'?"
    if not table.extra:
        return "every column of the file already has a meaning and is examined"
    return f"columns of your own: {', '.join(shown(name) for name in table.extra)}"
