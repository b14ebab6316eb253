"""Builds the `View` of a table: commands, nominal poses, travel, speeds, loads and context by the drawing."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ptt.mechanisms import build_mechanism
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.statics import gravity_of, link_torques
from ptt.mechanisms.workspace import translation_rank
from ptt.run.behind import lags_behind
from ptt.run.beside import rows_beside
from ptt.run.pace import joint_speeds
from ptt.run.reach import require_targets
from ptt.run.travel import Travel, read_travel, run_starts
from ptt.run.view import View

if TYPE_CHECKING:
    from ptt.machine import MachineFile
    from ptt.run.table import Table

EVEN = 0.05  # relative scatter of speeds below which effects of speed look like those of direction
PAUSE = 3600.0  # s between two rows: after as long a pause a room may be anywhere between
MOMENT = 1.0  # s: assumed time from the last row of a run to the first of one whose clock starts anew


def command_rows(mechanism: Mechanism, table: "Table") -> Tensor:
    """Joint commands of a table: its own where it has them, else the inverse of the targets.

    Args:
        mechanism: the nominal mechanism.
        table: n rows.

    Returns:
        (n, k) mm or rad.

    Raises:
        WorkspaceError: a target out of reach, by line.
    """
    target = torch.as_tensor(table.target, dtype=torch.float64)
    q = _tensor(np.full((table.rows, mechanism.joints), np.nan) if table.command is None else table.command)
    wanted = torch.isfinite(target).all(dim=1) & ~torch.isfinite(q).all(dim=1)
    if bool(wanted.any()):
        q[wanted] = mechanism.inverse(target[wanted])
        require_targets(table, (wanted & ~torch.isfinite(q).all(dim=1)).numpy())
    return _hold(q, table.run)


def _hold(q: Tensor, run: np.ndarray) -> Tensor:
    """Fill rows without a command (base reflectors): the machine stands where it was before, at first where it goes."""
    known = torch.isfinite(q).all(dim=1).numpy()
    return q if known.all() else q[torch.as_tensor(standing_rows(known, run))]


def standing_rows(known: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Index of the row whose command holds at each row: the last known one of its run, at first the next one.

    Args:
        known: rows with a command, (n,) bool.
        run: (n,) int.

    Returns:
        (n,) int.
    """
    part, last = np.cumsum(run_starts(run)), rows_beside(known)
    following = len(known) - 1 - rows_beside(known[::-1])[::-1]
    opens = (part[last] != part) & (part[following] == part)
    return np.where(opens, following, last)


def build_view(file: "MachineFile", table: "Table") -> View:
    """Build the view of a table.

    Args:
        file: the machine.
        table: n rows in travel order; base and datum rows included.

    Returns:
        The view.

    Raises:
        WorkspaceError: commands or targets that the drawing cannot reach.
    """
    spec = file.machine
    mechanism = build_mechanism(spec)
    commands = command_rows(mechanism, table)
    position = mechanism.forward(commands)
    jacobian = mechanism.jacobian(commands)
    straight = spec.moves == "straight"
    travel = read_travel(mechanism, commands, position, table, straight=straight, smooth=spec.moves == "smooth")
    velocity, paces = joint_speeds(
        commands, position, jacobian, travel.starts.numpy(), table, translation_rank(mechanism), straight=straight,
        smooth=spec.moves == "smooth",
    )  # fmt: skip
    zeros = torch.zeros(table.rows, dtype=torch.float64)
    warmth = zeros if table.temp_c is None else _tensor(table.temp_c) - spec.reference_temp_c
    payload = zeros if table.payload_kg is None else _tensor(table.payload_kg)
    varies = _what_varies(table, travel, velocity)
    return View(
        mechanism=mechanism,
        home=torch.as_tensor(mechanism.home(), dtype=torch.float64),
        lead=spec.turn,
        reflector=_tensor(spec.reflector_mm),
        q=commands,
        p=position,
        jacobian=jacobian,
        direction=travel.direction,
        turning_point=travel.turning_point,
        velocity=velocity,
        paces=paces,
        starts=travel.starts,
        run=_tensor(table.run).long(),
        payload=payload,
        warmth=warmth,
        time=elapsed(table),
        began=0.0 if table.time_s is None else float(table.time_s[0]),
        torque=None if table.torque is None else _tensor(table.torque) * (1e3 if spec.kind == "serial" else 1.0),
        platform_mass=spec.platform_mass_kg if spec.kind == "three-ptt" else 0.0,
        platform_radius=spec.platform_radius_mm if spec.kind == "three-ptt" else 0.0,
        growth=_growth(file, mechanism),
        travel_limits=joint_limits(file),
        gravity=gravity_of(spec),
        link_load=link_torques(mechanism, file.machine, commands),
        varies=varies,
        read=_rows_read(table),
        behind=lags_of(table) if {"temperature", "time"} <= varies else None,
        beginnings=_beginnings(table),
    )


