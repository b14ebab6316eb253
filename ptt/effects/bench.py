"""Sample machines and sample runs in which every effect shows: for the contract and for pictures."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import torch

from ptt.machine import JointSpec, MachineFile, ThreePttSpec, parse_machine
from ptt.run.table import Table, make_table
from ptt.run.view import View
from ptt.run.viewing import build_view

SEED = 7
FREE = {"three-ptt": 90, "serial": 260}  # rows that go anywhere
CREEP = 48  # rows of short moves back and forth, so that there is short travel after reversals
TURN_EVERY = 8  # of these moves

_MACHINES = {
    "three-ptt": """
[machine]
kind = "three-ptt"
name = "sample 3-PTT"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
screw_lead_mm = 5
reflector_mm = [20, -10, -40]
platform_mass_kg = 1
""",
    "serial": """
[machine]
kind = "serial"
name = "sample arm"
convention = "standard"
tool_mm = [20, 0, 60]
gear_period_rad = 0.0628
joint = [
  { alpha_deg = 90, d_mm = 350, limits_deg = [-160, 160] },
  { a_mm = 400, limits_deg = [-30, 135] },
  { a_mm = 320, limits_deg = [-140, 0] },
]
""",
}
WRIST = JointSpec(alpha_deg=90.0, d_mm=80.0, limits_deg=(-120.0, 120.0))  # of a sample arm, from the fourth joint on
_MIDDLE = {"three-ptt": (0.0, 0.0, 0.0), "serial": (0.3, 0.9, -1.2)}
_HALF = {"three-ptt": (70.0, 70.0, 45.0), "serial": (0.8, 0.5, 0.6)}
_WRIST_MIDDLE, _WRIST_HALF = 0.2, 1.2  # rad, of each joint of the wrist


def sample_machine(kind: str, joints: int = 3) -> MachineFile:
    """A drawing of round figures.

    Args:
        kind: 'three-ptt' or 'serial'.
        joints: that an arm has to have; the sample has three at the least.

    Returns:
        The machine, without effects.
    """
    file = parse_machine(_MACHINES[kind], f"sample {kind}")
    if isinstance(file.machine, ThreePttSpec) or joints <= len(file.machine.joint):
        return file
    wrist = (WRIST,) * (joints - len(file.machine.joint))
    return replace(file, machine=file.machine.model_copy(update={"joint": (*file.machine.joint, *wrist)}))


@lru_cache(maxsize=4)
def sample_view(kind: str, joints: int = 3) -> View:
    """Three runs in which every context varies: free moves, short moves back and forth, free moves again.

    Args:
        kind: 'three-ptt' or 'serial'.
        joints: as of `sample_machine`.

    Returns:
        The view.
    """
    return build_view(sample_machine(kind, joints), sample_table(kind, joints))


def sample_table(kind: str, joints: int = 3) -> Table:
    """The table of `sample_view`: targets on a 3-PTT, joint commands on an arm; no readings.

    Args:
        kind: 'three-ptt' or 'serial'.
        joints: as of `sample_machine`.

    Returns:
        The table.
    """
    random = np.random.default_rng(SEED)
    wrist = max(joints - 3, 0) * (kind == "serial")
    middle = np.array([*_MIDDLE[kind], *[_WRIST_MIDDLE] * wrist])
    half = np.array([*_HALF[kind], *[_WRIST_HALF] * wrist])
    count = FREE[kind]
    free = middle + half * random.uniform(-1.0, 1.0, (count, len(middle)))
    way = np.where(np.arange(CREEP) // TURN_EVERY % 2 == 0, 1.0, -1.0)[:, None]
    step = way * half * random.uniform(0.01, 0.05, (CREEP, len(middle)))
    places = np.concatenate([free[: count // 2], middle + np.cumsum(step, axis=0), free[count // 2 :]])
    rows = len(places)
    columns = {
        "run": np.repeat([0, 1, 2], [count // 2, CREEP, count - count // 2]),
        "time_s": 25.0 * np.arange(rows),
        "payload_kg": random.choice([0.0, 2.0, 5.0], rows),
        "temp_c": 20.0 + 6.0 * (1.0 - np.exp(-np.arange(rows) / 50.0)),
        "feed_mm_s": random.choice([5.0, 20.0, 40.0], rows),
    }
    return make_table(places, **columns) if kind == "three-ptt" else make_table(None, places, **columns)


def bare(view: View) -> View:
    """The same poses without any context: no load, temperature, time or speed, and one direction of arrival.

    Args:
        view: n rows.

    Returns:
        The view without context.
    """
    nothing = torch.zeros_like(view.payload)
    ahead = torch.ones_like(view.direction)
    contexts: dict[str, Any] = {"payload": nothing, "warmth": nothing, "time": nothing, "torque": None}
    return replace(view.standing(), direction=ahead, varies=frozenset(), **contexts)
