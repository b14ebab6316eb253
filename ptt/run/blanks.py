"""Empty cells of context columns: time and temperature are interpolated, loads and feeds are not."""

import numpy as np

from ptt.run.beside import rows_beside
from ptt.run.table import Table

STEADY = ("payload_kg", "feed_mm_s")  # set by the user, hence unknown between two different values
CONTEXT = ("time_s", "temp_c", *STEADY)


def fill_blanks(table: Table) -> tuple[Table, list[str]]:
    """Interpolate time and temperature of a run; leave out readings under a load or feed that is not stated.

    A single empty cell would otherwise exclude all effects that depend on its column.

    Args:
        table: n rows in travel order.

    Returns:
        The table, and a line for each column that had empty cells.
    """
    table, lines = fill_between(table)
    for name in STEADY:
        values = getattr(table, name)
        if values is not None and np.isnan(values).any() and not np.isnan(values).all():
            table, line = _as_before(table, name, values)
            lines += line
    table, line = _loads_as_before(table)
    lines += line
    return table, lines + [line for name in CONTEXT for line in _unknown(table, name)]


def fill_between(table: Table) -> tuple[Table, list[str]]:
    """Interpolate empty cells of a run's time and temperature.

    Args:
        table: n rows in travel order.

    Returns:
        The table, and a line for each column that had empty cells.
    """
    lines = list[str]()
    along, how = np.arange(table.rows, dtype=float), "row by row"
    for name in ("time_s", "temp_c"):
        values = getattr(table, name)
        if values is None or np.isnan(values).all():
            continue
        filled = _interpolated(values, along, _run_of_motion(table))
        count = int(((table.role != "base") & np.isnan(values) & ~np.isnan(filled)).sum())
        lines += [f"{name} is empty in {_rows(count)}: interpolated, {how}"] if count else []
        table = table.replace(**{name: filled})
        if name == "time_s" and np.isfinite(filled).all() and _goes_on(filled, _run_of_motion(table)):
            along, how = filled, "by the clock"
    return table, lines


def _goes_on(clock: np.ndarray, run: np.ndarray) -> bool:
    """Whether a clock, (n,) s, goes back in no run: between rows of a restarted clock it tells nothing."""
    order = np.argsort(run, kind="stable")
    return not bool(((np.diff(clock[order]) < 0.0) & (np.diff(run[order]) == 0)).any())


def without_empty(table: Table) -> Table:
    """The table without columns of context that have no value in any row.

    Args:
        table: n rows.
    """
    empty = [name for name in CONTEXT if (value := getattr(table, name)) is not None and np.isnan(value).all()]
    return table.replace(**dict.fromkeys(empty))


def has_blanks(table: Table) -> bool:
    """Whether time, temperature or payload has empty cells; a target without a feed is taken at rest."""
    values = (getattr(table, name) for name in ("time_s", "temp_c", "payload_kg"))
    return any(each is not None and bool(np.isnan(each).any()) for each in values)


def _as_before(table: Table, name: str, values: np.ndarray) -> tuple[Table, list[str]]:
    """A table with blanks filled by the row before; their readings are left out unless all known values are equal."""
    known = np.isfinite(values)
    filled = _held(values, known, _run_of_motion(table))
    blank = (table.role != "base") & ~known & np.isfinite(filled) & table.observed
    table = table.replace(**{name: filled})
    if not blank.any():
        return table, []
    where = f"{name} is empty in {_rows(int(blank.sum()))} with a reading"
    if np.ptp(values[known]) == 0.0:
        return table, [f"{where}: taken as {values[known][0]:g}, as elsewhere"]
    return _aside(table, blank), [f"{where}: left aside; write the value into every row it applies to"]


def _loads_as_before(table: Table) -> tuple[Table, list[str]]:
    """A table with blanks of joint loads filled by the row before, and their readings left out: loads vary by pose."""
    if table.torque is None:
        return table, []
    told = np.isfinite(table.torque)
    known = told[:, told.any(axis=0)].all(axis=1)
    if known.all() or not told.any():
        return table, []
    blank = (table.role != "base") & ~known & table.observed
    table = table.replace(torque=_held(table.torque, known, _run_of_motion(table)))
    where = f"loads of joints (tau1, ...) are empty in {_rows(int(blank.sum()))} with a reading"
    return _aside(table, blank), [f"{where}: left aside"] if blank.any() else []


def _held(values: np.ndarray, known: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Values (n, ...) with each run's unknown rows filled by its last known row, at its beginning by its first."""
    filled = values.copy()
    for code in np.unique(run[~known]):
        rows = np.flatnonzero(run == code)
        there = rows[known[rows]]
        if len(there):
            filled[rows] = values[there[np.maximum(np.searchsorted(there, rows, side="right") - 1, 0)]]
    return filled


def _run_of_motion(table: Table) -> np.ndarray:
    """Run of each row, (n,); a run of base reflectors alone belongs to the one before: the machine stood."""
    pose = np.isin(table.run, table.run[table.role != "base"])
    return np.asarray(table.run[rows_beside(pose)])


def _aside(table: Table, rows: np.ndarray) -> Table:
    return table.replace(measured=np.where(rows[:, None], np.nan, table.measured)) if rows.any() else table


def _unknown(table: Table, name: str) -> list[str]:
    """A note on a run without any value of a column that others have."""
    values = getattr(table, name)
    if values is None or not (missing := np.isnan(values)).any() or missing.all():
        return []
    run = table.run_label[table.run[np.flatnonzero(missing)[0]]]
    return [f"{name} is empty in all of run '{run}': what depends on it is not examined"]


def _rows(count: int) -> str:
    return f"{count} row{'' if count == 1 else 's'}"


def _interpolated(values: np.ndarray, along: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Values (n,) with blanks interpolated linearly within their run; unchanged in a run without any value."""
    filled = values.copy()
    for code in np.unique(run[np.isnan(values)]):
        rows = np.flatnonzero(run == code)
        known = rows[np.isfinite(values[rows])]
        if len(known):
            blank = rows[np.isnan(values[rows])]
            filled[blank] = np.interp(along[blank], along[known], values[known])
    return filled
