"""The variable that tells an effect, of a run: height, place on the screw, way of arrival, load, time and the like."""

import numpy as np
import torch

from ptt.effects.geometry import machine, pull
from ptt.run.problem import Problem


def telling_of(name: str, joint: int, problem: Problem, contexts: dict[str, np.ndarray]) -> tuple[np.ndarray, str]:
    """Values of a telling variable for one joint.

    Args:
        name: as an effect's card names it.
        joint: number of the joint, from 0.
        problem: n rows.
        contexts: of the run, as `context_views` gives them.

    Returns:
        (n,) values and the label of an axis; the reading number where the run does not have the variable.
    """
    view, serial = problem.view, problem.file.machine.kind == "serial"
    who = f"{problem.file.machine.noun} {joint + 1}"
    if name in ("x", "y", "z"):
        return view.p[:, "xyz".index(name)].numpy(), f"{name} [mm]"
    if name == "radius":
        return view.p[:, :2].norm(dim=1).numpy(), "distance from the middle [mm]"
    if name == "b":
        return view.q[:, joint].numpy(), f"angle of {who} [rad]" if serial else f"height of {who} [mm]"
    if name == "phase" and view.lead:
        turn = torch.remainder(view.q[:, joint], view.lead)
        return turn.numpy(), f"place within one turn of screw {joint + 1} [mm]"
    if name == "direction":
        return view.direction[:, joint].numpy(), f"way in which {who} arrives"
    if name == "travel":
        way = _since_reversal(view.q[:, joint].numpy(), view.starts.numpy())
        return way, f"travel of {who} since it turned [{'rad' if serial else 'mm'}]"
    if name == "speed":
        return view.velocity[:, joint].numpy(), f"speed of {who} [{'rad/s' if serial else 'mm/s'}]"
    if name == "load":
        return view.axis_force()[:, joint].numpy(), f"force on {who} [{'N mm' if serial else 'N'}]"
    if name == "payload":
        return view.payload.numpy(), "payload [kg]"
    if name == "temperature":
        return view.warmth.numpy(), "warmth above reference [K]"
    if name == "link force" and not serial:
        return pull(view)[:, joint].numpy(), f"force in link {joint + 1} [N]"
    if name == "link angle" and not serial:
        own = machine(view)
        link = own.link_vectors(view.p)[:, joint]
        angle = torch.acos((link @ own.rail[joint]).abs() / link.norm(dim=-1))
        return torch.rad2deg(angle).numpy(), f"angle of link {joint + 1} to its rail [deg]"
    if name == "time" and "time" in contexts:
        return contexts["time"], "time [s]"
    return np.arange(view.rows, dtype=float), "reading number"


def _since_reversal(q: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Travel of a joint since it last turned; NaN on the first row of a run."""
    step = np.diff(q, prepend=q[:1])
    gone, before, travel = 0.0, 0.0, np.full(len(q), np.nan)
    for row in range(len(q)):
        if starts[row]:
            gone, before = 0.0, 0.0
            continue
        way = np.sign(step[row]) or before
        gone = abs(step[row]) + (gone if way == before else 0.0)
        before, travel[row] = way, gone
    return travel
