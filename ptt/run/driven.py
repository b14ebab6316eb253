"""Whether a machine moved or stood while it was read, which a feed column alone does not show."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ptt.run.corners import SAME_SPEED, TURN
from ptt.run.direction import STANDSTILL
from ptt.run.view import View

if TYPE_CHECKING:
    from ptt.run.table import Table

STOPPED = 1.5  # ratio of a row's time to its distance over the feed from which the machine stood while it was read
SURE = 5.0  # standard errors of the regression of time on distance from which it gives the feed
LEAST_STEPS = 10  # fewest moves for that regression
MOSTLY = 0.5  # share of rows with corners: few on a path, nearly all between separate poses


def as_driven(view: View, table: "Table") -> View:
    """A view without speed where its clock shows that the machine stood while it was read.

    A feed column states how fast the machine came, not whether it still moved: rows that take longer than their
    distance over the feed were read at a standstill, where nothing lags. Without the column the clock gives the feed.
    But a clock may go on behind a reading on arrival, or be of another device, so that the speeds by varying feeds are
    kept: an error that follows them shows that the machine still moved.

    Args:
        view: of the rows.
        table: the rows.

    Returns:
        The same view, or the same at a standstill.
    """
    if table.time_s is None or not view.velocity.any():
        return view
    moved = np.diff(view.p.numpy(), axis=0)
    way, took = np.linalg.norm(moved, axis=1), np.diff(table.time_s)
    steps = (way > STANDSTILL) & (took > 0.0) & ~view.starts.numpy()[1:]
    if table.feed_mm_s is None:
        stood = _stood_by_clock(way[steps], took[steps], turns_sharply=_turns_sharply(moved, steps))
        return view.standing() if stood else view
    steps &= table.feed_mm_s[1:] > 0.0
    feed = table.feed_mm_s[1:][steps]
    if not len(feed) or np.median(took[steps] * feed / way[steps]) < STOPPED:
        return view
    return view.standing(by_feed(view, feed.min(), feed.max()))


def by_feed(view: View, least: float, most: float) -> Tensor | None:
    """The `fed` of a view that is taken to move at feeds from `least` to `most`, mm/s."""
    if view.paces is None or most - least <= SAME_SPEED * most:
        return None
    return every_pace(view.velocity, view.paces)


def every_pace(velocity: Tensor, paces: Tensor) -> Tensor:
    """The first of `ptt.run.pace.PACES` (n, k) and the others (n, k, 3) as one, (n, k, 4)."""
    return torch.cat([velocity[..., None], paces], dim=-1)


def _turns_sharply(moved: np.ndarray, steps: np.ndarray) -> bool:
    """Whether the tool turns sharply at most rows, where no machine runs through without stopping."""
    both = steps[1:] & steps[:-1]
    if both.sum() < LEAST_STEPS:
        return False
    to, on = moved[:-1][both], moved[1:][both]
    cosine = np.einsum("nc,nc->n", to, on) / (np.linalg.norm(to, axis=1) * np.linalg.norm(on, axis=1))
    return float((cosine < TURN).mean()) > MOSTLY


def _stood_by_clock(way: np.ndarray, took: np.ndarray, *, turns_sharply: bool) -> bool:
    """Whether most of the time between rows does not depend on their distance: rows read at a standstill.

    The slope of time over distance is one over the feed; the rest is the stop. It is not determined where rows were
    read on the move at equal times or distances, nor where stops vary freely; but between separate poses are corners.
    """
    far = way - way.mean() if len(way) else way
    spread = float(far @ far)
    if len(way) < LEAST_STEPS or spread <= 0.0:
        return False
    slope = float(far @ took) / spread
    rest = took - took.mean() - slope * far
    doubt = np.sqrt(float(rest @ rest) / (len(way) - 2) / spread)
    if slope > SURE * doubt:
        return float(np.median(took / way)) >= STOPPED * slope
    return turns_sharply and float(np.median(took / way)) >= STOPPED * (max(slope, 0.0) + SURE * doubt)
