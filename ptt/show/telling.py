"""Telling variables of effects: the variable, named on an effect's card, against which its residual shows a pattern."""

from collections.abc import Callable

import torch
from torch import Tensor

from ptt.effects.geometry import machine, tension
from ptt.run.direction import STANDSTILL
from ptt.run.view import View


def telling_values(name: str, view: View, joint: int) -> Tensor:
    """Values of a telling variable along a run.

    Args:
        name: one of `ptt.effects.card.TELLING`.
        view: n rows; of a 3-PTT for 'link force' and 'link angle', with a screw lead or gear period for 'phase'.
        joint: number of the joint, from 0; ignored where the variable belongs to none.

    Returns:
        (n,) in mm, rad, s, K, kg, N or N mm; 'phase' as the distance into a turn, in the joint's unit.
    """
    return VARIABLES[name](view, joint)


def travel_since_reversal(view: View, joint: int) -> Tensor:
    """How far a joint has moved since it last reversed, whether between two rows or at one.

    Args:
        view: n rows.
        joint: from 0.

    Returns:
        (n,) mm or rad; NaN on the first row of a run, before which the travel is unknown.
    """
    q, way = view.q[:, joint], view.direction[:, joint]
    before = (q - view.turning_point[:, joint]).abs()
    between = before > STANDSTILL
    step = torch.where(between, before, q.diff(prepend=q[:1]).abs())
    step = torch.where(view.starts, torch.zeros_like(step), step)
    turned = view.starts | between | (way != torch.cat([way[:1], way[:-1]]))
    rows = torch.arange(view.rows)
    last = torch.where(turned, rows, torch.zeros_like(rows)).cummax(dim=0).values
    whole = step.cumsum(dim=0)
    travel = whole - (whole - step)[last]
    return torch.where(view.starts, torch.nan, travel)


def _link_angle(view: View, joint: int) -> Tensor:
    """Angle of a link to its rail, rad."""
    own = machine(view)
    link = own.link_vectors(view.p)[:, joint]
    return torch.acos((link @ own.rail[joint]).abs() / link.norm(dim=-1))


VARIABLES: dict[str, Callable[[View, int], Tensor]] = {
    "x": lambda view, joint: view.p[:, 0],
    "y": lambda view, joint: view.p[:, 1],
    "z": lambda view, joint: view.p[:, 2],
    "radius": lambda view, joint: view.p[:, :2].norm(dim=1),
    "b": lambda view, joint: view.q[:, joint],
    "phase": lambda view, joint: torch.remainder(view.q[:, joint], view.lead or 1.0),
    "direction": lambda view, joint: view.direction[:, joint],
    "travel": travel_since_reversal,
    "speed": lambda view, joint: view.velocity[:, joint],
    "load": lambda view, joint: view.axis_force()[:, joint],
    "payload": lambda view, joint: view.payload,
    "temperature": lambda view, joint: view.warmth,
    "time": lambda view, joint: view.time,
    "link force": lambda view, joint: tension(view)[:, joint],
    "link angle": _link_angle,
}
