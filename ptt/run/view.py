"""The one frozen view of whole runs that every effect receives: commands, nominal pose, loads, context, travel."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ptt.mechanisms import build_mechanism
from ptt.mechanisms.protocol import Mechanism, require_reachable
from ptt.mechanisms.statics import gravity_of, link_torques, weight
from ptt.run.travel import Travel, read_travel, run_starts
from ptt.run.turns import Entry

if TYPE_CHECKING:
    from ptt.machine import MachineFile
    from ptt.run.table import Table

PER_ROW = (  # the fields of a view that have one entry a row, but for the row's own number
    "q", "p", "jacobian", "direction", "turning", "velocity", "starts", "run", "payload", "warmth", "time", "torque",
    "mount", "link_load", "read",
)  # fmt: skip


@dataclass(frozen=True)
class View:
    """What the model knows about n rows before any parameter is chosen.

    Attributes:
        mechanism: the nominal mechanism, k joints.
        home: joint values the errors are referred to, (k,) mm or rad.
        lead: screw lead in mm (3-PTT), None where the drawing has none; gear period in rad (serial), a turn of the
            joint where the drawing has none.
        reflector: reflector offset from the platform's centre, (3,) mm.
        q: joint values at the stage's input, (n, k) mm or rad; commands for the drive stage.
        p: tool position at the stage's input, (n, 3) mm; nominal before the structure stage.
        jacobian: dp/dq at the nominal pose, (n, 3, k).
        direction: direction of arrival of each joint, (n, k), +1 or -1.
        turning: joint values of the last turn between the row before and this row, (n, k); q where there is none.
        velocity: joint velocity, (n, k) mm/s or rad/s; zero where unknown.
        starts: first row of each run, (n,) bool.
        run: run of each row, (n,) int64.
        payload: (n,) kg; zero where the table has none.
        warmth: temperature above the reference, (n,) K; zero where the table has none.
        time: seconds since the first row, (n,) s; zero where the table has none.
        torque: measured joint force or torque, (n, k) N or N mm (files give N m), or None.
        platform_mass: kg.
        platform_radius: mm; zero on a serial arm.
        growth: geometry slots per unit strain of radius and links (serial: of every a and every d), (2, G) mm.
        travel_limits: joint limits, (k, 2) mm or rad.
        mount: where the reflector sits beside the drawing's tool point, in the tool's own frame, (n, 3) mm; None
            where it sits on it.
        gravity: direction in which weights pull, (3,) unit vector in the base frame.
        link_load: torque of the arm's own links, (n, k) N mm; None where the drawing states no masses.
        varies: which contexts vary in the data: 'payload', 'temperature', 'time', 'speed', 'direction'.
        read: rows with a reading, (n,) bool; None where all have one, or none.
        number: place of each row in the whole table where the view is a part of it, (n,) float; None for the whole.
        entries: where rows are left out before a row, how the joints came to it.
        kept: gradual reversals of just these rows for lengths that a search tries, by the lengths' identity.
    """

    mechanism: Mechanism
    home: Tensor
    lead: float | None
    reflector: Tensor
    q: Tensor
    p: Tensor
    jacobian: Tensor
    direction: Tensor
    turning: Tensor
    velocity: Tensor
    starts: Tensor
    run: Tensor
    payload: Tensor
    warmth: Tensor
    time: Tensor
    torque: Tensor | None
    platform_mass: float
    platform_radius: float
    growth: Tensor
    travel_limits: Tensor
    mount: Tensor | None = None
    gravity: Tensor = field(default_factory=lambda: torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64))
    link_load: Tensor | None = None
    varies: frozenset[str] = field(default_factory=frozenset)
    read: Tensor | None = None
    number: Tensor | None = None
    entries: tuple[Entry, ...] = ()
    kept: dict[int, tuple[Tensor, Tensor]] = field(default_factory=dict, init=False, compare=False, repr=False)

    @property
    def rows(self) -> int:
        """Number of rows n."""
        return self.q.shape[0]

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.q.shape[1]

    @cached_property
    def covered(self) -> tuple[Tensor, Tensor]:
        """Lowest and highest value of each joint, (k,) each; every part of a long run asks the whole for it."""
        return self.q.amin(dim=0), self.q.amax(dim=0)

    def at(self, *, q: Tensor | None = None, p: Tensor | None = None) -> "View":
        """The same rows seen from a later stage.

        Args:
            q: actual joint values, (n, k).
            p: actual tool position, (n, 3) mm.

        Returns:
            A view with the stage's input replaced.
        """
        return replace(self, q=self.q if q is None else q, p=self.p if p is None else p)

    def mounted(self, geometry: Tensor) -> Tensor:
        """Add the reflector's mount to shifts of the mechanism's slots.

        Args:
            geometry: (n, G) or (1, G).

        Returns:
            The same, or (n, G) where the reflector sits beside the tool point.
        """
        if self.mount is None:
            return geometry
        return torch.cat([geometry[:, :-3].expand(self.rows, -1), geometry[:, -3:] + self.mount], dim=1)

    def load(self) -> Tensor:
        """Weight of platform and payload, as the force on the tool; without their mass in the drawing, the payload's.

        Returns:
            (n, 3) N.
        """
        return weight(self.payload, self.platform_mass, self.gravity)

    def axis_force(self) -> Tensor:
        """Force or torque that each axis carries because of platform, links and payload; measured where a sensor is.

        Returns:
            (n, k) N (sliders) or N mm (joints): (dp/dq)^T F by virtual work, F = (platform + payload) x g, and the
            same of every link's weight at its centre of mass.
        """
        if self.torque is not None:
            return self.torque
        # The load hangs on the tool, not on a reflector that sits beside it.
        at_tool = self.jacobian if self.mount is None else self.mechanism.jacobian(self.q)
        force = torch.einsum("nck,nc->nk", at_tool, self.load())
        return force if self.link_load is None else force + self.link_load


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
    command = None if table.command is None else torch.as_tensor(table.command, dtype=torch.float64)
    known = (
        torch.zeros_like(target, dtype=torch.bool)[:, :1] if command is None else torch.isfinite(command).all(1, True)
    )
    wanted = torch.isfinite(target).all(dim=1) & ~known[:, 0]
    blank = torch.full((table.rows, mechanism.joints), torch.nan, dtype=torch.float64)
    q = blank if command is None else command.clone()
    if bool(wanted.any()):
        lines = [int(line) for line in table.line[wanted.numpy()]]
        q[wanted] = require_reachable(mechanism, target[wanted], table.source, lines=lines)
    return _hold(q)


def _hold(q: Tensor) -> Tensor:
    """Fill rows without a command (base reflectors): the machine stands where it stood, at first where it will."""
    known = torch.isfinite(q).all(dim=1).numpy()
    if known.all():
        return q
    rows = np.arange(len(known))
    last = np.maximum.accumulate(np.where(known, rows, -1))
    following = np.minimum.accumulate(np.where(known, rows, len(known))[::-1])[::-1]
    return q[torch.as_tensor(np.where(last >= 0, last, np.minimum(following, len(known) - 1)).copy())]


def build_view(file: "MachineFile", table: "Table") -> View:
    """See a table through the drawing of its machine.

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
    travel = read_travel(mechanism, commands, position, table, straight=spec.moves == "straight")
    zeros = torch.zeros(table.rows, dtype=torch.float64)
    warmth = zeros if table.temp_c is None else _tensor(table.temp_c) - spec.reference_temp_c
    payload = zeros if table.payload_kg is None else _tensor(table.payload_kg)
    return View(
        mechanism=mechanism,
        home=torch.as_tensor(mechanism.home(), dtype=torch.float64),
        lead=spec.turn,
        reflector=_tensor(spec.reflector_mm),
        q=commands,
        p=position,
        jacobian=jacobian,
        direction=travel.direction,
        turning=travel.turning,
        velocity=travel.velocity,
        starts=travel.starts,
        run=_tensor(table.run).long(),
        payload=payload,
        warmth=warmth,
        time=elapsed(table),
        torque=None if table.torque is None else _tensor(table.torque) * (1e3 if spec.kind == "serial" else 1.0),
        platform_mass=spec.platform_mass_kg if spec.kind == "three-ptt" else 0.0,
        platform_radius=spec.platform_radius_mm if spec.kind == "three-ptt" else 0.0,
        growth=_growth(file, mechanism),
        travel_limits=joint_limits(file, mechanism.joints),
        gravity=gravity_of(spec),
        link_load=link_torques(mechanism, file.machine, commands),
        varies=_what_varies(table, travel),
        read=_rows_read(table),
    )


