"""The order of the rows: how the machine travelled, which the clock must not contradict."""

from dataclasses import replace

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.readers.export import Export
from ptt.run.readers.required import title_of

AS_ROWS, BY_TIME = "rows", "time"
ORDERS = (AS_ROWS, BY_TIME)


class OrderError(TableError):
    """Time goes back, and the user has not said how to handle it."""


def in_travel_order(export: Export, order: str | None, *, refuse: bool = True) -> tuple[Export, list[str]]:
    """Rows in the order in which the machine went through them.

    Backlash, drift and warming are identified from the order; rows sorted by name or position would confuse them.
    Every run has its own clock.

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
    time, run = _clock(export)
    if time is None:
        if order == BY_TIME:
            raise TableError("no column of time to sort by", where="--set order=time", fix="leave it out")
        return export, []
    if order == BY_TIME:
        return _sorted_by_time(export, time, run)
    late = _first_that_goes_back(time, run)
    if late is None:
        return export, []
    if order == AS_ROWS:
        return export, ["time goes back; the rows are taken to be in travel order, as --set order=rows says"]
    if not refuse:
        return export, ["time goes back; the rows are used in their present order"]
    raise OrderError(
        f"time goes back{_of_run(export, late[1])} (from {time[late[0]]:.12g} to {time[late[1]]:.12g} s, after row "
        f"{export.line[late[0]]}), so the rows may not be in travel order",
        where=f"{export.source} row {export.line[late[1]]}, column {title_of(export, 'time')}",
        fix="--set order=time sorts each run by its clock, --set order=rows keeps the rows as they stand; where the "
        "clock was restarted, number the runs in a column 'run'",
    )


def refuse_order(order: object) -> None:
    """Refuse an order that is none of `ORDERS`; None (not stated) is accepted."""
    if order not in (None, *ORDERS):
        raise TableError(
            f"no order '{shown(order)}'", where="--set order", fix=f"write order={' or order='.join(ORDERS)}"
        )


def _clock(export: Export) -> tuple[np.ndarray | None, np.ndarray]:
    run = export.columns.get("run", np.full(export.n, ""))
    return export.columns.get("time"), np.unique(run, return_inverse=True)[1].reshape(-1)


def _first_that_goes_back(time: np.ndarray, run: np.ndarray) -> tuple[int, int] | None:
    """The first row that is earlier than the row before it of its run, and that row."""
    found = []
    for code in np.unique(run):
        rows = np.flatnonzero((run == code) & np.isfinite(time))
        back = np.flatnonzero(np.diff(time[rows]) < 0.0)
        if back.size:
            found.append((int(rows[back[0]]), int(rows[back[0] + 1])))
    return min(found, key=lambda pair: pair[1], default=None)


def _sorted_by_time(export: Export, time: np.ndarray, run: np.ndarray) -> tuple[Export, list[str]]:
    """Each run sorted in the places that it has in the file; rows without a time stay behind the row before them."""
    order = np.arange(export.n)
    for code in np.unique(run):
        rows = np.flatnonzero(run == code)
        known = np.maximum.accumulate(np.where(np.isfinite(time[rows]), np.arange(len(rows)), 0))
        clock = np.nan_to_num(time[rows][known], nan=-np.inf)
        order[rows] = rows[np.argsort(clock, kind="stable")]
    moved = int((order != np.arange(export.n)).sum())
    columns = {name: values[order] for name, values in export.columns.items()}
    extra = {title: values[order] for title, values in export.extra.items()}
    sorted_ = replace(export, columns=columns, extra=extra, line=export.line[order])
    return sorted_, [f"rows sorted by time within each run: {moved} of {export.n} moved"]


def _of_run(export: Export, row: int) -> str:
    label = str(export.columns["run"][row]) if "run" in export.columns else ""
    return f" within {label if label.lower().startswith('run') else f'run {label}'}" if label else ""
