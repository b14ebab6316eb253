"""The floor under an arm, which its limits do not know: planned poses below the base's plane, and the box above it."""

import math

import torch

from ptt.plan.space import Space
from ptt.run.table import Table

LEAST_DEPTH = 1.0  # mm below the base's plane, from which it is said


def say_floor(table: Table, space: Space) -> str:
    """How far below the base's plane planned poses of an arm go, and how to plan above it.

    Args:
        table: the planned rows.
        space: where their poses were drawn.

    Returns:
        A sentence or two, after a space; '' for a machine whose sliders say how low it goes, or where no pose is below.
    """
    if space.by_tool or table.command is None:
        return ""
    heights = space.mechanism.forward(torch.as_tensor(table.command[table.role != "base"]))[:, 2]
    below, lowest = int((heights < -LEAST_DEPTH).sum()), -float(heights.min())
    if not below:
        return ""
    centre, half = space.box.mean(dim=0).tolist(), (0.5 * (space.box[1] - space.box[0])).tolist()
    said = f" At {below} poses the tool is below the base's plane (z = 0), {lowest:.0f} mm at the lowest"
    if centre[2] < 1.0:
        return f"{said}: is there room?"
    top = f"below z = {2.0 * centre[2]:.0f} mm"
    size = f"{math.ceil(half[0])},{math.ceil(half[1])},{math.floor(centre[2])}"
    return f"{said}: where that is a floor or a table, plan with --box {size}, which keeps the tool above it and {top}."
