"""Real measurements as tables and machines: a telescope's mount, two arms of a humanoid, four series of a UR10.

The files lie beside the project (shared/data) and are never part of it; `here` tells which of them are there.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pandas as pd
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor
from ur10 import MACHINE, read_series

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.self_weight import levers
from ptt.machine import MachineFile, load_machine, parse_machine
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table
from ptt.run.view import View

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
ARCSEC = np.radians(1.0 / 3600.0)

SKY_SCATTER = 7.6 * ARCSEC  # rad: rest of the published fit without gross errors, one coordinate
STAR_MM = 1e6

SHOULDER_UP, SHOULDER_FORWARD, SHOULDER_SIDE = 200.0, 84.5, 250.0  # mm from the chest joint
SHOULDER_TILT = 30.0  # deg
TORSO, RIGHT, LEFT = slice(0, 3), slice(3, 10), slice(10, 17)


def here(name: str) -> bool:
    """Whether a folder of measurements is there."""
    return (DATA / name).exists()


def telescope() -> tuple[MachineFile, Table]:
    """Altitude over azimuth: an arm of a foot that never turns and two axes, which points at stars 1 km away.

    The file's two error columns are exchanged: only so do they repeat the published fit (the one of azimuth grows with
    tan(alt)), to the last digit. An error is where the mount says it points less where it does. Stars stand in the
    frame of the horizon, which is trusted; that the mount leans is an error of the foot. Directions tell no lengths: at
    1 km a link that is 0.5 mm off turns them by a tenth of an arc second, and how far the star is is exact by
    construction. So that the exact coordinate does not pass for good tracking, the noise is stated, as the rest of the
    published fit.

    Returns:
        Machine and table: q2 = -azimuth, q3 = altitude, as the mount says.
    """
    azimuth, altitude, direction, seconds = _sky()
    machine = parse_machine(
        '[machine]\nkind = "serial"\nname = "telescope"\nconvention = "standard"\n'
        f"tool_mm = [{STAR_MM}, 0, 0]\njoint = [{{}}, {{ alpha_deg = 90 }}, {{}}]\n"
        f'[tracker]\nframe = "trusted"\nsigma_mm = {STAR_MM * SKY_SCATTER}\n',
        "telescope",
    )
    commands = np.column_stack([np.zeros(len(seconds)), -azimuth, altitude])
    return machine, make_table(None, commands, direction * STAR_MM, time_s=seconds)


def plain_telescope(frame: str, timed: bool = True) -> tuple[MachineFile, Table]:
    """The same as one sets it up who knows but the two axes: stars 1 m away, no foot, no noise stated.

    Args:
        frame: of the tracker, 'trusted' or 'fitted'.
        timed: whether the rows say when.

    Returns:
        Machine and table: q1 = -azimuth, q2 = altitude, as the mount says.
    """
    azimuth, altitude, direction, seconds = _sky()
    machine = parse_machine(
        '[machine]\nkind = "serial"\nname = "telescope"\nconvention = "standard"\n'
        f'tool_mm = [1000, 0, 0]\njoint = [{{ alpha_deg = 90 }}, {{}}]\n[tracker]\nframe = "{frame}"\n',
        "telescope",
    )
    commands = np.column_stack([-azimuth, altitude])
    return machine, make_table(None, commands, direction * 1e3, time_s=seconds if timed else None)


def _sky() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Azimuth and altitude as the mount says (rad), where the stars stand (n, 3), and seconds since the first."""
    rows = pd.read_csv(DATA / "rts2_pointing" / "altaz.csv")
    azimuth, altitude = np.radians(rows["az_deg"].to_numpy()), np.radians(rows["alt_deg"].to_numpy())
    star_az = azimuth - np.radians(rows["alt_err_deg"].to_numpy())
    star_alt = altitude - np.radians(rows["az_err_deg"].to_numpy())
    direction = np.column_stack(
        [np.cos(star_alt) * np.cos(star_az), -np.cos(star_alt) * np.sin(star_az), np.sin(star_alt)]
    )
    return azimuth, altitude, direction, (rows["jd"] - rows["jd"].iloc[0]).to_numpy() * 86400.0


