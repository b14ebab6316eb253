"""The one frozen view of whole runs that every effect receives: commands, nominal pose, loads, context, travel."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import torch
from torch import Tensor

from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.statics import weight
from ptt.run.turns import Entry

PER_ROW = (  # fields of a view with one entry for each row, except `number`
    "q", "p", "jacobian", "direction", "turning_point", "velocity", "starts", "run", "payload", "warmth", "time",
    "torque", "mount", "link_load", "read", "paces", "fed", "behind",
)  # fmt: skip


@dataclass(frozen=True)
class View:
    """n rows of whole runs as effects see them: all that does not depend on any parameter.

    Attributes:
        mechanism: the nominal mechanism, k joints.
        home: home position, from which drive errors count the travel, (k,) mm or rad.
        lead: screw lead in mm (3-PTT), None where the drawing has none; gear period in rad (serial), 2 pi where the
            drawing has none.
        reflector: reflector offset from the platform's centre, (3,) mm.
        q: joint values at the stage's input, (n, k) mm or rad; commands for the drive stage.
        p: tool position at the stage's input, (n, 3) mm; nominal before the structure stage.
        jacobian: dp/dq at the nominal pose, (n, 3, k).
        direction: direction of arrival of each joint, (n, k), +1 or -1.
        turning_point: joint value where it last reversed between the row before and this row, (n, k); q where it did
            not.
        velocity: joint velocity, (n, k) mm/s or rad/s; zero where unknown.
        starts: first row of each run, (n,) bool.
        run: run of each row, (n,) int64.
        payload: (n,) kg; zero where the table has none.
        warmth: temperature above the reference, (n,) K; zero where the table has none.
        behind: how much warmer bodies are that follow it late by each of `ptt.run.behind.LAGS_S`, (n, m) K; None where
            there is no clock, or no temperature that varies.
        time: seconds since the first row, (n,) s; zero where the table has none.
        torque: measured joint force or torque, (n, k) N or N mm (files give N m), or None.
        platform_mass: kg.
        platform_radius: mm; zero on a serial arm.
        growth: geometry slots per unit strain of radius and links (serial: of every a and every d), (2, G) mm.
        travel_limits: joint limits, (k, 2) mm or rad.
        mount: offset of the reflector from the drawing's tool point, in the tool's own frame, (n, 3) mm; None for zero.
        gravity: direction of gravity, (3,) unit vector in the base frame.
        link_load: torque of the arm's own links, (n, k) N mm; None where the drawing states no masses.
        varies: which contexts vary in the data: 'payload', 'temperature', 'time', 'speed', 'direction'.
        read: rows with a reading, (n,) bool; None where all have one, or none.
        paces: joint velocity by the definitions of `ptt.run.pace.PACES` but the first, (n, k, 3); None where it is
            zero or these are not needed.
        fed: joint velocity that the feeds make by each of `PACES`, (n, k, 4), where the clock shows that the machine
            stood at its rows (`ptt.run.driven`); None elsewhere and for feeds that do not vary.
        number: index of each row in the whole table where the view is a part of it, (n,) float; None for the whole.
        entries: for each row before which rows are left out, what the joints remember of those.
        began: time of the first row by the table's own clock, s.
        beginnings: times at which a body's temperature is not known from the rows before, s, ascending: the first row,
            those at which the clock begins anew with a run, and those after a long pause.
        kept: cache of gradual reversals of these rows, by the identity of the length (`keep_reversals`).
    """

    mechanism: Mechanism
    home: Tensor
    lead: float | None
    reflector: Tensor
    q: Tensor
    p: Tensor
    jacobian: Tensor
    direction: Tensor
    turning_point: Tensor
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
    paces: Tensor | None = None
    fed: Tensor | None = None
    behind: Tensor | None = None
    number: Tensor | None = None
    entries: tuple[Entry, ...] = ()
    began: float = 0.0
    beginnings: tuple[float, ...] = (0.0,)
    kept: dict[int, tuple[Tensor, Tensor]] = field(default_factory=dict, init=False, compare=False, repr=False)

    @property
    def rows(self) -> int:
        """Number of rows n."""
        return self.q.shape[0]

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.q.shape[1]

    @property
    def row_numbers(self) -> Tensor:
        """Index of each row in the whole table, (n,) float."""
        return torch.arange(self.rows, dtype=torch.float64) if self.number is None else self.number

    @property
    def clock(self) -> Tensor:
        """Time of each row, (n,): seconds where there is a clock, else its index in the whole table."""
        return self.time if "time" in self.varies else self.row_numbers

    @cached_property
    def covered(self) -> tuple[Tensor, Tensor]:
        """Lowest and highest value of each joint, (k,) each; cached, since every part of a long run needs it."""
        return self.q.amin(dim=0), self.q.amax(dim=0)

    def at(self, *, q: Tensor | None = None, p: Tensor | None = None) -> "View":
        """The same rows at the input of a later stage.

        Args:
            q: actual joint values, (n, k).
            p: actual tool position, (n, 3) mm.

        Returns:
            A view with the stage's input replaced.
        """
        return replace(self, q=self.q if q is None else q, p=self.p if p is None else p)

    def standing(self, fed: Tensor | None = None) -> "View":
        """The same rows read at a standstill.

        Args:
            fed: as of the class.
        """
        still = torch.zeros_like(self.velocity)
        return replace(self, velocity=still, paces=None, fed=fed, varies=self.varies - {"speed"})

    def of_rows(self, rows: Tensor) -> "View":
        """Some of the rows, each with its index in the whole.

        Args:
            rows: (m,) int64, in rising order.

        Returns:
            A view of m rows, without entries: what the joints remember of the rows left out is not in it.
        """
        own = {name: value[rows] for name in PER_ROW if (value := getattr(self, name)) is not None}
        return replace(self, **own, number=self.row_numbers[rows], entries=())

    def mounted(self, geometry: Tensor) -> Tensor:
        """Add the reflector's offset to the tool slots of geometry shifts.

        Args:
            geometry: (n, G) or (1, G).

        Returns:
            The same, or (n, G) where the reflector has an offset.
        """
        if self.mount is None:
            return geometry
        return torch.cat([geometry[:, :-3].expand(self.rows, -1), geometry[:, -3:] + self.mount], dim=1)

    def load(self) -> Tensor:
        """Weight of platform and payload as a force on the tool.

        Returns:
            (n, 3) N.
        """
        return weight(self.payload, self.platform_mass, self.gravity)

    def axis_force(self) -> Tensor:
        """Force or torque in each axis by platform, links and payload; the measured one where the table has it.

        Returns:
            (n, k) N (sliders) or N mm (joints): (dp/dq)^T F by virtual work, F = (platform + payload) x g, and the
            same of every link's weight at its centre of mass.
        """
        if self.torque is not None:
            return self.torque
        # The load acts at the tool point, not at a reflector with an offset from it.
        at_tool = self.jacobian if self.mount is None else self.mechanism.jacobian(self.q)
        force = torch.einsum("nck,nc->nk", at_tool, self.load())
        return force if self.link_load is None else force + self.link_load
