"""Whether a machine moved while it was read: a feed column alone does not say so."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from ptt.run.view import View

if TYPE_CHECKING:
    from ptt.run.table import Table

STOPPED = 1.5  # times the way at the stated feed that a row takes, from which the machine stood while it was read


def as_driven(view: View, table: "Table") -> View:
    """A view without speed where its clock shows that the machine stood while it was read.

    A feed column says how fast the machine came, not whether it still moved: rows that take longer than the way at that
    feed were read at a stop, where nothing lags.

    Args:
        view: of the rows.
        table: the rows.

    Returns:
        The same, or the same at a standstill.
    """
    if table.feed_mm_s is None or table.time_s is None or "speed" not in view.varies:
        return view
    way = np.linalg.norm(np.diff(view.p.numpy(), axis=0), axis=1)
    took, feed = np.diff(table.time_s), table.feed_mm_s[1:]
    steps = (way > 0.0) & (took > 0.0) & (feed > 0.0) & ~view.starts.numpy()[1:]
    if not steps.any() or np.median(took[steps] * feed[steps] / way[steps]) < STOPPED:
        return view
    return replace(view, velocity=torch.zeros_like(view.velocity), varies=view.varies - {"speed"})
