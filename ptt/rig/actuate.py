"""From commands to slider heights without load: temperatures, controller, drives, screws."""

import numpy as np

from ptt.rig import drive, motion, odd
from ptt.rig.nominal import Array, Drawing
from ptt.rig.rig import Rig
from ptt.rig.schedule import Schedule
from ptt.rig.thermal import Temperatures, follow_temperatures
from ptt.rig.units import MM_PER_UM, PPM


def run_temperatures(rig: Rig, path: motion.Path, time: Array, run: Array, seed: int | None) -> Temperatures:
    """Temperatures of a run.

    Args:
        rig: room, time constants, friction heat.
        path: of the sliders.
        time: (n,) s from the start of the simulation.
        run: (n,) int, number of each row's run.
        seed: of the sensor's noise; None leaves it out.

    Returns:
        The temperatures.
    """
    step = np.abs(np.diff(path.slider, axis=0, prepend=path.slider[:1]))
    rows = len(time)
    travelled = np.zeros((rows, 3))
    np.add.at(travelled, path.row, step)
    # The clock knows the way to a run's first row, not that it is led in: what leads in warms no screw.
    first = np.flatnonzero(np.diff(run, prepend=run[:1] - 1))
    command = path.slider[path.last]
    travelled[first] = np.abs(command[first] - command[np.maximum(first - 1, 0)])
    sigma = rig.thermal.sensor_sigma_k
    random = np.random.default_rng([seed, 6]).normal(size=rows) if seed is not None else np.zeros(rows)
    return follow_temperatures(rig.conditions.room, rig.thermal, time, travelled, sigma * random)


def drive_sliders(
    rig: Rig,
    drawing: Drawing,
    path: motion.Path,
    time: Array,
    speed: Array,
    schedule: Schedule,
    temperatures: Temperatures,
) -> Array:
    """Slider heights without load: command, controller, play and friction, screw error, growth.

    Growth is that of the screw between its fixed end and the nut, from the machine file's reference temperature.

    Args:
        rig: controller, drives, screws.
        drawing: the ideal machine.
        path: m points of commanded heights in travel order.
        time: (n,) s from the start of the simulation.
        speed: (n, 3) mm/s, of the sliders when the rows are read.
        schedule: the rows.
        temperatures: of room, frame and screws.

    Returns:
        (n, 3) mm, heights when the rows are read.
    """
    faults, spec = rig.drive, rig.spec
    sent = path.slider + 0.5 * np.asarray(rig.controller.backlash_mm) * motion.travel_direction(path.slider)
    gap = np.asarray(faults.backlash_mm) + odd.extra_gap(rig.odd, temperatures.screw, schedule.payload)[path.row]
    nut = drive.play(sent, gap)
    lag = drive.windup(path.slider, MM_PER_UM * np.asarray(faults.windup_um), np.asarray(faults.windup_length_mm))
    lag = lag + drive.friction(
        path.slider, MM_PER_UM * np.asarray(faults.friction_um), np.asarray(faults.friction_length_mm)
    )
    nut, lag, screw = nut[path.last], lag[path.last], sent[path.last]
    lead = spec.screw_lead_mm or np.inf
    span = faults.curve_span_mm or spec.whole_travel
    error = drive.screw_error(faults, nut, screw, drawing.home, span, lead)
    error = error + _homing(rig, schedule) + _slip(rig, time)
    lag = lag - np.asarray(faults.following_s) * speed
    warming = temperatures.screw - spec.reference_temp_c
    growth = PPM * np.asarray(rig.thermal.growth_um_per_m_k) * warming * (nut - np.asarray(rig.thermal.fixed_end_mm))
    return nut + error + lag + growth


def _homing(rig: Rig, schedule: Schedule) -> Array:
    """Offsets of homing, (n, 3) mm: each run is homed anew, the same way in every repetition of the rig."""
    random = np.random.default_rng([rig.seed, 7])
    return rig.drive.homing_scatter_mm * random.normal(size=(schedule.runs, 3))[schedule.run]


def _slip(rig: Rig, time: Array) -> Array:
    """Zero points lost for good from a row or time on, (n, 3) mm: a slipped clamp, a hit slider, a second homing."""
    drive = rig.drive
    if drive.slip_row is not None:
        after = np.arange(len(time)) >= drive.slip_row
    elif drive.slip_time_s is not None:
        after = time - time[0] >= drive.slip_time_s
    else:
        after = np.zeros(len(time), dtype=bool)
    return np.outer(after, drive.slip_mm)
