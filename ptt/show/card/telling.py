"""Telling variables of effects (`ptt.show.telling`) with labels for axes."""

import numpy as np

from ptt.run.problem import Problem
from ptt.show.telling import telling_values

READING = "reading number"  # label of the substitute where the run does not have the variable
# For a 3-PTT and for a serial arm; '' where that family does not have the variable. {n} is the number of the joint.
LABELS: dict[str, tuple[str, str]] = {
    **{axis: (f"{axis} [mm]", f"{axis} [mm]") for axis in "xyz"},
    "radius": ("distance from the middle [mm]", "distance from the middle [mm]"),
    "b": ("height of slider {n} [mm]", "angle of joint {n} [rad]"),
    "phase": ("place within one turn of screw {n} [mm]", "angle of joint {n} within one gear period [rad]"),
    "direction": ("way in which slider {n} arrives", "way in which joint {n} arrives"),
    "travel": ("travel of slider {n} since it turned [mm]", "travel of joint {n} since it turned [rad]"),
    "speed": ("speed of slider {n} [mm/s]", "speed of joint {n} [rad/s]"),
    "load": ("force on slider {n} [N]", "torque on joint {n} [N mm]"),
    "payload": ("payload [kg]", "payload [kg]"),
    "temperature": ("warmth above reference [K]", "warmth above reference [K]"),
    "time": ("time [s]", "time [s]"),
    "link force": ("force in link {n} [N]", ""),
    "link angle": ("angle of link {n} to its rail [deg]", ""),
}


def telling_of(name: str, joint: int, problem: Problem) -> tuple[np.ndarray, str]:
    """Values of a telling variable for one joint, with the label of their axis.

    Args:
        name: of the variable, as on an effect's card.
        joint: number of the joint, from 0.
        problem: n rows.

    Returns:
        Values (n,) in the unit of the label, and the label; reading numbers where the run does not have the variable.
    """
    view = problem.view
    label = LABELS.get(name, ("", ""))[problem.file.machine.kind == "serial"].format(n=joint + 1)
    lacking = (name == "phase" and not view.lead) or (name == "time" and "time" not in view.varies)
    if lacking or not label:
        return view.row_numbers.numpy(), READING
    values = telling_values(name, view, joint).numpy()
    return (np.degrees(values) if name == "link angle" else values), label
