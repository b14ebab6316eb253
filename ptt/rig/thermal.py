"""Temperatures of room, frame and screws, each behind its cause."""

from dataclasses import dataclass

import numpy as np

from ptt.rig.nominal import Array
from ptt.rig.schema import Room, Thermal


@dataclass(frozen=True)
class Warmth:
    """Temperatures at every row, in degrees Celsius.

    Attributes:
        room: (n,).
        frame: (n,).
        screw: (n, 3).
        sensor: (n,), what the column temp_c says.
    """

    room: Array
    frame: Array
    screw: Array
    sensor: Array


def warm_up(room: Room, faults: Thermal, time: Array, travelled: Array, noise: Array) -> Warmth:
    """Follow the temperatures through a run that begins in balance with the room.

    Source: first-order lag, lag dT/dt = cause - T, exact for a cause that is constant between two rows; the room counts
    with its temperature halfway. A screw's cause is the room plus the heat of its duty, proportional to its mean speed.

    Args:
        room: course of the room's temperature.
        faults: lags, heat of duty, which sensor.
        time: (n,) s.
        travelled: (n, 3) mm, way of each slider since the row before.
        noise: (n,) K, of the sensor.

    Returns:
        The temperatures.
    """
    air = room_temperature(room, time)
    step = np.diff(time, prepend=0.0)
    duty = faults.duty_k_s_per_mm * travelled / np.maximum(step, 1e-9)[:, None]
    between = room_temperature(room, time - 0.5 * step)[:, None]
    frame = lag(between, step, faults.frame_lag_s, room.start_c)[:, 0] if faults.frame_lag_s else air
    screw = lag((between if faults.screw_lag_s else air[:, None]) + duty, step, faults.screw_lag_s, room.start_c)
    sensors = {"room": air, "frame": frame, "screw": screw.mean(1)}
    sensors |= {f"screw {leg + 1}": screw[:, leg] for leg in range(3)}
    return Warmth(air, frame, screw, sensors[faults.sensor] + noise)


def room_temperature(room: Room, time: Array) -> Array:
    """The room's temperature.

    Args:
        room: start, rise, swing.
        time: (n,) s.

    Returns:
        (n,) degrees Celsius.
    """
    rise = room.rise_k * -np.expm1(-time / room.time_constant_s)
    return room.start_c + rise + room.swing_k * np.sin(2.0 * np.pi * time / room.swing_period_s)


def lag(cause: Array, step: Array, constant: float, start: float) -> Array:
    """First-order lag behind a cause.

    Args:
        cause: (n, k).
        step: (n,) s since the row before.
        constant: s; zero follows at once.
        start: state before the first row.

    Returns:
        (n, k).
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
