"""The state of a 3-PTT row by row, on which faults outside the library depend."""

from dataclasses import dataclass

import numpy as np

from ptt.rig import motion
from ptt.rig.nominal import Array, Drawing
from ptt.rig.schedule import Schedule
from ptt.rig.thermal import Temperatures


@dataclass(frozen=True)
class RunState:
    """A run, row by row.

    Attributes:
        drawing: the ideal machine.
        slider: (n, 3) mm, heights.
        tool: (n, 3) mm, commanded.
        direction: (n, 3), direction of arrival, +1 or -1; 0 before the first move.
        step: (n, 3) mm, path length of each slider since the row before.
        reversals: (n, 3), number of reversals of each slider so far.
        speed: (n, 3) mm/s, when the row is read.
        payload: (n,) kg.
        platform: kg, mass of the platform.
        temperature: (n,) degrees Celsius, of the frame.
        time: (n,) s from the first row.
    """

    drawing: Drawing
    slider: Array
    tool: Array
    direction: Array
    step: Array
    reversals: Array
    speed: Array
    payload: Array
    platform: float
    temperature: Array
    time: Array


def state_of_run(
    drawing: Drawing,
    path: motion.Path,
    schedule: Schedule,
    temperatures: Temperatures,
    *,
    slider: Array,
    tool: Array,
    speed: Array,
    time: Array,
    platform: float,
) -> RunState:
    """The state of a run.

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
    direction = motion.travel_direction(path.slider)
    turned = np.diff(direction, axis=0, prepend=direction[:1]) * (direction != 0) != 0
    turned[1:] &= direction[:-1] != 0  # the first move is no reversal
    step = np.zeros_like(tool)
    np.add.at(step, path.row, np.abs(np.diff(path.slider, axis=0, prepend=path.slider[:1])))
    return RunState(
        drawing=drawing,
        slider=slider,
        tool=tool,
        direction=direction[path.last],
        step=step,
        reversals=np.cumsum(turned, axis=0)[path.last].astype(float),
        speed=speed,
        payload=schedule.payload,
        platform=platform,
        temperature=temperatures.frame,
        time=time - time[0],
    )
