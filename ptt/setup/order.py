"""Rows that are not in travel order: time that runs back, rows sorted alphabetically by name or by a coordinate."""

import re

import numpy as np

from ptt.run.restarts import restarts_of_runs
from ptt.run.table import Table, take_rows
from ptt.setup.columns import said
from ptt.setup.result import Finding
from ptt.setup.rows import places
from ptt.setup.setup import Setup

DAY = 86400.0  # s: a clock without a date jumps back by a day at midnight
LEAST_NAMES = 11  # from ten on, the order of letters differs from that of numbers
POSES = 30  # poses that advance monotonically along an axis: impossible by chance
BACK = (
    0.01  # of the range, that one pose may go back: a table sorted by readings is not quite in the order of its targets
)
LEAP = 0.15  # of the range of another axis, median jump between poses: half of that of a random order


def find_disorder(setup: Setup) -> tuple[list[Finding], Setup]:
    """Rows out of travel order.

    Args:
        setup: both files.

    Returns:
        At most one finding, and the files with the rows in order.
    """
    return _by_time(setup) or _by_name(setup) or _by_place(setup) or ([], setup)


def _by_time(setup: Setup) -> tuple[list[Finding], Setup] | None:
    table = setup.table
    if table.time_s is None or not np.isfinite(table.time_s).all():
        return None
    time = np.asarray(table.time_s, dtype=float)
    within = np.diff(table.run) == 0
    steps = np.diff(time)
    back = np.flatnonzero(within & (steps < 0.0) & (np.abs(steps + DAY) > 0.5 * DAY))
    if not len(back):
        return None
    if len(restarts_of_runs(time, table.run, len(back))):
        rows = f"row{'s' if len(back) > 1 else ''} {', '.join(map(str, table.line[back + 1]))}"
        words = f"the clock starts anew at {rows}, as where sessions are put one behind another"
        return [said(setup, "row-order", words, "number the sessions in a column 'run'", False)], setup
    row = table.line[back[0] + 1]
    sure = len(back) > 1
    words = f"time goes back at {len(back)} of {len(steps)} rows, first at row {row}: the rows are not in travel order"
    fix = "sort the rows by time" if sure else "sort the rows by time, or number two runs in a column 'run'"
    order = np.lexsort((time, table.run))
    cured = Setup(setup.file, take_rows(table, order)) if sure else setup
    return [said(setup, "row-order", words, fix, sure)], cured


def _by_name(setup: Setup) -> tuple[list[Finding], Setup] | None:
    table, names = setup.table, setup.table.name.tolist()
    numbers = _numbers(table)
    if table.time_s is not None or numbers is None or names != sorted(names) or (np.diff(numbers) >= 0).all():
        return None
    shown = ", ".join(dict.fromkeys(names[:40]))
    words = f"rows are sorted alphabetically by name ({', '.join(shown.split(', ')[:4])}, ...), not in travel order"
    order = np.argsort(numbers, kind="stable")
    finding = said(setup, "row-order", words, "sort the rows by the number in their name")
    return [finding], Setup(setup.file, take_rows(table, order))


def _numbers(table: Table) -> np.ndarray | None:
    """The numbers that names of one kind end in, (n,) int; None where there are no such names, or few."""
    parts = [re.fullmatch(r"(\D*)(\d+)", name) for name in table.name.tolist()]
    few = len(set(table.name.tolist())) < LEAST_NAMES
    if few or not all(parts) or len({part[1] for part in parts if part}) > 1:
        return None
    return np.array([int(part[2]) for part in parts if part])


def _numbered(table: Table) -> str:
    """A hint at names that may tell the order: numbered, each once, and not as the rows stand."""
    numbers = _numbers(table)
    told = numbers is not None and len(np.unique(numbers)) == len(numbers) and bool((np.diff(numbers) < 0).any())
    return " (by the numbers in their names, if these were given then)" if told else ""


def _by_place(setup: Setup) -> tuple[list[Finding], Setup] | None:
    """Rows monotonic along one axis that jump along the others: sorted tables look like that, paths do not."""
    if setup.table.time_s is not None:
        return None
    place = places(setup)
    place = place[np.isfinite(place).all(axis=1)]
    place = place[np.append(True, (np.diff(place, axis=0) != 0.0).any(axis=1))[: len(place)]]  # repeats once
    if len(place) < POSES:
        return None
    steps, reach = np.diff(place, axis=0), np.ptp(place, axis=0)
    for axis, letter in enumerate("xyz"):
        own, others = steps[:, axis], np.delete(np.arange(3), axis)
        back = min(float(np.maximum(-own, 0.0).max()), float(np.maximum(own, 0.0).max()))
        one_way = back <= BACK * reach[axis] and len(np.unique(place[:, axis])) > 0.5 * len(place)
        if one_way and (np.median(np.abs(steps[:, others]), axis=0) > LEAP * reach[others]).all() and reach.all():
            words = (
                f"the rows are sorted by {letter} and jump along the other axes: unless the machine really moved "
                "that way, play, lag and drift cannot be identified"
            )
            fix = f"put the rows in the order of measuring{_numbered(setup.table)}, or add a column time_s"
            return [said(setup, "row-order", words, fix, False)], setup
    return None