def humanoid(side: str) -> tuple[MachineFile, Table]:
    """Torso and one arm of Agile Justin as one chain of eleven joints, a marker on its hand.

    The fourth torso joint has no drive: tendons keep the chest upright, q4 = -(q2 + q3). The published table leaves
    out how an arm sits on the chest; upright as the chest stays, the height of it does not matter, and the rest was
    read off the readings: tilted by 30 deg, 250 mm to the side, 84.5 mm ahead.

    Args:
        side: 'right' or 'left'.

    Returns:
        Machine and table.
    """
    rows = pd.read_csv(DATA / "dlr_justin" / "measurements.csv")
    joints = rows[[f"q{index}_rad" for index in range(19)]].to_numpy()
    torso, arm = joints[:, TORSO], joints[:, RIGHT if side == "right" else LEFT]
    commands = np.column_stack([torso, -torso[:, 1:].sum(axis=1), arm])
    measured = rows[[f"{axis}{side[0]}_m" for axis in "xyz"]].to_numpy() * 1e3
    links = "".join(
        f"[[machine.joint]]\nd_mm = {d!r}\ntheta_offset_deg = {theta!r}\na_mm = {a!r}\nalpha_deg = {alpha!r}\n"
        for d, theta, a, alpha in _links(side)
    )
    machine = parse_machine(
        f'[machine]\nkind = "serial"\nname = "{side} arm"\nconvention = "modified"\n{links}'
        '[tracker]\nframe = "fitted"\ntool = "fitted"\n',
        f"{side} arm",
    )
    return machine, make_table(None, commands, measured)


def _links(side: str) -> list[tuple[float, float, float, float]]:
    """Rows d, theta, a, alpha (mm, deg) of the modified convention."""
    way = 1.0 if side == "right" else -1.0
    chest, shoulder = _shoulder(side)
    return [
        (105.5, 0.0, 0.0, 0.0),
        (0.0, -90.0, 0.0, -90.0),
        (0.0, 0.0, 300.0, 0.0),
        (chest[0], chest[1], 300.0, 0.0),
        shoulder,
        (0.0, 0.0, 0.0, 90.0),
        (400.0 * way, -90.0, 0.0, -90.0),
        (0.0, 0.0, 0.0, 90.0),
        (390.0 * way, -180.0 if side == "right" else 0.0, 0.0, -90.0),
        (0.0, 90.0, 0.0, 90.0 * way),
        (0.0, -90.0, 0.0, 90.0 * way),
    ]


def _shoulder(side: str) -> tuple[tuple[float, float], tuple[float, float, float, float]]:
    """d and theta behind the chest joint, and the row of the first arm joint, that put the shoulder in its place.

    The seat of the arm in the chest's frame (x up, y ahead, z along the joint) is a turn about y; as screws about z, x
    and z it is Euler's z-x-z, and its shift has one part along each of the three axes.
    """
    right = side == "right"
    turn = Rotation.from_euler("y", 180.0 - SHOULDER_TILT if right else SHOULDER_TILT, degrees=True)
    turn = turn if right else turn * Rotation.from_euler("x", 180.0, degrees=True)
    first, alpha, last = (float(angle) for angle in turn.as_euler("ZXZ", degrees=True))
    normal = np.array([np.cos(np.radians(first)), np.sin(np.radians(first)), 0.0])
    axes = np.column_stack([[0.0, 0.0, 1.0], normal, turn.as_matrix()[:, 2]])
    place = [SHOULDER_UP, SHOULDER_FORWARD, -SHOULDER_SIDE if right else SHOULDER_SIDE]
    before, a, behind = (float(length) for length in np.linalg.solve(axes, place))
    return (before, first), (behind, last, a, alpha)


def other_arm(side: str) -> Effect:
    """The weight of the other arm on the torso, which no single chain holds: a user's own effect.

    Args:
        side: whose machine it is added to.

    Returns:
        The effect: the sag of the torso's joints by the other chain's links beyond the chest.
    """
    beside = open_set(*humanoid("left" if side == "right" else "right")).view
    own = [(joint, link) for joint in range(4) for link in range(4, 11)]
    shapes = torch.stack([lever[:, joint, link] for lever in levers(beside) for joint, link in own], dim=-1)
    mine = torch.tensor([joint for _ in range(2) for joint, _ in own])

    @dataclass(frozen=True)
    class OtherArm(Effect):
        """Torso joints give way under the other arm's weight."""

        name: ClassVar[str] = "other-arm"
        stage: ClassVar[Stage] = "drive"
        mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
        parameters: ClassVar[tuple[Parameter, ...]] = (
            Parameter("sag", "rad", 1e-3, "sag of a torso joint by a moment of the other arm", count=len(mine)),
        )

        def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
            """Levers of the other arm's links on the torso's joints."""
            on = torch.nn.functional.one_hot(mine, view.joints).T.to(view.q.dtype)  # shape: (k, P)
            return shapes[:, None] * on

    return OtherArm()


def ur10(name: str, stride: int = 1) -> tuple[MachineFile, Table]:
    """One series of the UR10.

    Args:
        name: A, B, C or D.
        stride: every how many rows one is taken.

    Returns:
        Machine and table.
    """
    return load_machine(MACHINE), read_series(name, stride)


def open_set(machine: MachineFile, table: Table) -> Problem:
    """See a set through its drawing."""
    return build_problem(machine, table)
