"""Where the clock of a run starts anew, because two sessions or more stand in it one behind another."""

import numpy as np

MOST = 9  # restarts: rows that are out of order go back more often
LEAST_ROWS = 4  # of a session
NEAR = 0.1  # share of a session's duration: the next one starts this near to its start, or before it


def restarts(time: np.ndarray) -> np.ndarray:
    """The rows at which the clock starts anew.

    Args:
        time: of the rows of one run as they stand in the file, (n,) s; NaN where it is not known.

    Returns:
        Indices, (m,) int; none where time never goes back, or otherwise than with a new session: by a little, again and
        again, or to a session that was over before the one in front of it began.
    """
    known = np.flatnonzero(np.isfinite(time))
    clock = np.asarray(time)[known]
    back = np.flatnonzero(np.diff(clock) < 0.0) + 1
    edges = np.concatenate([[0], back, [len(clock)]])
    none = np.zeros(0, dtype=int)
    if not 0 < len(back) <= MOST or np.diff(edges).min() < LEAST_ROWS:
        return none
    start, end = clock[edges[:-1]], clock[edges[1:] - 1]
    anew = (start[1:] <= start[:-1] + NEAR * (end - start)[:-1]) & (end[1:] > start[:-1])
    return known[back] if anew.all() else none


def restarts_of_runs(time: np.ndarray, run: np.ndarray, back: int) -> np.ndarray:
    """The rows of all runs at which the clock starts anew.

    Args:
        time: (n,) s; NaN where it is not known.
        run: (n,) int, each with a clock of its own.
        back: how many rows are earlier than the row before them of their run.

    Returns:
        Indices, (back,) int, in order; none unless these are all new sessions.
    """
    own = [np.flatnonzero(run == each) for each in np.unique(run)]
    rows = np.sort(np.concatenate([np.zeros(0, dtype=int), *(here[restarts(time[here])] for here in own)]))
    return rows if len(rows) == back else rows[:0]
