"""The state of an arm row by row, on which faults outside the library depend."""

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.arm_faults import tool_on_drawing
from ptt.rig.arm_odd import ArmState
from ptt.rig.arm_travel import arm_path
from ptt.rig.motion import travel_direction
from ptt.rig.nominal import Array
from ptt.rig.schedule import Schedule
from ptt.rig.units import GRAVITY

NUDGE = 1e-5  # rad, step of the numerical derivative of the tool's place


def state_of_arm(spec: SerialSpec, schedule: Schedule, temperature: Array, time: Array) -> ArmState:
    """The state of a run.

    Args:
        spec: the drawing.
        schedule: the rows.
        temperature: (n,) degrees Celsius, of the room.
        time: (n,) s from the start of the simulation.

    Returns:
        The state.
    """
    q, path = schedule.command, arm_path(schedule.command, schedule.run)
    direction = travel_direction(path.slider)
    turned = np.diff(direction, axis=0, prepend=direction[:1]) * direction != 0
    turned[1:] &= direction[:-1] != 0  # the first move is no reversal
    step = np.abs(np.diff(q, axis=0, prepend=q[:1]))
    down = np.asarray(spec.gravity) / np.linalg.norm(spec.gravity)
    return ArmState(
        q=q,
        direction=direction[path.last],
        step=step,
        reversals=np.cumsum(turned, axis=0)[path.last].astype(float),
        lever=GRAVITY * np.einsum("nxj,x->nj", tool_jacobian(spec, q), down),
        tool=tool_on_drawing(spec, q),
        down=down,
        payload=schedule.payload,
        temperature=temperature,
        time=time - time[0],
    )


def tool_jacobian(spec: SerialSpec, q: Array) -> Array:
    """Jacobian dp/dq of the drawing's tool point, by central differences.

    Args:
        spec: the drawing.
        q: (n, k) rad.

    Returns:
        (n, 3, k) mm/rad, base frame.
    """
    steps = NUDGE * np.eye(q.shape[1])
    sides = [tool_on_drawing(spec, q + step) - tool_on_drawing(spec, q - step) for step in steps]
    return np.stack(sides, axis=-1) / (2.0 * NUDGE)
