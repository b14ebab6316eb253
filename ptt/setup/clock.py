"""Time and feed in another unit than their titles say: by plausible values, and by each other."""

import numpy as np

from ptt.run.readers.stamps import STAMPED
from ptt.run.table import Table
from ptt.setup.columns import Result, fastest, known, said, settled, shifted
from ptt.setup.result import Finding
from ptt.setup.rows import places
from ptt.setup.setup import Setup, used_rows

LONGEST_STEP, LONGEST_RUN = 600.0, 2.0 * 86400.0  # s: beyond both, time is in milliseconds
LEAST_MOVES = 10  # fewer moves show no rule
EPOCH_MS = 1e11  # larger times are milliseconds since 1970; in seconds these are 1.8e9


def find_speed(setup: Setup) -> tuple[list[Finding], Setup]:
    """Time that contradicts path and feed.

    Args:
        setup: both files, the geometry in order.

    Returns:
        At most one finding, and the files with it undone where that is sure.
    """
    return settled(setup, _speed(setup))


def find_clock(setup: Setup) -> Result | None:
    """Time stamps that cannot be in seconds."""
    table = setup.table
    if table.time_s is None or _is_stated(table):
        return None
    time = np.asarray(table.time_s, dtype=float)
    rows = used_rows(table) & np.isfinite(time)
    time = time[rows]
    if len(time) < 5:
        return None
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    if not len(steps):
        return None
    usual, whole = float(np.median(steps)), float(np.ptp(time))
    since_1970 = float(np.abs(time).max()) > EPOCH_MS
    if since_1970 or (usual > LONGEST_STEP and whole > LONGEST_RUN):
        words = f"time_s steps by {usual:,.0f} from row to row, {whole / 86400.0:,.1f} days in all"
        return _milliseconds(setup, words, usual, usual / 1e3 < LONGEST_STEP)
    return None


def _is_stated(table: Table) -> bool:
    """Whether stamps or the title leave no doubt about the unit of the clock: then a reading an hour is no mistake."""
    answers = table.understood.mapping
    title = next((title for title, quantity in answers.columns.items() if quantity == "time"), "")
    if (unit := answers.units.get(title, "s")) != "stamp":
        return unit != "s"
    return any(line.startswith(f"{title}: {STAMPED}") for line in table.understood.lines)


def _milliseconds(setup: Setup, words: str, usual: float, sure: bool) -> Result:
    words = f"{words}: in milliseconds that is {usual / 1e3:.3g} s a row"
    return said(setup, "time-unit", words, "rename the column time_ms", sure), shifted("time_s", 1e-3, 0.0)


def _speed(setup: Setup) -> Result | None:
    """Time compared with path over feed, the unit of the path being right."""
    paces = _time_ratio(setup, np.asarray(used_rows(setup.table)))
    if len(paces) < 5:
        return None
    pace, moved = (float(value) for value in np.median(paces, axis=0))
    usual, paced = pace * moved, _is_thousandfold(paces)
    if (paced or (pace > 300.0 and usual > LONGEST_STEP)) and not _is_stated(setup.table):
        words = f"by feed_mm_s each move takes {moved:.2g} s, by time_s {pace:,.0f} times as long"
        return _milliseconds(setup, words, usual, paced)
    if pace < 0.1:
        words = (
            f"by time_s the tool moved {1.0 / pace:,.0f} times as fast as feed_mm_s says: "
            "one of the two is in another unit"
        )
        return said(setup, "time-unit", words, "rename the column: time_min, or feed_mm_min", False), None
    return None


def _time_ratio(setup: Setup, rows: np.ndarray) -> np.ndarray:
    """Ratio of each row's time to its path over the feed, and path over feed in s, (m, 2)."""
    feed, time = setup.table.feed_mm_s, setup.table.time_s
    if feed is None or time is None:
        return np.zeros((0, 2))
    path = np.linalg.norm(np.diff(places(setup)[rows], axis=0), axis=1)
    steps, speed = np.diff(np.asarray(time)[rows]), np.asarray(feed)[rows][1:]
    good = (path > 0.0) & (steps > 0.0) & (speed > 0.0) & np.isfinite(path * steps * speed)
    return np.stack([steps[good] * speed[good] / path[good], path[good] / speed[good]], axis=1)


def _is_thousandfold(pace: np.ndarray) -> bool:
    """Whether every row took about a thousand times as long as its path; waiting would not grow with the path."""
    if len(pace) < LEAST_MOVES:
        return False
    (low, usual, high), (short, _, long) = np.percentile(pace, [10.0, 50.0, 90.0], axis=0).T
    return bool(300.0 < usual < 3000.0 and high < 1.5 * low and long > 2.0 * short)


def find_feed(setup: Setup) -> Result | None:
    """A feed that no such machine reaches."""
    values = known(setup.table.feed_mm_s)
    limit = fastest(setup.file.machine)
    if not len(values) or float(np.median(values)) <= limit:
        return None
    usual = float(np.median(values))
    words = (
        f"feed_mm_s is {usual:,.0f}: in mm/min that is {usual / 60.0:,.0f} mm/s; "
        f"no such machine moves faster than {limit:,.0f} mm/s"
    )
    sure = usual / 60.0 <= limit
    return said(setup, "time-unit", words, "rename the column feed_mm_min", sure), shifted("feed_mm_s", 1.0 / 60.0, 0.0)
