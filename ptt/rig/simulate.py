"""A simulated run: from commands in the order of travel to true positions and tracker readings."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from ptt.errors import InputError, WorkspaceError
from ptt.files import write_parts
from ptt.machine import SerialSpec
from ptt.rig import motion, odd, tracker
from ptt.rig.actuate import drive_sliders, run_temperatures
from ptt.rig.arm_faults import arm_faults, slipped, tool_on_drawing, within_limits
from ptt.rig.arm_odd import shift_arm
from ptt.rig.loaded import load_platform, nominal_tool
from ptt.rig.nominal import Array, Drawing, ideal_machine, nominal_sliders
from ptt.rig.odd_state import state_of_arm, state_of_run
from ptt.rig.platform import reflector_shift, small_rotation
from ptt.rig.rig import Rig
from ptt.rig.schedule import HOLD, TARGET, Schedule, plan_rows, reading_times
from ptt.rig.serial_arm import ArmRig
from ptt.rig.thermal import room_temperature

PART = 50_000  # rows that are in memory as text at once
STAY_INSIDE = "stay inside the workspace of the machine"
MOST_ROWS = 20_000_000  # of one run: a year of readings, one a second and a half


@dataclass(frozen=True)
class RunResult:
    """A simulated run.

    Attributes:
        frame: the tracker CSV as a table, n rows in travel order.
        truth: (n, 3) mm, base frame, true position of the tool: of the reflector less its offset on the drawing, which
            tracker software takes off; of the reflector itself in rows of base reflectors.
        slider_actual: (n, k) mm or rad, true slider heights or joint values under load, without what faults of [[odd]]
            shift a slider by.
        rotation: (n, 3) rad, small parasitic rotation of the platform; zero for an arm.
        force: (n, 3) N, force of each link on its slider along the rail, positive upwards; (n, 0) for an arm.
        screw_temp: (n, 3) degrees Celsius; (n, 0) for an arm.
        outlier: (n,) bool, grossly wrong readings.
    """

    frame: pd.DataFrame
    truth: Array
    slider_actual: Array
    rotation: Array
    force: Array
    screw_temp: Array
    outlier: Array


def simulate(
    rig: Rig,
    commands: pd.DataFrame,
    *,
    sliders: pd.DataFrame | None = None,
    noise: bool = True,
    seed: int | None = None,
) -> RunResult:
    """Run the virtual machine through commands sent in order.

    Args:
        rig: the machine, its faults, the conditions.
        commands: n targets, columns x_cmd, y_cmd, z_cmd and/or b1_cmd, b2_cmd, b3_cmd (of an arm always q1_cmd_rad..),
            optionally name, role, payload_kg, feed_mm_s, read (0: passed without a reading); others are left aside.
        sliders: columns b1, b2, b3 (mm; of an arm q1.., rad) to send instead of the controller's own, in the order of
            `commands` (every cycle alike) or of all cycles; the targets stay.
        noise: False leaves out the noise of tracker and temperature sensor, lost readings, rounding and the errors of
            the base reflectors' coordinates. What is random from run to run (homing, set-up, mount) stays.
        seed: of that noise; None takes the rig's own. The machine and its set-ups follow the rig's seed alone.

    Returns:
        The run.

    Raises:
        InputError: more rows than a run may have.
        TableError: columns missing, sliders of another length, cells that are no numbers, an unknown base reflector.
        WorkspaceError: targets or commands out of reach.
    """
    _require_rows(rig, len(commands))
    run_seed = rig.seed if seed is None else seed
    if rig.serial is not None:
        return _simulate_arm(rig, rig.serial, commands, sliders, noise=noise, seed=run_seed)
    drawing = ideal_machine(rig.spec)
    schedule = plan_rows(rig, commands, sliders)
    tool, command = _commanded(rig, drawing, schedule)
    time = reading_times(rig, schedule, tool)
    straight = rig.spec.moves == "straight"
    path = motion.run_path(drawing, tool, command, schedule.run, straight=straight, lead_in=rig.conditions.lead_in_mm)
    temperatures = run_temperatures(rig, path, time, schedule.run, run_seed if noise else None)
    still = (schedule.role != "pose") | (not rig.conditions.moving)
    ends = motion.end_slopes(drawing, tool, command) if straight else None
    speed = motion.slider_speed(command, tool, time, still, schedule.run, ends)
    slider = drive_sliders(rig, drawing, path, time, speed, schedule, temperatures)
    mass = rig.spec.platform_mass_kg
    state = state_of_run(
        drawing, path, schedule, temperatures, slider=slider, tool=tool, speed=speed, time=time, platform=mass
    )
    pose, slider, force = load_platform(rig, drawing, schedule, temperatures, slider, tool, state)
    shifts = odd.odd_shifts(rig.odd, replace(state, joint=slider))
    truth = pose.position + reflector_shift(pose, np.asarray(rig.spec.reflector_mm)) + shifts.tool
    truth = _with_base(rig, schedule, truth, exact=not noise)
    reading = tracker.read_points(
        rig.tracker, truth + shifts.sight, time, schedule.run, seed=run_seed, setup_seed=rig.seed, noise=noise
    )
    groups = [(TARGET, schedule.target), (rig.commanded, command)]
    if rig.conditions.report_direction:
        groups.append((["dir1", "dir2", "dir3"], motion.travel_direction(path.slider)[path.last]))
    if rig.conditions.report_force:
        groups.append((["tau1", "tau2", "tau3"], force))
    measured = np.where(schedule.read[:, None], reading.measured, np.nan)
    groups.append((["x_meas", "y_meas", "z_meas"], measured))
    if rig.tracker.report_std:
        groups.append((["x_std", "y_std", "z_std"], reading.std))
    frame = _tabulate(rig, schedule, time, temperatures.sensor, groups)
    return RunResult(frame, truth, slider, small_rotation(pose), force, temperatures.screw, reading.outlier)


def _simulate_arm(
    rig: Rig, spec: SerialSpec, commands: pd.DataFrame, sliders: pd.DataFrame | None, *, noise: bool, seed: int
) -> RunResult:
    """The same for a serial arm: joints, loads and growth by `serial_arm`, rows and readings by the same modules."""
    schedule = plan_rows(rig, commands, sliders)
    asked = schedule if sliders is None else plan_rows(rig, commands, None)
    names = ", ".join(rig.commanded)
    what = f"has no {names}: an arm reaches a place in many postures"
    _refuse(rig, schedule, np.isfinite(asked.command), what, f"fill in {names}")
    for sent in (asked, schedule):
        _refuse(rig, sent, within_limits(spec, sent.command), "takes a joint out of its limits")
    untold = ~np.isfinite(schedule.target).all(1)
    tool = np.where(untold[:, None], tool_on_drawing(spec, asked.command), schedule.target)
    time = reading_times(rig, schedule, tool)
    air = room_temperature(rig.conditions.room, time)
    arm = ArmRig(spec, arm_faults(rig.arm, spec), np.asarray(rig.arm.reflector_mm), np.eye(4), 0.0)
    shifts = shift_arm(rig.odd, state_of_arm(spec, schedule, air, time))
    shifts.joint[:] += slipped(rig.arm, spec.joints, schedule.rows)
    joint, frame = arm.settle(schedule.command, schedule.payload, air, shifts, schedule.run)
    # The mount is put on again for each run, never quite in the same place.
    mounts = rig.arm.reflector_scatter_mm * np.random.default_rng([rig.seed, 9]).normal(size=(schedule.runs, 3))
    mounted = arm.tip(frame) + np.einsum("nij,nj->ni", frame[:, :3, :3], mounts[schedule.run])
    truth, reflector = (_with_base(rig, schedule, points, exact=not noise) for points in (arm.tool(frame), mounted))
    reading = tracker.read_points(
        rig.tracker, reflector + shifts.sight, time, schedule.run, seed=seed, setup_seed=rig.seed, noise=noise
    )
    measured = np.where(schedule.read[:, None], reading.measured, np.nan)
    groups = [(TARGET, tool), (rig.commanded, schedule.command), (["x_meas", "y_meas", "z_meas"], measured)]
    if rig.tracker.report_std:
        groups.append((["x_std", "y_std", "z_std"], reading.std))
    table, none = _tabulate(rig, schedule, time, air, groups), np.zeros((schedule.rows, 0))
    return RunResult(table, truth, joint, np.zeros((schedule.rows, 3)), none, none, reading.outlier)


def write_run(frame: pd.DataFrame, path: str | Path) -> None:
    """Write a run as tracker CSV, whole or not at all; its floats read back exactly.

    Args:
        frame: of a `RunResult`.
        path: of the file.
    """
    parts = range(0, max(len(frame), 1), PART)
    write_parts(path, (_text(frame[first : first + PART], first == 0) for first in parts))


def _text(frame: pd.DataFrame, titles: bool) -> bytes:
    """Rows as CSV, with or without the line of titles."""
    return frame.to_csv(index=False, header=titles, lineterminator="\n").encode()


def _require_rows(rig: Rig, targets: int) -> None:
    """Refuse a run that does not fit into memory, before an hour is spent on it."""
    rows = targets * rig.conditions.cycles
    if rows > MOST_ROWS:
        what = f"{rig.conditions.cycles} cycles of {targets} targets are {rows:.0f} rows, more than {MOST_ROWS}"
        raise InputError(what, where=f"{rig.source} key conditions.cycles", fix="take fewer")


def _commanded(rig: Rig, drawing: Drawing, schedule: Schedule) -> tuple[Array, Array]:
    """Tool position and slider heights that are commanded, (n, 3) mm each."""
    computed = ~np.isfinite(schedule.command).all(1)
    command = np.where(computed[:, None], nominal_sliders(drawing, schedule.target), schedule.command)
    _refuse(rig, schedule, np.isfinite(command), "is out of reach")
    low, high = np.transpose(rig.spec.travel_ends)
    inside = (command >= low) & (command <= high)
    ends = ", ".join(f"{low:g} to {high:g}" for low, high in dict.fromkeys(rig.spec.travel_ends))
    _refuse(rig, schedule, inside, f"takes a slider out of its travel, {ends} mm")
    tool = schedule.target.copy()
    untold = ~np.isfinite(tool).all(1)
    if untold.any():
        tool[untold] = nominal_tool(drawing, command[untold])
    return tool, command


def _refuse(rig: Rig, schedule: Schedule, good: Array, what: str, fix: str = STAY_INSIDE) -> None:
    """Refuse rows of the targets for which a joint is not `good` (n, k)."""
    lost = np.unique(schedule.origin[~good.all(axis=1)])
    rows = lost[lost != HOLD]  # base reflectors are read from a pose of another row
    if len(rows):
        more = f" (the first of {len(rows)} such rows)" if len(rows) > 1 else ""
        place = f"row {rows[0] + 1} of the targets" if rows[0] >= 0 else "the datum pose"
        raise WorkspaceError(
            f"{place} {what}{more}",
            rows[rows >= 0].tolist(),
            where=rig.source,
            fix=fix,
        )


def _with_base(rig: Rig, schedule: Schedule, tool: Array, *, exact: bool) -> Array:
    """Measured points, (n, 3) mm: the tool, and in the rows of base reflectors these."""
    if not schedule.held.any():
        return tool
    places = tracker.place_base(rig.machine.tracker.base_point, rig.seed, exact=exact)
    points = tool.copy()
    for row in np.flatnonzero(schedule.held):
        points[row] = places[str(schedule.name[row])]
    return points


def _tabulate(
    rig: Rig, schedule: Schedule, time: Array, temperature: Array, groups: list[tuple[list[str], Array]]
) -> pd.DataFrame:
    """The run as a table: groups are titles and their columns."""
    conditions = rig.conditions
    label = conditions.label
    columns: dict[str, Array] = {
        "name": schedule.name,
        "role": schedule.role,
        "run": np.array([f"{label}.{number + 1}" if conditions.run_per_cycle else label for number in schedule.run]),
        "repeat": schedule.repeat,
        "time_s": time,
        "payload_kg": schedule.payload,
        "temp_c": temperature,
        "feed_mm_s": schedule.feed,
    }
    for names, values in groups:
        if names in (TARGET, rig.commanded):  # a base reflector is neither wanted nor sent anywhere
            values = np.where(schedule.held[:, None], np.nan, values)
        columns |= {name: values[:, number] for number, name in enumerate(names)}
    return pd.DataFrame(columns)
