"""The task of an inversion: targets, what drawing and model are asked for, and the state handed on by rows before."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.effects.drive import FollowingError, pace_number
from ptt.effects.layout import shape_of
from ptt.effects.memory import TravelBefore, continue_travel
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.workspace import translation_rank
from ptt.model.chain import EffectTerms
from ptt.model.model import Model
from ptt.run.beside import rows_beside
from ptt.run.pace import SMOOTH, Pace, line_ends, pace_of, runs_straight
from ptt.run.table import Table
from ptt.run.travel import run_starts
from ptt.run.turns import Entry
from ptt.run.view import View
from ptt.run.viewing import build_view

# From wanted positions, (n, 3) mm, with their nominal joint values, (n, k): positions to ask the model for, (n, 3) mm.
Correction = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class CommandTask:
    """Everything that an inversion starts from, n rows.

    Attributes:
        model: effects with their parameters.
        targets: the table, without time and feed.
        mechanism: the nominal mechanism.
        steady: effects that depend on pose and context alone.
        reversing: effects that depend on the direction or travel before, as far as the commands compensate them.
        wanted: targets in the base frame, (n, 3) mm.
        asked: positions that the model is to reach, (n, 3) mm: the targets, shifted by the network where there is one.
        in_domain: targets inside the training domain of the network, all True without one, (n,) bool.
        nominal: joint values of the targets by the drawing, (n, k) mm or rad; NaN out of reach.
        start: joint values where Newton's method starts, (n, k).
        limit: largest correction that is sent, mm.
        time: seconds since the first row of the whole list, (n,) s.
        behind: how much warmer bodies are than the temperature, which they follow late, (n, m) K, as of a `View`; None
            without temperatures or a clock.
        contexts: payload, temperature, speed and time of the targets as they were read (`contexts_of`), each (n,).
        handover: state handed on by the rows before; None where these rows are the first.
        clock: the targets with time and feed, from which speeds follow; None where no effect depends on speed.
        pace: of the travel; None until it is known which rows are sent.
        velocity: of the joints, (n, k) mm/s or rad/s, where it no longer depends on the commands.
        correction: of the network, for positions that are no targets; None without one.
    """

    model: Model
    targets: Table
    mechanism: Mechanism
    steady: EffectTerms
    reversing: EffectTerms
    wanted: Tensor
    asked: Tensor
    in_domain: np.ndarray
    nominal: Tensor
    start: Tensor
    limit: float
    time: Tensor
    behind: Tensor | None
    contexts: Mapping[str, np.ndarray]
    handover: "Handover | None" = None
    clock: Table | None = None
    pace: Pace | None = None
    velocity: Tensor | None = None
    correction: Correction | None = None

    @property
    def given(self) -> int:
        """Number of leading rows that were handed on, whose commands are known."""
        return rows_of(self.handover)

    @property
    def lags(self) -> list[tuple[FollowingError, Tensor]]:
        """Following errors among the steady effects, with their parameters."""
        return [(effect, theta) for effect, theta in self.steady if isinstance(effect, FollowingError)]

    @property
    def lag(self) -> Tensor:
        """Lag of each axis behind its command, (k,) s."""
        joints = self.nominal.shape[1]
        return sum((theta[:joints] for _, theta in self.lags), torch.zeros(joints, dtype=torch.float64))

    @property
    def pace_kind(self) -> int:
        """Definition of the speed that lags depend on, one of `ptt.run.pace.PACES`."""
        kinds = [pace_number(shape_of(effect, theta, self.nominal.shape[1])) for effect, theta in self.lags]
        return kinds[0] if kinds else SMOOTH

    def view_of(self, q: Tensor) -> View:
        """The view of the travel that commands q (n, k) make, with the context of the targets."""
        view = build_view(self.model.file, replace(self.targets, command=q.numpy()))
        view = replace(view, time=self.time, behind=self.behind, beginnings=(0.0,))
        if self.velocity is not None:
            view = replace(view, velocity=self.velocity, paces=None)
        elif self.pace is not None:
            view = replace(view, velocity=torch.as_tensor(self.pace.velocity(q.numpy())), paces=None)
        return view if self.handover is None else continue_travel(view, self.handover.travel)

    def paced(self, sent: np.ndarray) -> "CommandTask":
        """The same task with the pace of its travel: that of the targets, which a correction does not change.

        Args:
            sent: rows with a command of their own, (n,) bool.
        """
        if self.clock is None:
            return self
        place, ends = self.positions(sent), None
        moves = self.model.file.machine.moves
        if runs_straight(self.pace_kind, straight=moves == "straight") and len(place) > 1:
            q = self.mechanism.inverse(place, None, self.nominal)
            ends = line_ends(self.mechanism.jacobian(q), q, place, translation_rank(self.mechanism))
        slowest, starts = float(self.lag.abs().max()), run_starts(self.clock.run)
        kind, smooth = self.pace_kind, moves == "smooth"
        return replace(self, pace=pace_of(place.numpy(), starts, self.clock, ends, kind, slowest, smooth=smooth))

    def positions(self, sent: np.ndarray) -> Tensor:
        """Position of the machine at each row, (n, 3) mm: its target, or that of the row before if it is not sent."""
        place, given = self.wanted, np.arange(len(sent)) < self.given
        if self.handover is not None:
            place = torch.cat([self.handover.place, place[self.given :]])
        return place[torch.as_tensor(rows_beside(sent | given))]

    def shift(self, q: Tensor) -> Tensor:
        """Size of the correction in commands q (n, k): distance of their nominal position from the target, (n,) mm."""
        return (self.mechanism.forward(q) - self.wanted).norm(dim=1)


@dataclass(frozen=True)
class Handover:
    """State that rows hand on to those behind them: their last commands, and the travel before these.

    Attributes:
        travel: the travel up to the first of the rows.
        height: commands of the rows without reversal compensation, (m, k).
        q: commands with it, (m, k).
        place: their targets, (m, 3) mm; of rows that are not sent, that of the row before.
        other_side: what the joints remember on arrival at the first of them if they came to that of the run from the
            other side; None where the targets say from which side, or nothing depends on it.
    """

    travel: TravelBefore
    height: Tensor
    q: Tensor
    place: Tensor
    other_side: Entry | None = None


def rows_of(handover: Handover | None) -> int:
    """Number of rows that are handed on."""
    return 0 if handover is None else len(handover.q)
