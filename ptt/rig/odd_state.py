"""The state of a run row by row, on which faults outside the library depend."""

from dataclasses import dataclass

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.arm_faults import tool_jacobian, tool_on_drawing
from ptt.rig.motion import Path, joint_path, travel_direction
from ptt.rig.nominal import Array, Drawing
from ptt.rig.schedule import Schedule
from ptt.rig.thermal import Temperatures, lag
from ptt.rig.units import GRAVITY


@dataclass(frozen=True)
class RunState:
    """A run, row by row.

    Attributes:
        joint: (n, k) mm or rad, heights of the sliders or commands of an arm's joints.
        tool: (n, 3) mm, commanded.
        direction: (n, k), direction of arrival, +1 or -1; 0 before the first move.
        step: (n, k) mm or rad, path length of each joint since the row before.
        reversals: (n, k), number of reversals of each joint so far.
        speed: (n, k) mm/s or rad/s, when the row is read.
        payload: (n,) kg.
        temperature: (n,) degrees Celsius, of the frame; of the room about an arm.
        time: (n,) s from the first row.
    """

    joint: Array
    tool: Array
    direction: Array
    step: Array
    reversals: Array
    speed: Array
    payload: Array
    temperature: Array
    time: Array

    @property
    def meanwhile(self) -> Array:
        """Temperature between two rows for what lags behind it, (n,) degrees Celsius: a frame's, which lags itself."""
        return self.temperature


@dataclass(frozen=True)
class SliderState(RunState):
    """A run of a 3-PTT, row by row.

    Attributes:
        drawing: the ideal machine.
        platform: kg, mass of the platform.
    """

    drawing: Drawing
    platform: float


@dataclass(frozen=True)
class ArmState(RunState):
    """A run of an arm, row by row.

    Attributes:
        lever: (n, k) N mm/kg, torque of gravity about each joint for each kg at the tool.
        down: (3,), direction of gravity in the base frame.
    """

    lever: Array
    down: Array

    @property
    def meanwhile(self) -> Array:
        """The room's temperature halfway between two rows, (n,) degrees Celsius."""
        return self.temperature - 0.5 * np.diff(self.temperature, prepend=self.temperature[:1])


def state_of_run(
    drawing: Drawing,
    path: Path,
    schedule: Schedule,
    temperatures: Temperatures,
    *,
    slider: Array,
    tool: Array,
    speed: Array,
    time: Array,
    platform: float,
) -> SliderState:
    """The state of a run of a 3-PTT.

    Args:
        drawing: the ideal machine.
        path: of the commanded sliders.
        schedule: the rows.
        temperatures: of room, frame and screws.
        slider: (n, 3) mm, heights without load.
        tool: (n, 3) mm, commanded.
        speed: (n, 3) mm/s.
        time: (n,) s from the start of the simulation.
        platform: kg, mass of the platform.

    Returns:
        The state.
    """
    direction, reversals = _arrivals(path)
    step = np.zeros_like(tool)
    np.add.at(step, path.row, np.abs(np.diff(path.slider, axis=0, prepend=path.slider[:1])))
    return SliderState(
        joint=slider,
        tool=tool,
        direction=direction,
        step=step,
        reversals=reversals,
        speed=speed,
        payload=schedule.payload,
        temperature=temperatures.frame,
        time=time - time[0],
        drawing=drawing,
        platform=platform,
    )


def state_of_arm(spec: SerialSpec, schedule: Schedule, temperature: Array, time: Array) -> ArmState:
    """The state of a run of an arm.

    Args:
        spec: the drawing.
        schedule: the rows.
        temperature: (n,) degrees Celsius, of the room.
        time: (n,) s from the start of the simulation.

    Returns:
        The state.
    """
    q = schedule.command
    direction, reversals = _arrivals(joint_path(q, schedule.run))
    down = np.asarray(spec.gravity) / np.linalg.norm(spec.gravity)
    return ArmState(
        joint=q,
        tool=tool_on_drawing(spec, q),
        direction=direction,
        step=np.abs(np.diff(q, axis=0, prepend=q[:1])),
        reversals=reversals,
        speed=np.zeros_like(q),
        payload=schedule.payload,
        temperature=temperature,
        time=time - time[0],
        lever=GRAVITY * np.einsum("nxj,x->nj", tool_jacobian(spec, q), down),
        down=down,
    )


def memory_of_warmth(state: RunState, constant_s: float) -> Array:
    """Temperature of what takes on warmth slowly, (n,) degrees Celsius, by its time constant."""
    step = np.diff(state.time, prepend=0.0)
    return lag(state.meanwhile[:, None], step, constant_s, float(state.temperature[0]))[:, 0]


def heat_of_work(state: RunState, joint: int, constant_s: float) -> Array:
    """Mean speed of a joint lately, (n,) mm/s or rad/s, as a motor that keeps its heat for a time constant has it."""
    step = np.diff(state.time, prepend=0.0)
    speed = state.step[:, joint] / np.maximum(step, 1e-3)
    speed[0] = 0.0
    return lag(speed[:, None], step, constant_s, 0.0)[:, 0]


def _arrivals(path: Path) -> tuple[Array, Array]:
    """Direction of arrival at each row, +1 or -1, and number of reversals so far, (n, k) each."""
    direction = travel_direction(path.slider)
    turned = np.diff(direction, axis=0, prepend=direction[:1]) * direction != 0
    turned[1:] &= direction[:-1] != 0  # the first move is no reversal
    return direction[path.last], np.cumsum(turned, axis=0)[path.last].astype(float)
