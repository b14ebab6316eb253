"""Corners of a travel: rows where it turns sharply, stands, changes its speed or begins anew."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ptt.run.table import Table

TURN = 0.8  # cosine of the tool's change of direction at a row, below which the row is a corner
CURVE = 0.49  # the same on a path that is known to be smooth: down to six rows to a circle
SAME_SPEED = 0.05  # relative change of speed beyond which a row is a corner
EQUAL = 0.05  # relative difference of times that count as equal: sampling in whole milliseconds, rounded clocks
EVENLY = 0.9  # least share of rows at equal times for reading on the move: laps and missed rows are the rest
PAUSE = 10.0  # ratio to the usual duration beyond which a move contains a pause
REPEATED = 1e-9  # mm: rows closer than this are one pose


def shows_feed(table: "Table") -> bool:
    """Whether the table has a feed from which speeds follow."""
    return table.feed_mm_s is not None and bool(np.nan_to_num(table.feed_mm_s).max() > 0.0)


def driven_feed(length: np.ndarray, starts: np.ndarray, table: "Table") -> tuple[np.ndarray, np.ndarray]:
    """Actual feed at each row: that of the column, but by the clock where this shows ramps.

    A feed column holds the programmed feed, which the machine has to ramp up to and down from. Where rows were read on
    the move at equal times, and most are as far apart as the feed makes them, the others are on ramps.

    Args:
        length: distance from row to row, (n - 1,) mm.
        starts: first rows of runs, (n,) bool.
        table: the rows, with a feed.

    Returns:
        (n,) mm/s, and whether that of a move is by the clock, (n - 1,) bool.
    """
    feed, none = np.nan_to_num(np.asarray(table.feed_mm_s, dtype=float)), np.zeros(len(length), dtype=bool)
    if table.time_s is None or len(length) < 2:
        return feed, none
    took = np.diff(np.asarray(table.time_s, dtype=float))
    known = (took > 0.0) & (feed[1:] > 0.0) & (length > REPEATED) & ~starts[1:]
    if not known.any():
        return feed, none
    alike = np.abs(np.diff(took)) <= EQUAL * np.minimum(took[1:], took[:-1])
    even = known & (np.append(alike, False) | np.append(False, alike))  # as long as the move before or behind it
    ratio = took * feed[1:] / np.maximum(length, REPEATED)
    if abs(float(np.median(ratio[known])) - 1.0) > EQUAL or even.sum() < EVENLY * known.sum():
        return feed, none
    other = even & (np.abs(ratio - 1.0) > EQUAL)
    feed[1:][other] = length[other] / took[other]
    return feed, other


def corners_of(
    moved: np.ndarray, length: np.ndarray, lasts: np.ndarray, sound: np.ndarray, *, smooth: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n,) bool where the tool turns sharply or stands, with the first and last; rows where its speed changes."""
    rate = length / lasts
    unit = moved / np.maximum(length, 1e-9)[:, None]
    bend = np.einsum("nc,nc->n", unit[1:], unit[:-1]) < (CURVE if smooth else TURN)
    change = np.abs(np.diff(rate)) > SAME_SPEED * np.maximum(rate[1:], rate[:-1])
    ends = np.array([True])
    return np.concatenate([ends, bend | ~sound[1:] | ~sound[:-1], ends]), np.concatenate([~ends, change, ~ends])


def arcs_of(moved: np.ndarray, bends: np.ndarray) -> np.ndarray:
    """Ratio of arc to chord from row to row, on circles through neighbouring rows, (n - 1,); 1 beside corners.

    Args:
        moved: from row to row, (n - 1, 3) mm.
        bends: rows at which the tool turns sharply or stands, (n,) bool.
    """
    unit = moved / np.maximum(np.linalg.norm(moved, axis=1), REPEATED)[:, None]
    turn, known = np.zeros(len(bends)), ~bends
    turn[1:-1] = np.arccos(np.clip(np.einsum("nc,nc->n", unit[1:], unit[:-1]), -1.0, 1.0))
    half = 0.5 * (turn * known)[1:] + 0.5 * (turn * known)[:-1]
    half = half / np.maximum(known[1:].astype(float) + known[:-1], 1.0)  # half the mean of the known ones
    return np.asarray(1.0 / np.sinc(half / np.pi))


def entered_anew(lasts: np.ndarray, bends: np.ndarray, table: "Table") -> np.ndarray:
    """Rows at which a sweep begins anew although the run goes on, (n,) bool.

    By the clock there was time for more than the move to such a row, and the path turns sharply there but not at the
    next: the tool came by a run-up that is not in the table, as onto a circle that is read on the move.

    Args:
        lasts: durations from row to row by the feed, (n - 1,) s; infinite where not known.
        bends: whether the tool turns sharply at a row, (n,) bool.
        table: the rows.
    """
    none = np.zeros_like(bends)
    known = np.isfinite(lasts)
    if table.time_s is None or not shows_feed(table) or not known.any():
        return none
    waited = np.diff(np.asarray(table.time_s, dtype=float)) - lasts
    usual = max(float(np.median(lasts[known])), float(np.quantile(np.abs(waited[known]), 0.9)))
    paused = known & (np.nan_to_num(waited, nan=0.0, neginf=0.0) > PAUSE * usual)
    none[1:-1] = paused[:-1] & bends[1:-1] & ~bends[2:]
    return none


def begun_again(length: np.ndarray, sound: np.ndarray, table: "Table") -> np.ndarray:
    """Rows that repeat the last pose of a lap as the first of the next, (n,) bool.

    Hardly any time passes between the two, so the machine does not stand there.

    Args:
        length: distance from row to row, (n - 1,) mm.
        sound: moves from which a speed follows, (n - 1,) bool.
        table: the rows.
    """
    begun = np.zeros(len(length) + 1, dtype=bool)
    if table.time_s is None or not sound.any():
        return begun
    step = np.diff(np.asarray(table.time_s, dtype=float))
    at_once = (length < REPEATED) & (PAUSE * step < np.median(step[sound]))
    begun[1:-1] = at_once[:-1] & sound[1:]
    return begun