def _rows_read(table: "Table") -> Tensor | None:
    read = np.isfinite(table.measured).all(axis=1) & (table.role != "base")
    return torch.as_tensor(read) if read.any() and not read.all() else None


def _tensor(values: object) -> Tensor:
    return torch.tensor(np.asarray(values), dtype=torch.float64)  # a copy: columns read by pandas are read-only


def elapsed(table: "Table") -> Tensor:
    """Seconds since the first row, (n,) s; where the clock goes back it was reset, and time continues from there.

    A run with a reset clock is taken to begin `MOMENT` after the one before, so that there is a moment between them.
    """
    if table.time_s is None:
        return torch.zeros(table.rows, dtype=torch.float64)
    clock = np.asarray(table.time_s, dtype=float)
    step = np.diff(clock, prepend=clock[:1])
    anew = np.diff(table.run, prepend=table.run[:1]) != 0
    return _tensor(np.cumsum(np.where(step < 0.0, np.where(anew, MOMENT, 0.0), step)))


def lags_of(table: "Table") -> Tensor | None:
    """How much warmer bodies are than the temperature, which they follow late by each of `ptt.run.behind.LAGS_S`.

    A body goes on from run to run, unless the clock begins anew with a run.

    Args:
        table: n rows.

    Returns:
        (n, m) K; None without temperatures or a clock.
    """
    if table.temp_c is None or table.time_s is None:
        return None
    return _tensor(lags_behind(np.asarray(table.temp_c, dtype=float), elapsed(table).numpy(), _anew(table)))


def _beginnings(table: "Table") -> tuple[float, ...]:
    """`View.beginnings` of a table: over a pause nobody has recorded the temperature that bodies followed."""
    time = elapsed(table).numpy()
    if table.time_s is None:
        return (0.0,)
    paused = np.diff(time, prepend=time[:1]) > PAUSE
    return (0.0, *time[paused | _anew(table)].tolist())


def _anew(table: "Table") -> np.ndarray:
    """Rows at which the clock begins anew with a run, (n,) bool."""
    assert table.time_s is not None
    back, other = np.diff(table.time_s, prepend=table.time_s[:1]) < 0.0, np.diff(table.run, prepend=table.run[:1]) != 0
    return np.asarray(back & other)


def joint_limits(file: "MachineFile") -> Tensor:
    """Range of each joint to plan, draw and measure over: the drawing's limits, +-180 deg where an arm states none.

    Which commands may be sent is up to `Mechanism.limits`, which are infinite there.

    Args:
        file: the machine.

    Returns:
        (k, 2) mm or rad.
    """
    spec = file.machine
    if spec.kind == "three-ptt":
        return _tensor(spec.travel_ends)
    return torch.deg2rad(_tensor([joint.limits_deg or (-180.0, 180.0) for joint in spec.joint]))


def _growth(file: "MachineFile", mechanism: Mechanism) -> Tensor:
    """Geometry shifts per unit strain of base radius and links (serial: of every a and every d), (2, G) mm."""
    spec = file.machine
    growth = torch.zeros(2, len(mechanism.slots), dtype=torch.float64)
    if spec.kind == "three-ptt":
        for leg, azimuth in enumerate(np.radians(spec.slider_azimuth_deg)):
            growth[0, 4 * leg] = spec.base_radius_mm * np.cos(azimuth)
            growth[0, 4 * leg + 1] = spec.base_radius_mm * np.sin(azimuth)
            growth[1, 4 * leg + 3] = spec.link_length_mm
    else:
        for index, joint in enumerate(spec.joint):
            growth[0, 5 * index] = joint.a_mm
            growth[1, 5 * index + 2] = joint.d_mm
    return growth


def _what_varies(table: "Table", travel: Travel, velocity: Tensor) -> frozenset[str]:
    """Contexts that vary over the poses: `varies` of a `View`."""
    pose = table.role != "base"
    names = []
    for name, column, step in (
        ("payload", table.payload_kg, 1e-3),
        ("temperature", table.temp_c, 0.05),
        ("time", None if table.time_s is None else elapsed(table), 1.0),
    ):
        if column is not None and pose.any() and np.ptp(np.asarray(column)[pose]) > step:
            names.append(name)
    speed = velocity.norm(dim=1)[torch.as_tensor(pose)]
    if len(speed) and float(speed.max()) > 0 and float(speed.std()) > EVEN * float(speed.mean()):
        names.append("speed")
    if travel.two_sided:
        names.append("direction")
    return frozenset(names)
