"""Whether a machine moved while it was read: a feed column alone does not say so."""

from typing import TYPE_CHECKING

import numpy as np

from ptt.run.view import View

if TYPE_CHECKING:
    from ptt.run.table import Table

STOPPED = 1.5  # times the way at the stated feed that a row takes, from which the machine stood while it was read
SURE = 5.0  # standard errors from which a run's clock alone shows the feed between its rows
LEAST_STEPS = 10  # from which it may


def as_driven(view: View, table: "Table") -> View:
    """A view without speed where its clock shows that the machine stood while it was read.

    A feed column says how fast the machine came, not whether it still moved: rows that take longer than the way at that
    feed were read at a stop, where nothing lags. Without the column the clock itself tells the feed.

    Args:
        view: of the rows.
        table: the rows.

    Returns:
        The same, or the same at a standstill.
    """
    if table.time_s is None or not view.velocity.any():
        return view
    way = np.linalg.norm(np.diff(view.p.numpy(), axis=0), axis=1)
    took = np.diff(table.time_s)
    steps = (way > 0.0) & (took > 0.0) & ~view.starts.numpy()[1:]
    feed = _by_clock(way[steps], took[steps]) if table.feed_mm_s is None else table.feed_mm_s[1:][steps]
    came = feed > 0.0
    if not came.any() or np.median((took[steps] * feed / way[steps])[came]) < STOPPED:
        return view
    return view.standing()


def _by_clock(way: np.ndarray, took: np.ndarray) -> np.ndarray:
    """The feed at which rows take longer the farther they lie apart, (m,); zero where the clock does not show one.

    Rows read at a stop take the stop's time and that of the way; those read on the way by equal time, or at equal
    distance, do not take longer the farther they lie apart.
    """
    far, none = way - way.mean() if len(way) else way, np.zeros(len(way))
    spread = float(far @ far)
    if len(way) < LEAST_STEPS or spread <= 0.0:
        return none
    slope = float(far @ took) / spread
    rest = took - took.mean() - slope * far
    doubt = np.sqrt(float(rest @ rest) / (len(way) - 2) / spread)
    return np.full(len(way), 1.0 / slope) if slope > SURE * doubt and slope > 0.0 else none
