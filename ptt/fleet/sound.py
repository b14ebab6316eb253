"""Checks before a log is fitted: cells that are no numbers, time that goes back, mistakes in the set-up."""

import re
from pathlib import Path

from ptt.door.opened import check_rows
from ptt.door.options import ReadOptions
from ptt.door.reading import require_commands
from ptt.door.result import Note, ignore_note
from ptt.door.run import Run
from ptt.errors import InputError, shown
from ptt.fitting.chunks import CHUNK
from ptt.fleet.log import read_log
from ptt.fleet.log_columns import meanings_of
from ptt.fleet.log_query import HEADER, SOURCE, ask_rows, quoted, types_of
from ptt.machine import MachineFile
from ptt.run.conditions import settle_conditions
from ptt.run.readers.columns import dimension_of
from ptt.run.table import Table

NUMERIC = re.compile("DOUBLE|FLOAT|DECIMAL|U?(TINY|SMALL|BIG|HUGE)?INT.*")


def require_sound(
    machine: MachineFile, rows: Path, log: Path, *, anyway: bool = False, note: Note = ignore_note
) -> None:
    """Refuse a log that `ptt add` would refuse as a run: a fit to it would be worthless.

    Args:
        machine: the machine.
        rows: the log as Parquet.
        log: as it was given; in a CSV an empty cell is a missing reading, and the text NaN a mistake.
        anyway: whether mistakes in the set-up, and time that goes back, are noted instead of refused.
        note: told of them, and of mistakes that are not sure.

    Raises:
        InputError: no rows, a column in no known unit, a cell that is no number, time that goes back.
        SetupError: a mistake in the set-up that is sure, by the first rows.
    """
    columns = types_of(rows)
    if not int(ask_rows(rows, f"SELECT count(*) AS rows FROM {SOURCE}")[0]["rows"]):
        raise InputError("holds no rows", where=str(log), fix="export it again; a header and two rows are the least")
    wanted = meanings_of(columns, str(log))
    for name in (name for name, meaning in wanted.items() if dimension_of(meaning.quantity) != "text"):
        _require_numbers(rows, log, name, columns[name], nan=rows != log)
    clock = next((name for name, meaning in wanted.items() if meaning.quantity == "time"), "")
    if NUMERIC.fullmatch(columns.get(clock, "")):
        _require_order(rows, log, clock, anyway, note)
    table = read_log(machine, rows, f"LIMIT {CHUNK}").replace(source=str(log))
    table, settled = settle_conditions(table)
    for line in (*table.understood.lines, *settled):
        note(f"first {table.rows} rows: {line}")
    _require_set_up(machine, table, log, anyway, note)


def _require_set_up(machine: MachineFile, table: Table, log: Path, anyway: bool, note: Note) -> None:
    """Check axes, units, sliders and lengths by the first rows; the order of all rows was checked by their time."""
    check = check_rows(machine, Run(table, (log,), ReadOptions(set_=["order=rows"])), anyway=anyway, note=note)
    if not check.sure:
        require_commands(machine, table)


def _require_numbers(rows: Path, log: Path, name: str, kind: str, *, nan: bool) -> None:
    column = quoted(name)
    value = f"TRY_CAST({column}::VARCHAR AS DOUBLE)"  # a column with a text, or with empty cells alone, is VARCHAR
    if NUMERIC.fullmatch(kind):
        value = f"{column}::DOUBLE"
    wrong = f"{value} IS NULL OR isinf({value})" + (f" OR isnan({value})" if nan else "")
    query = f"SELECT file_row_number AS row, {column}::VARCHAR AS cell FROM {SOURCE} WHERE {column} IS NOT NULL"
    found = ask_rows(rows, f"{query} AND ({wrong}) LIMIT 1")
    if found:
        what = f"not a number ('{shown(str(found[0]['cell']))}')"
        where = f"{log} row {int(found[0]['row']) + HEADER}, column {name}"
        raise InputError(what, where=where, fix="remove the row or mark it with an empty cell")


def _require_order(rows: Path, log: Path, clock: str, anyway: bool, note: Note) -> None:
    found = ask_rows(rows, _BACK.format(clock=clock))
    if not found:
        return
    row, before, time = (found[0][key] for key in ("row", "before", "clock"))
    unit = clock.removeprefix("time_")
    what = f"time goes back (from {before:.12g} to {time:.12g} {unit}), so the rows may not be in travel order"
    where = f"{log} row {int(row) + HEADER}, column {clock}"
    if not anyway:
        fix = "sort the log by it, or --anyway keeps the rows as they stand"
        raise InputError(what, where=where, fix=fix)
    note(f"{where}: {what}; going on with the rows as they stand")


_BACK = f"""
SELECT * FROM (
    SELECT file_row_number AS row, {{clock}} AS clock, lag({{clock}}) OVER (ORDER BY file_row_number) AS before
    FROM {SOURCE} WHERE {{clock}} IS NOT NULL AND NOT isnan({{clock}}::DOUBLE)
) WHERE clock < before ORDER BY row LIMIT 1"""
