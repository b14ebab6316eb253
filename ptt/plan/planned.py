"""Design rows of planned visits, as if they were driven after the run."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from ptt.plan.design import DesignColumns, design_rows
from ptt.plan.forecast import DWELL, FEED
from ptt.plan.space import Space
from ptt.plan.visits import Visit, table_of
from ptt.run.mounts import place_mounts
from ptt.run.table import Table
from ptt.run.view import View
from ptt.run.viewing import build_view


def planned_rows(design: DesignColumns, visits: Sequence[Visit], space: Space, *, still: bool = False) -> np.ndarray:
    """Design rows of visits that are driven in this order after the run.

    Args:
        design: the columns.
        visits: all with the same number of rows.
        space: of the machine, for tool positions.
        still: whether all have the same time, because their order is not known yet.

    Returns:
        (visits, 3 x rows, P) whitened, in usual sizes.
    """
    straight = design.problem.file.machine.moves == "straight"
    view = _later(design, table_of(visits, space, straight=straight), still)
    columns = design_rows(design, view, None)
    return columns.reshape(len(visits), -1, design.width)


def _later(design: DesignColumns, table: Table, still: bool) -> View:
    """View of planned rows: after the run, with its last load and temperature where the table states none."""
    problem = design.problem
    old = design.fitted.layout.see(problem, design.fitted.unknowns)
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
