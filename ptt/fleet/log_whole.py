"""What no part of a log sees by itself: how far cells are empty, the steps of a thermometer's display, and copied rows.

Where a part could not treat its rows as a run of all rows would be treated, the log is refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ptt.errors import InputError, shown
from ptt.fleet.log_columns import meanings_of
from ptt.fleet.log_query import HEADER, SOURCE, ask_log, ask_rows, quoted, types_of
from ptt.run.blanks import fill_blanks
from ptt.run.display import Passage, along_passage, display_step, passage_of
from ptt.run.pasted import PASTED
from ptt.run.readers.columns import Meaning, to_standard
from ptt.run.table import Table

FILLED = ("time", "temp")  # between the cells beside them
STEADY = ("payload", "feed")  # by the row before, and only where all are equal does the reading count
# Changes of a display that are followed; they are sent with every task. One that changes more often shows each step for
# a few rows only, so that its steps leave no trend.
MOST_CHANGES = 20_000


@dataclass(frozen=True)
class Display:
    """How a thermometer's display passes from step to step in a log.

    Attributes:
        passage: the moments, s or row numbers from 0, and the temperatures at them.
        by_clock: whether the moments are times.
        half: half a step, K.
    """

    passage: Passage
    by_clock: bool
    half: float


def settle_rows(table: Table, display: Display | None) -> Table:
    """Rows of a log with their conditions as `ptt.run.conditions.settle_conditions` has them in a run of all rows.

    Args:
        table: the rows, where cells are empty with enough others beside them (`require_filled`).
        display: of the log.
    """
    table, _ = fill_blanks(table)
    if display is None or table.temp_c is None:
        return table
    along = table.time_s if display.by_clock else (table.line - HEADER).astype(float)
    assert along is not None
    return table.replace(temp_c=along_passage(table.temp_c, along, display.passage, display.half))


def require_filled(path: Path, rows: int, beside: int) -> None:
    """Refuse a log with empty cells that a part with its neighbours cannot fill as a run of all rows is filled.

    Args:
        path: Parquet file.
        rows: of the log.
        beside: rows that are read before and after each part.

    Raises:
        InputError: too many one after another, or loads or feeds that nobody wrote down.
    """
    for title, meaning in _meanings(path).items():
        load = meaning.quantity.startswith("tau")
        if not load and meaning.quantity not in (*FILLED, *STEADY):
            continue
        number = _number(title)
        (found,) = ask_rows(
            path, f"SELECT count({number}) AS told, min({number}) = max({number}) AS same FROM {SOURCE}"
        )
        if int(found["told"]) in (0, rows):  # without any value it counts as absent, as in a run
            continue
        where, what = f"{path}, column {shown(title)}", f"is empty in {rows - int(found['told'])} rows"
        if load or (meaning.quantity in STEADY and not found["same"]):
            what = f"{what} and not the same in all others, so that nobody knows what it was"
            raise InputError(what, where=where, fix="write the value into every row it applies to")
        if (gap := _longest_gap(path, number, rows)) >= beside:
            what = f"{what}, {gap} of them one after another; a log is filled over {beside - 1} at most"
            raise InputError(what, where=where, fix="fill the cells, or leave the column out")


def _longest_gap(path: Path, number: str, rows: int) -> int:
    """Most rows one after another without a number."""
    told = f"SELECT file_row_number AS row FROM {SOURCE} WHERE {number} IS NOT NULL"
    before = f"SELECT row, row - lag(row, 1, -1) OVER (ORDER BY row) - 1 AS gap FROM ({told})"
    found = ask_rows(path, f"SELECT max(gap) AS gap, max(row) AS last FROM ({before})")[0]
    return max(int(found["gap"]), rows - 1 - int(found["last"]))


def display_of(path: Path, rows: int) -> Display | None:
    """The display of a log's thermometer, by the rows at which it changes.

    Args:
        path: Parquet file.
        rows: of the log.

    Returns:
        The display; None where temperatures are not those of one, some are not told, or it changes all the time.
    """
    by = {meaning.quantity: (title, meaning) for title, meaning in _meanings(path).items()}
    if "temp" not in by:
        return None
    warmth, clock = _number(by["temp"][0]), _number(by["time"][0]) if "time" in by else "NULL"
    told = _rows_of_changes(path, warmth, clock)
    if told is None or len(told["row"]) < 3:
        return None
    facts = ask_rows(path, f"SELECT count({warmth}) AS warmth, count({clock}) AS clock FROM {SOURCE}")[0]
    if int(facts["warmth"]) < rows:  # filled cells are between two steps, so that a run has no display then either
        return None
    temp = to_standard(told["warmth"], "temp", str(by["temp"][1].unit))
    step = display_step(np.unique(temp), np.abs(np.diff(temp)), rows - 1)
    if step is None:
        return None
    by_clock = int(facts["clock"]) == rows and not ask_rows(path, _FALLS.format(clock=clock))
    along = to_standard(told["clock"], "time", str(by["time"][1].unit)) if by_clock else told["row"].astype(float)
    passage = passage_of(temp, along, 0.5 * step)
    return None if passage is None else Display(passage, by_clock, 0.5 * step)


def _rows_of_changes(path: Path, warmth: str, clock: str) -> dict[str, np.ndarray] | None:
    """The rows before and after each change of a temperature, the first and the last; None if there are too many."""
    query = _CHANGES.format(warmth=warmth, clock=clock, most=2 * MOST_CHANGES + 3)
    told = {name: np.asarray(values.filled(np.nan) if np.ma.isMaskedArray(values) else values, dtype=float)
            for name, values in ask_log(path, query).items()}  # fmt: skip
    return told if len(told["row"]) <= 2 * MOST_CHANGES + 2 else None


_CHANGES = f"""
SELECT row, warmth, clock FROM (
    SELECT *, lag(warmth) OVER way AS before, lead(warmth) OVER way AS after FROM (
        SELECT file_row_number AS row, {{warmth}} AS warmth, {{clock}} AS clock FROM {SOURCE}
        WHERE {{warmth}} IS NOT NULL
    ) WINDOW way AS (ORDER BY row)
) WHERE warmth IS DISTINCT FROM before OR warmth IS DISTINCT FROM after ORDER BY row LIMIT {{most}}"""
_FALLS = f"""
SELECT 1 FROM (SELECT {{clock}} AS clock, lag({{clock}}) OVER (ORDER BY file_row_number) AS before FROM {SOURCE})
WHERE clock < before LIMIT 1"""


def require_once(path: Path, rows: int) -> None:
    """Refuse a log whose rows all come again, to the last digit: a copy tells nothing new, and a run counts it once.

    Args:
        path: Parquet file.
        rows: of the log.

    Raises:
        InputError: it is such a log.
    """
    titles = [title for title in types_of(path) if title != "run"]
    line = f"hash({', '.join(map(quoted, titles))})"
    first = f"(SELECT {line} FROM {SOURCE} WHERE file_row_number = 0)"
    again = f"SELECT file_row_number AS row FROM {SOURCE} WHERE file_row_number > 0 AND {line} = {first}"
    for row in ask_rows(path, f"SELECT row FROM ({again}) WHERE {rows} % row = 0 ORDER BY row"):
        once = int(row["row"])
        before = f"SELECT {line} AS line, lag({line}, {once}) OVER (ORDER BY file_row_number) AS before FROM {SOURCE}"
        if ask_rows(path, f"SELECT 1 FROM ({before}) WHERE before IS NOT NULL AND line <> before LIMIT 1"):
            continue
        if once >= PASTED:
            fix = f"keep the first {once} rows"
            raise InputError(f"all rows come again after {once} rows, as copies", where=str(path), fix=fix)
        return


def _meanings(path: Path) -> Mapping[str, Meaning]:
    return meanings_of(types_of(path), str(path))


def _number(title: str) -> str:
    """SQL of a column's numbers, NULL where a cell is empty."""
    return f"nullif(TRY_CAST({quoted(title)} AS DOUBLE), 'nan'::DOUBLE)"
