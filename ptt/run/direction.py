"""The direction in which each joint arrives at each row of its travel."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

STANDSTILL = 1e-6  # mm or rad; a smaller move of a command is rounding


def travel_direction(q: Array, starts: ArrayLike | None = None) -> NDArray[np.int8]:
    """Direction in which each joint arrives at each row.

    Standstill keeps the last direction; the rows of a run before its first move, the first row always among them, are
    taken to arrive as that move does; a joint that never moves in a run counts as +1. A row with NaN was not sent and
    is passed over.

    Args:
        q: (n, k) joint commands in travel order, already corrected, mm or rad.
        starts: first row of each run, (n,) bool or (m,) row indices; row 0 is always one.

    Returns:
        (n, k) directions, +1 or -1.
    """
    q = np.asarray(q, dtype=np.float64)
    if not len(q):
        return np.empty(q.shape, dtype=np.int8)
    first, _ = _run_bounds(len(q), starts)
    held = _last_before(np.isfinite(q))
    sent = np.where(held >= first, np.take_along_axis(q, np.maximum(held, 0), axis=0), np.nan)
    move = np.diff(sent, axis=0, prepend=np.nan)
    moved = (np.abs(move) > STANDSTILL) & (np.arange(len(q))[:, None] > first)
    return hold_direction(np.where(moved, move, 0.0), starts)


def hold_direction(move: Array, starts: ArrayLike | None = None, begun: Array | None = None) -> NDArray[np.int8]:
    """Direction of arrival at each row from the joints' moves, held where a joint stands.

    Args:
        move: (n, k) last move of each joint on its way to each row, of which the sign counts, 0 where it stood.
        starts: first row of each run, (n,) bool or (m,) row indices; row 0 is always one.
        begun: (n, k) first move of each joint on its way to each row; None: joints do not reverse on the way.

    Returns:
        (n, k) +1 or -1: the sign of the run's last move so far; before its first move that with which that one begins;
        +1 where there is none.
    """
    if not len(move):
        return np.empty(move.shape, dtype=np.int8)
    first, end = _run_bounds(len(move), starts)
    last = _last_before(move != 0.0)
    upcoming = len(move) - 1 - _last_before(move[::-1] != 0.0)[::-1]  # n where none follows
    onward = np.where(upcoming <= end, upcoming, 0)
    arrived = np.take_along_axis(move, np.maximum(last, 0), axis=0)
    sets_off = np.where(upcoming <= end, np.take_along_axis(move if begun is None else begun, onward, axis=0), 0.0)
    return np.where(np.where(last >= first, arrived, sets_off) < 0.0, -1, 1).astype(np.int8)


def _run_bounds(rows: int, starts: ArrayLike | None) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last row of the run that each row belongs to, (n, 1) each."""
    begins = np.zeros(rows, dtype=bool)
    begins[0] = True
    if starts is not None:
        begins[np.asarray(starts)] = True
    heads = np.flatnonzero(begins)
    run = np.cumsum(begins) - 1
    tails = np.append(heads[1:], rows) - 1
    return heads[run][:, None], tails[run][:, None]


def _last_before(flag: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Index (n, k) of the last row up to and with this one where `flag` (n, k) is set, -1 where there is none."""
    rows = np.arange(len(flag))[:, None]
    return np.maximum.accumulate(np.where(flag, rows, -1), axis=0)
