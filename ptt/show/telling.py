"""Telling variables of effects: the variable, named on an effect's card, against which its residual shows a pattern."""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from ptt.effects.geometry import machine, tension
from ptt.effects.layout import family
from ptt.run.direction import STANDSTILL
from ptt.run.view import View

READING = "reading number"  # label of the substitute where the run does not have the variable


def telling_of(name: str, view: View, joint: int) -> tuple[np.ndarray, str]:
    """Values of a telling variable for one joint, with the label of their axis.

    Args:
        name: of the variable, as on an effect's card, one of `VARIABLES`.
        view: n rows.
        joint: number of the joint, from 0.

    Returns:
        Values (n,) in the unit of the label, and the label; reading numbers where the run does not have the variable.
    """
    values, *labels = VARIABLES.get(name, (None, "", ""))
    label = labels[family(view) == "serial"].format(n=joint + 1)
    lacking = (name == "phase" and not view.lead) or (name == "time" and "time" not in view.varies)
    if values is None or lacking or not label:
        return view.row_numbers.numpy(), READING
    return values(view, joint).numpy(), label


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
    """Angle of a link to its rail, deg."""
    own = machine(view)
    link = own.link_vectors(view.p)[:, joint]
    return torch.rad2deg(torch.acos((link @ own.rail[joint]).abs() / link.norm(dim=-1)))


# Values, and their label for a 3-PTT and for a serial arm, '' where that family does not have the variable; {n} is the
# number of the joint. 'phase' is the distance into a turn.
VARIABLES: dict[str, tuple[Callable[[View, int], Tensor], str, str]] = {
    "x": (lambda view, joint: view.p[:, 0], "x [mm]", "x [mm]"),
    "y": (lambda view, joint: view.p[:, 1], "y [mm]", "y [mm]"),
    "z": (lambda view, joint: view.p[:, 2], "z [mm]", "z [mm]"),
    "radius": (
        lambda view, joint: view.p[:, :2].norm(dim=1),
        "distance from the middle [mm]", "distance from the middle [mm]",
    ),
    "b": (lambda view, joint: view.q[:, joint], "height of slider {n} [mm]", "angle of joint {n} [rad]"),
    "phase": (
        lambda view, joint: torch.remainder(view.q[:, joint], view.lead or 1.0),
        "place within one turn of screw {n} [mm]", "angle of joint {n} within one gear period [rad]",
    ),
    "direction": (
        lambda view, joint: view.direction[:, joint],
        "way in which slider {n} arrives", "way in which joint {n} arrives",
    ),
    "travel": (
        travel_since_reversal, "travel of slider {n} since it turned [mm]", "travel of joint {n} since it turned [rad]",
    ),
    "speed": (lambda view, joint: view.velocity[:, joint], "speed of slider {n} [mm/s]", "speed of joint {n} [rad/s]"),
    "load": (lambda view, joint: view.axis_force()[:, joint], "force on slider {n} [N]", "torque on joint {n} [N mm]"),
    "payload": (lambda view, joint: view.payload, "payload [kg]", "payload [kg]"),
    "temperature": (lambda view, joint: view.warmth, "warmth above reference [K]", "warmth above reference [K]"),
    "time": (lambda view, joint: view.time, "time [s]", "time [s]"),
    "link force": (lambda view, joint: tension(view)[:, joint], "force in link {n} [N]", ""),
    "link angle": (_link_angle, "angle of link {n} to its rail [deg]", ""),
}  # fmt: skip
