"""Temperatures of room, frame and screws; frame and screws lag behind their causes."""

from dataclasses import dataclass

import numpy as np

from ptt.rig.nominal import Array
from ptt.rig.schema import Room, Thermal


@dataclass(frozen=True)
class Temperatures:
    """Temperatures at every row of a run, in degrees Celsius.

    Attributes:
        room: (n,), air.
        frame: (n,).
        screw: (n, 3), each screw.
        sensor: (n,), the column temp_c.
    """

    room: Array
    frame: Array
    screw: Array
    sensor: Array


def follow_temperatures(room: Room, faults: Thermal, time: Array, travelled: Array, noise: Array) -> Temperatures:
    """Integrate the temperatures over a run that begins with frame and screws at the room's start temperature.

    Source: first-order lag, time constant dT/dt = cause - T, exact for a cause that is constant between two rows (the
    room counts with its temperature halfway). The cause of a screw is the room plus friction heat, proportional to the
    screw's mean speed since the row before.

    Args:
        room: course of the room's temperature.
        faults: time constants, friction heat, which sensor.
        time: (n,) s from the start of the simulation.
        travelled: (n, 3) mm, path length of each slider since the row before.
        noise: (n,) K, of the sensor.

    Returns:
        The temperatures.
    """
    air = room_temperature(room, time)
    step = np.diff(time, prepend=0.0)
    heat = faults.duty_k_s_per_mm * travelled / np.maximum(step, 1e-9)[:, None]  # K
    between = room_temperature(room, time - 0.5 * step)[:, None]
    frame = lag(between, step, faults.frame_lag_s, room.start_c)[:, 0] if faults.frame_lag_s else air
    screw = lag((between if faults.screw_lag_s else air[:, None]) + heat, step, faults.screw_lag_s, room.start_c)
    sensors = {"room": air, "frame": frame, "screw": screw.mean(1)}
    sensors |= {f"screw {leg + 1}": screw[:, leg] for leg in range(3)}
    return Temperatures(air, frame, screw, sensors[faults.sensor] + noise)


def room_temperature(room: Room, time: Array) -> Array:
    """Temperature of the room: start, exponential rise and sinusoidal swing.

    Args:
        room: its parameters.
        time: (n,) s from the start of the simulation.

    Returns:
        (n,) degrees Celsius.
    """
    rise = room.rise_k * -np.expm1(-time / room.time_constant_s)
    return room.start_c + rise + room.swing_k * np.sin(2.0 * np.pi * time / room.swing_period_s)


def lag(cause: Array, step: Array, constant: float, start: float) -> Array:
    """First-order lag behind a cause that is constant between two rows.

    Args:
        cause: (n, k), of the interval that ends at each row.
        step: (n,) s, length of that interval.
        constant: time constant, s; 0 follows at once.
        start: state before the first row.

    Returns:
        (n, k), in the unit of the cause.
    """
    if constant == 0.0:
        return cause.copy()
    gain = -np.expm1(-step / constant)
    out = np.empty_like(cause)
    state = np.full(cause.shape[1], start)
    for number in range(len(cause)):
        state = state + gain[number] * (cause[number] - state)
        out[number] = state
    return out