def _rows_read(table: "Table") -> Tensor | None:
    read = np.isfinite(table.measured).all(axis=1)
    return torch.as_tensor(read) if read.any() and not read.all() else None


def _tensor(values: object) -> Tensor:
    return torch.tensor(np.asarray(values), dtype=torch.float64)  # a copy: columns read by pandas are read-only


def elapsed(table: "Table") -> Tensor:
    """Seconds since the first row, (n,) s; runs whose clocks do not join are laid end to end."""
    if table.time_s is None:
        return torch.zeros(table.rows, dtype=torch.float64)
    clock = np.asarray(table.time_s, dtype=float)
    step = np.diff(clock, prepend=clock[:1])
    return _tensor(np.cumsum(np.where(run_starts(table.run) & (step < 0.0), 0.0, step)))


def joint_limits(file: "MachineFile", joints: int) -> Tensor:
    """Limits of each joint by the drawing.

    Args:
        file: the machine.
        joints: k.

    Returns:
        (k, 2) mm or rad.
    """
    spec = file.machine
    if spec.kind == "three-ptt":
        return _tensor(spec.travel_ends)
    return torch.deg2rad(_tensor([joint.limits_deg or (-180.0, 180.0) for joint in spec.joint]))


def _growth(file: "MachineFile", mechanism: Mechanism) -> Tensor:
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


def _what_varies(table: "Table", travel: Travel) -> frozenset[str]:
    pose = table.role != "base"
    names = []
    for name, column, step in (
        ("payload", table.payload_kg, 1e-3),
        ("temperature", table.temp_c, 0.05),
        ("time", table.time_s, 1.0),
    ):
        if column is not None and pose.any() and np.ptp(np.asarray(column)[pose]) > step:
            names.append(name)
    speed = travel.velocity.norm(dim=1)[torch.as_tensor(pose)]
    # Speeds that differ by less than a fifth cannot part a lag that follows speed from one that follows direction.
    if len(speed) and float(speed.max()) > 0 and float(speed.std()) > 0.05 * float(speed.mean()):
        names.append("speed")
    both = [(travel.direction[:, i] > 0).any() and (travel.direction[:, i] < 0).any() for i in range(travel.joints)]
    if any(bool(item) for item in both):
        names.append("direction")
    return frozenset(names)
