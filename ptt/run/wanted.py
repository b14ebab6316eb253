"""Targets of rows without any: by forward kinematics of joint commands, or of the row before."""

import numpy as np
import torch

from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.run.reach import require_closed
from ptt.run.table import Table, take_rows
from ptt.run.target_frame import target_frames
from ptt.run.viewing import standing_rows


def with_places(file: MachineFile, table: Table) -> Table:
    """Fill targets by the drawing's forward kinematics of slider commands, in the frame of the other targets.

    An arm's rows keep their commands as posture.

    Args:
        file: the machine.
        table: n rows.

    Returns:
        The table with a target in each row that has one or a command.

    Raises:
        WorkspaceError: commands at which the mechanism cannot be assembled, by line.
    """
    return table if file.machine.kind != "three-ptt" else placed(file, table)


def placed(file: MachineFile, table: Table) -> Table:
    """As `with_places`, of arms too: where the drawing puts the tool."""
    if table.command is None:
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
    """Number of rows whose target came from the drawing."""
    return int((np.isfinite(table.target) & ~np.isfinite(given.target)).all(axis=1).sum())


def standing(table: Table) -> Table:
    """A table whose rows of base reflectors have the pose, load and feed of the row before, where the machine stands.

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
