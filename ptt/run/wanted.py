"""Where a list of targets wants the tool in rows that do not say so: by their joint commands, or where it stands."""

import numpy as np
import torch

from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.run.reach import require_closed
from ptt.run.table import Table, take_rows
from ptt.run.target_frame import target_frames
from ptt.run.viewing import standing_rows


def with_places(file: MachineFile, table: Table) -> Table:
    """Targets of sliders' commands: where the drawing puts the tool at these, stated as the other targets are.

    An arm's commands are its posture, and stay what tells its targets.

    Args:
        file: the machine.
        table: n rows.

    Returns:
        The table with a target in each row that has one or a command.

    Raises:
        WorkspaceError: commands at which the links do not meet, by line.
    """
    if file.machine.kind != "three-ptt" or table.command is None:
        return table
    rows = np.isfinite(table.command).all(axis=1) & ~np.isfinite(table.target).all(axis=1)
    if not rows.any():
        return table
    frames, target = target_frames(file, table), table.target.copy()
    target[rows] = build_mechanism(file.machine).forward(torch.tensor(table.command[rows])).numpy()
    require_closed(table, rows & ~np.isfinite(target).all(axis=1))
    for run, frame in enumerate(frames):
        here = rows & (table.run == run)
        target[here] = frame.as_stated(target[here])
    return table.replace(target=target)


def placed_rows(given: Table, table: Table) -> int:
    """How many rows of some targets got theirs from the drawing."""
    return int((np.isfinite(table.target) & ~np.isfinite(given.target)).all(axis=1).sum())


def standing(table: Table) -> Table:
    """The same rows with what base reflectors' rows do not say: the machine stands as in the row before meanwhile.

    Args:
        table: n rows; those of base reflectors have no target.

    Returns:
        The table with their targets, commands, loads and feeds; roles, names, runs and times stay.
    """
    pose = table.role != "base"
    if pose.all():
        return table
    own = {name: getattr(table, name) for name in ("name", "role", "run", "repeat", "line", "time_s", "extra")}
    return take_rows(table, standing_rows(pose, table.run)).replace(**own)
