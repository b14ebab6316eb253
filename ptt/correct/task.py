"""Targets on their way to commands: what is asked of drawing and model, and what rows hand on to those behind."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.correct.newton import holding
from ptt.effects.drive import FollowingError, pace_number
from ptt.effects.layout import shape_of
from ptt.effects.memory import TravelBefore, continue_travel
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.workspace import translation_rank
from ptt.model.chain import EffectTerms
from ptt.model.model import Model
from ptt.run.pace import SMOOTH, Pace, line_ends, pace_of, runs_straight
from ptt.run.table import Table
from ptt.run.travel import run_starts
from ptt.run.view import View
from ptt.run.viewing import build_view


@dataclass(frozen=True)
class CommandTask:
    """All that an inversion begins with, n rows.

    Attributes:
        model: effects with their parameters.
        targets: the table.
        mechanism: the nominal one.
        steady: effects that depend on pose and context.
        reversing: effects that depend on the way there and are compensated here.
        wanted: targets in the base frame, (n, 3) mm.
        asked: what the model is asked for, (n, 3) mm.
        nominal: joint values of the targets by the drawing, (n, k); NaN out of reach.
        start: where Newton steps begin, (n, k).
        limit: largest correction that is sent, mm.
        time: seconds since the first row of the whole list, (n,) s.
        handover: what rows before hand on; None where these are the first.
        clock: the targets with what tells speeds; None where no effect follows them.
        pace: of the travel, where it is known.
        velocity: of the joints, (n, k), where it no longer depends on the commands.
    """

    model: Model
    targets: Table
    mechanism: Mechanism
    steady: EffectTerms
    reversing: EffectTerms
    wanted: Tensor
    asked: Tensor
    nominal: Tensor
    start: Tensor
    limit: float
    time: Tensor
    handover: "Handover | None" = None
    clock: Table | None = None
    pace: Pace | None = None
    velocity: Tensor | None = None

    @property
    def given(self) -> int:
        """How many rows at the start are those before, whose commands are known."""
        return 0 if self.handover is None else len(self.handover.q)

    @property
    def late(self) -> list[tuple[FollowingError, Tensor]]:
        """Lags of axes behind their commands."""
        return [(effect, theta) for effect, theta in self.steady if isinstance(effect, FollowingError)]

    @property
    def lag(self) -> Tensor:
        """Lag of each axis behind its command, (k,) s."""
        joints = self.nominal.shape[1]
        return sum((theta[:joints] for _, theta in self.late), torch.zeros(joints, dtype=torch.float64))

    @property
    def way(self) -> int:
        """What rows mean by speed where an axis lags, one of `ptt.run.pace.PACES`."""
        ways = [pace_number(shape_of(effect, theta, self.nominal.shape[1])) for effect, theta in self.late]
        return ways[0] if ways else SMOOTH

    def see(self, q: Tensor) -> View:
        """The travel that commands q (n, k) make, with the context of the targets."""
        view = replace(build_view(self.model.file, replace(self.targets, command=q.numpy())), time=self.time)
        if self.velocity is not None:
            view = replace(view, velocity=self.velocity, paces=None)
        elif self.pace is not None:
            view = replace(view, velocity=torch.as_tensor(self.pace.velocity(q.numpy())), paces=None)
        return view if self.handover is None else continue_travel(view, self.handover.travel)

    def paced(self, sent: np.ndarray) -> "CommandTask":
        """The same with the pace of its travel: that of the targets, since a correction does not change a program's.

        Args:
            sent: rows with a command of their own, (n,) bool.
        """
        if self.clock is None:
            return self
        place, ends = self.stands(sent), None
        moves = self.model.file.machine.moves
        if runs_straight(self.way, straight=moves == "straight") and len(place) > 1:
            q = self.mechanism.inverse(place, None, self.nominal)
            ends = line_ends(self.mechanism.jacobian(q), q, place, translation_rank(self.mechanism))
        slowest, starts = float(self.lag.abs().max()), run_starts(self.clock.run)
        smooth = moves == "smooth"
        return replace(self, pace=pace_of(place.numpy(), starts, self.clock, ends, self.way, slowest, smooth=smooth))

    def stands(self, sent: np.ndarray) -> Tensor:
        """Targets at which the machine is, (n, 3) mm: of a row that is not sent, that of the row before."""
        place, given = self.wanted, np.arange(len(sent)) < self.given
        if self.handover is not None:
            place = torch.cat([self.handover.place, place[self.given :]])
        return place[torch.as_tensor(holding(sent | given))]

    def shift(self, q: Tensor) -> Tensor:
        """How far commands q (n, k) ask the drawing to go from the target, (n,) mm."""
        return (self.mechanism.forward(q) - self.wanted).norm(dim=1)


@dataclass(frozen=True)
class Handover:
    """What rows hand on to those behind them: their last commands, and the travel before these.

    Attributes:
        travel: the travel up to the first of the rows.
        height: their commands without reversal compensation, (m, k).
        q: their commands with it, (m, k).
        place: their targets, (m, 3) mm; of rows that are not sent, that of the row before.
    """

    travel: TravelBefore
    height: Tensor
    q: Tensor
    place: Tensor
