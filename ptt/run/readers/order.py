"""The order of the rows: how the machine travelled, which the clock must not contradict."""

from dataclasses import replace

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.readers.assemble import roles_of, runs_of
from ptt.run.readers.export import Export
from ptt.run.readers.required import title_of
from ptt.run.restarts import restarts_of_runs

AS_ROWS, BY_TIME = "rows", "time"
ORDERS = (AS_ROWS, BY_TIME)
SORTED = "--set order=time sorts each run by its clock"
KEPT = "--set order=rows keeps the rows as they stand"
FAR = 0.02  # share of the size of the workspace: rows that are farther apart are at different poses
AT_ONCE = 0.01  # of the usual time from row to row: within that, no machine goes from pose to pose
MIXED = 0.1  # share of the rows from which sessions are told to be mixed


class OrderError(TableError):
    """Time goes back, and the user has not said how to handle it."""


def in_travel_order(export: Export, order: str | None, *, refuse: bool = True) -> tuple[Export, list[str]]:
    """Rows in the order in which the machine went through them.

    Backlash, drift and warming are identified from the order; rows sorted by name or position would confuse them.
    Every run has its own clock. Readings of base reflectors, at which nothing moves, may stand anywhere: many exports
    have them in a group of their own.

    Args:
        export: the columns.
        order: 'rows' (as they stand, whatever the clock says), 'time' (sort each run by its clock), or None.
        refuse: whether time that goes back is refused where nobody said an order; else the rows stay as they stand.

    Returns:
        The columns, and remarks on what was done.

    Raises:
        OrderError: time goes back within a run and nobody said what to do.
        TableError: there is no time to sort by.
    """
    time, run, base = _clock(export)
    if time is None:
        if order == BY_TIME:
            raise TableError("no column of time to sort by", where="--set order=time", fix="leave it out")
        return export, []
    if order == BY_TIME:
        return _sorted_by_time(export, time, run)
    back = _that_go_back(time, run)
    if not back:
        return export, []
    if order == AS_ROWS:
        return export, ["time goes back; the rows are taken to be in travel order, as --set order=rows says"]
    if np.isfinite(time[~base]).all() and not _that_go_back(np.where(base, np.nan, time), run):
        return _taken(export, _order_by_time(time, run)), ["readings of base reflectors put in order by their time"]
    if not refuse:
        return export, ["time goes back; the rows are used in their present order"]
    what, fix = _told(export, time, run)
    late = back[0]
    raise OrderError(
        f"time goes back{_of_run(export, late[1])} (from {time[late[0]]:.12g} to {time[late[1]]:.12g} s, after row "
        f"{export.line[late[0]]}){what}",
        where=f"{export.source} row {export.line[late[1]]}, column {title_of(export, 'time')}",
        fix=fix,
    )


def refuse_order(order: object) -> None:
    """Refuse an order that is none of `ORDERS`; None (not stated) is accepted."""
    if order not in (None, *ORDERS):
        raise TableError(
            f"no order '{shown(order)}'", where="--set order", fix=f"write order={' or order='.join(ORDERS)}"
        )


def _clock(export: Export) -> tuple[np.ndarray | None, np.ndarray, np.ndarray]:
    """Time (n,) s, run (n,) int, and which rows are of base reflectors, (n,) bool."""
    base = roles_of(export) == "base"
    return export.columns.get("time"), runs_of(export, base)[1], base


def _that_go_back(time: np.ndarray, run: np.ndarray) -> list[tuple[int, int]]:
    """The row before it of its run, and the row, of each that is earlier than that; in the order of the rows."""
    found = []
    for code in np.unique(run):
        rows = np.flatnonzero((run == code) & np.isfinite(time))
        back = np.flatnonzero(np.diff(time[rows]) < 0.0)
        found += list(zip(rows[back].tolist(), rows[back + 1].tolist(), strict=True))
    return sorted(found, key=lambda pair: pair[1])


