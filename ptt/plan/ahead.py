"""Rows to come: how visits that are driven after a run would be read, by the columns of its model."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from ptt.plan.foresight import DWELL, FEED
from ptt.plan.palette import Palette, paint
from ptt.plan.space import Space
from ptt.plan.visits import Visit, table_of
from ptt.run.mounts import place_mounts
from ptt.run.table import Table
from ptt.run.view import View
from ptt.run.viewing import build_view


def paint_ahead(palette: Palette, visits: Sequence[Visit], space: Space, *, still: bool = False) -> np.ndarray:
    """Columns of visits that are driven in this order after the run.

    Args:
        palette: the columns.
        visits: all of the same number of rows.
        space: for tool positions.
        still: all are read at the same moment, because their order is not known yet.

    Returns:
        (visits, 3 x rows, P).
    """
    straight = palette.problem.file.machine.moves == "straight"
    view = _later(palette, table_of(visits, space, straight=straight), still)
    columns = paint(palette, view, None)
    return columns.reshape(len(visits), -1, palette.width)


def _later(palette: Palette, table: Table, still: bool) -> View:
    """Rows to come as effects see them: after the run, under its load and warmth where nothing else is asked."""
    problem = palette.problem
    old = palette.fitted.layout.see(problem, palette.fitted.unknowns)
    step = np.linalg.norm(np.diff(table.target, axis=0, prepend=table.target[:1]), axis=1) / FEED
    clock = np.cumsum(np.nan_to_num(step) + DWELL)
    view = build_view(problem.file, table.replace(time_s=clock))
    if old.mount is not None:
        view = place_mounts(view, np.zeros(view.rows, dtype=int), old.mount[-1:].numpy())
    begin = float(old.time.max()) + DWELL
    time = begin + torch.as_tensor(np.full(table.rows, clock[-1] / 2.0) if still else clock)
    return replace(
        view if "speed" in old.varies else view.standing(),
        time=time,
        payload=view.payload if table.payload_kg is not None else old.payload[-1].expand(table.rows),
        warmth=view.warmth if table.temp_c is not None else old.warmth[-1].expand(table.rows),
        torque=None,
        varies=old.varies,
    )