def _told(export: Export, time: np.ndarray, run: np.ndarray) -> tuple[str, str]:
    """What time that goes back looks like, and what to do about it, the likelier cure first."""
    anew = restarts_of_runs(time, run, len(_that_go_back(time, run)))
    if not len(anew):
        cures = f"{SORTED}, {KEPT}; where the clock was restarted, number the runs in a column 'run'"
        return ", so the rows may not be in travel order", cures
    looks = f": the clock starts anew at {_rows_in_words(export, anew)}, as where sessions are put one behind another"
    return looks, f"number the sessions in a column 'run', or {KEPT}; {SORTED}, which would mix them"


def _rows_in_words(export: Export, rows: np.ndarray) -> str:
    return f"row{'s' if len(rows) > 1 else ''} {', '.join(str(line) for line in export.line[rows])}"


def _sorted_by_time(export: Export, time: np.ndarray, run: np.ndarray) -> tuple[Export, list[str]]:
    order = _order_by_time(time, run)
    moved = int((order != np.arange(export.n)).sum())
    said = [f"rows sorted by time within each run: {moved} of {export.n} moved"]
    return _taken(export, order), said + _mixed(export, time, run, order)


def _order_by_time(time: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Each run sorted in the places that it has in the file; rows without a time stay behind the row before them."""
    order = np.arange(len(time))
    for code in np.unique(run):
        rows = np.flatnonzero(run == code)
        known = np.maximum.accumulate(np.where(np.isfinite(time[rows]), np.arange(len(rows)), 0))
        clock = np.nan_to_num(time[rows][known], nan=-np.inf)
        order[rows] = rows[np.argsort(clock, kind="stable")]
    return order


def _taken(export: Export, order: np.ndarray) -> Export:
    """The rows in another order, (n,) int."""
    columns = {name: values[order] for name, values in export.columns.items()}
    extra = {title: values[order] for title, values in export.extra.items()}
    return replace(export, columns=columns, extra=extra, line=export.line[order])


def _mixed(export: Export, time: np.ndarray, run: np.ndarray, order: np.ndarray) -> list[str]:
    """A warning where rows of different sessions now stand between each other.

    Args:
        export: as the file has it, n rows.
        time: (n,) s.
        run: (n,) int.
        order: the rows as sorted, (n,) int.
    """
    anew = restarts_of_runs(time, run, len(_that_go_back(time, run)))
    moves = _moves(export, order) & (np.diff(run[order]) == 0)
    cure = "if sessions stand in it one behind another, number them in a column 'run', or give --set order=rows"
    session, steps = np.cumsum(np.isin(np.arange(export.n), anew))[order], np.diff(time[order])
    own = np.append(True, moves | (steps != 0.0))  # without copies, which stand side by side now
    if (np.diff(session[own]) != 0).sum() > len(anew) + MIXED * export.n:
        rows = _rows_in_words(export, anew)
        return [f"warning: the clock starts anew at {rows}, and rows of different sessions alternate now; {cure}"]
    moment = AT_ONCE * float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    at_once = int((moves & (steps <= moment)).sum())
    as_filed = _moves(export, np.arange(export.n)) & (np.diff(run) == 0) & (np.abs(np.diff(time)) <= moment)
    if at_once - as_filed.sum() <= MIXED * export.n:  # a clock of whole minutes shows one time at several poses
        return []
    said = f"{at_once} rows have the time of the row before them and are elsewhere, which no machine can"
    return [f"warning: sorted by time, {said}; {cure}"]


def _moves(export: Export, order: np.ndarray) -> np.ndarray:
    """Whether the tool is elsewhere than at the row before, of the second row on, (n - 1,) bool."""
    place = np.column_stack([export.columns.get(f"{axis}_meas", np.full(export.n, np.nan)) for axis in "xyz"])[order]
    known = np.isfinite(place).all(axis=1)
    reach = float(np.linalg.norm(np.ptp(place[known], axis=0))) if known.any() else 0.0
    return np.asarray(np.linalg.norm(np.diff(place, axis=0), axis=1) > FAR * reach)


def _of_run(export: Export, row: int) -> str:
    label = str(export.columns["run"][row]) if "run" in export.columns else ""
    return f" within {label if label.lower().startswith('run') else f'run {label}'}" if label else ""
