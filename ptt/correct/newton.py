"""The exact inverse of the whole chain, row by row: a row that cannot get there never stops the others.

A joint with play of width e follows the play operator y = clip(y_before, x - e/2, x + e/2) of its command x. Its exact
inverse is x = q + (e/2) dir, dir the direction of travel: the flank that pushes stays in contact, so that y = q at
every row, and at a reversal the step grows by e in the new direction. (Tao & Kokotovic, Adaptive Control of Systems
with Actuator and Sensor Nonlinearities, 1996: the backlash inverse.)
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ptt.effects.memory import standing
from ptt.effects.reversal import Backlash, gap_of
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.workspace import translation_rank
from ptt.model.chain import EffectTerms, predict
from ptt.run.direction import STANDSTILL
from ptt.run.travel import arrival_direction
from ptt.run.view import View

ROUNDS = 60  # as the C that is exported; many waves a turn leave up to half of a miss to the next round
SETTLED = 1e-10  # mm: a tool this near its goal ends the iteration; exports agree with commands to ten times that
NEARER = 0.9  # of what was missed before is progress; a round takes a hundredth, one of halved steps half
MISSED = 1e-4  # mm: a tool this far from its goal after all rounds cannot get there
IDLE = 3  # rounds that bring no row nearer: what is left goes to and fro over a gap, and no round after will help
PASSES = 5  # over rows behind some that cannot settle: each is right for one more of these that feel each other
HALVINGS = 6  # of a step that would take the links apart


def holding(sent: np.ndarray) -> np.ndarray:
    """Which row's command holds at each row: its own where it is sent, else the one before; at first, the next one.

    Args:
        sent: (n,) bool, at least one.

    Returns:
        (n,) int.
    """
    rows = np.arange(len(sent))
    last = np.maximum.accumulate(np.where(sent, rows, -1))
    return np.asarray(np.where(last >= 0, last, int(np.argmax(sent))))


def _held(sent: np.ndarray, given: int) -> tuple[Tensor, Tensor]:
    """Which row's command holds at each row, (n,) int, and which rows are solved for, (n,) bool."""
    known = np.arange(len(sent)) < given
    return torch.as_tensor(holding(sent | known)), torch.as_tensor(sent & ~known)


def invert(
    terms: EffectTerms,
    mechanism: Mechanism,
    see: Callable[[Tensor], View],
    start: Tensor,
    goal: Tensor,
    sent: np.ndarray,
    given: int = 0,
) -> tuple[Tensor, Tensor]:
    """Joint values at which the model puts the tool at its goal, by Newton steps.

    The view is taken anew in every round, because reversal effects remember the travel that the commands make. Where
    they leave a step that no command can take, rows go to and fro and keep their best round; every other row keeps the
    first in which it and those before it have settled, so that it does not matter with how many others it is inverted.
    While a row is not sent the machine stands where the row before left it.

    Args:
        terms: effects with their parameters.
        mechanism: the nominal one.
        see: commands (n, k) -> the view of the travel that they make.
        start: (n, k), finite where sent.
        goal: (n, 3) mm.
        sent: (n,) bool, at least one beyond those given.
        given: how many rows at the start keep the commands that they begin with.

    Returns:
        Commands (n, k), and by how much they miss in directions in which the joints move the tool, (n, 3) mm; infinite
        in rows that are not sent or were given.
    """
    hold, rows = _held(sent, given)
    best, least = start[hold], torch.full_like(goal, torch.inf)
    if not terms:
        return best, torch.where(rows[:, None], torch.zeros_like(goal), least)
    search = _Search(terms, mechanism, see, goal, hold, given)
    moves = rows
    for _ in range(PASSES):
        best, least = search.settle(best, least, moves)
        if bool((_size(least)[rows] <= SETTLED).all()):
            break
        # What cannot settle ends where it came nearest; what follows was right beside where it stood in another round.
        before, least = _size(least), search.missed(see(best[hold]))
        moves = rows & (_size(least) > before + SETTLED)
        if not bool(moves.any()):
            break
    return best[hold], torch.where(rows[:, None], least, torch.inf)


@dataclass(frozen=True)
class _Search:
    """What Newton's rounds ask of a travel."""

    terms: EffectTerms
    mechanism: Mechanism
    see: Callable[[Tensor], View]
    goal: Tensor
    hold: Tensor
    given: int

    @property
    def rank(self) -> int:
        return translation_rank(self.mechanism)

    def missed(self, view: View) -> Tensor:
        """What the joints can make good of what each row misses, (n, 3) mm."""
        return _made(view.jacobian, self.goal - predict(self.terms, view).p, self.rank)

    def settle(self, best: Tensor, least: Tensor, moves: Tensor) -> tuple[Tensor, Tensor]:
        """Where some rows, (n,) bool, come nearest, the others standing where they stand."""
        q, idle, stays = best[self.hold], 0, ~moves
        least = torch.where(moves[:, None], torch.inf, least)
        for _ in range(ROUNDS):
            view = self.see(q)
            step = self.missed(view)
            least = torch.where(stays[:, None], step, least)  # rows before one may have moved since it was right
            size, before = _size(step), _size(least)
            better = ((size < before) & (before > SETTLED) & moves)[:, None]
            idle = 0 if bool((moves & (size < NEARER * before) & (before > SETTLED)).any()) else idle + 1
            best, least = torch.where(better, q, best), torch.where(better, step, least)
            stays = ~moves | (_size(least) <= SETTLED)
            if bool(stays.all()) or idle == IDLE:
                break
            step[: self.given] = 0.0
            wanted = q + least_move(view.jacobian, step, self.rank)
            ahead = _ahead(self.terms, view, wanted, self.hold, self.given > 0)
            q = torch.where(stays[:, None], best, _assembled(self.mechanism, best, ahead, q))[self.hold]
        return best, least


def invert_together(
    terms: EffectTerms,
    mechanism: Mechanism,
    see: Callable[[Tensor], View],
    start: Tensor,
    goal: Tensor,
    sent: np.ndarray,
    given: int,
    lead: Callable[[Tensor], Tensor],
) -> tuple[Tensor, Tensor]:
    """The same where a row feels how its neighbours move: axes that lag follow their velocity.

    All rows end with the same round, because each is right only beside those of its round.

    Args:
        terms: effects with their parameters, none of which remembers the way.
        mechanism: the nominal one.
        see: commands (n, k) -> the view of the travel that they make.
        start: (n, k), finite where sent.
        goal: (n, 3) mm.
        sent: (n,) bool, at least one beyond those given.
        given: how many rows at the start keep the commands that they begin with.
        lead: moves of the axes -> moves of their commands, (n, k).

    Returns:
        As `invert`.
    """
    hold, rows = _held(sent, given)
    q, least, idle = start[hold], torch.full((len(sent),), torch.inf, dtype=torch.float64), 0
    rank = translation_rank(mechanism)
    for turn in range(ROUNDS):
        view = see(q)
        step = _made(view.jacobian, goal - predict(terms, view).p, rank)
        size = torch.where(rows, _size(step), 0.0)
        idle = 0 if bool((rows & (size < NEARER * least)).any()) else idle + 1
        least = torch.minimum(least, size)
        if bool((size <= SETTLED).all()) or idle == IDLE or turn == ROUNDS - 1:
            break
        step[:given] = 0.0
        wanted = q + lead(least_move(view.jacobian, step, rank))
        q = torch.cat([start[:given], _assembled(mechanism, q, wanted, q)[hold][given:]])
    return q, torch.where(rows[:, None], step, torch.inf)


def _made(jacobian: Tensor, step: Tensor, rank: int) -> Tensor:
    """What of a step the joints can make, (n, 3) mm: all of it where they move the tool in every direction."""
    if rank == step.shape[-1]:
        return step
    return (jacobian @ least_move(jacobian, step, rank)[..., None])[..., 0]


def _ahead(terms: EffectTerms, view: View, wanted: Tensor, hold: Tensor, going: bool) -> Tensor:
    """Commands for a wanted move with every gap taken up, so that a joint inside its play does not stay there.

    Args:
        terms: effects with their parameters.
        view: the travel as it was.
        wanted: commands whose play would be that of the view, (n, k).
        hold: which row's command holds at each row, (n,).
        going: whether the travel began before the first row.

    Returns:
        Commands half a gap ahead of where the nuts have to be, (n, k).
    """
    gaps = gaps_of(terms)
    if not gaps:
        return wanted
    nut = (wanted + sum((effect.shift(theta, view) for effect, theta in gaps), torch.zeros_like(wanted)))[hold]
    turning_point = (nut + (view.turning_point - view.q)).numpy()
    direction = torch.as_tensor(arrival_direction(nut.numpy(), turning_point, view.starts.numpy()))
    if going:
        direction = torch.where(standing(nut, torch.as_tensor(turning_point)), view.direction[0], direction)
    return nut + open_gaps(gaps, direction, view)


def gaps_of(terms: EffectTerms) -> EffectTerms:
    """Those effects that are play."""
    return [(effect, theta) for effect, theta in terms if isinstance(effect, Backlash)]


def open_gaps(gaps: EffectTerms, direction: Tensor, view: View) -> Tensor:
    """How far a command has to be from where the nut has to be: half the gap ahead in the direction of travel.

    Where the joint turned on the way and came back by less than the gap, a nut that waits for it still lies on the side
    from before.

    Args:
        gaps: effects that are play, with their parameters.
        direction: of arrival, (n, k).
        view: the travel, which knows where the joints turned.

    Returns:
        (n, k) mm or rad.
    """
    known = [gap_of(theta) for _, theta in gaps]
    none = torch.zeros(view.joints, dtype=direction.dtype)
    whole, gap = sum((gap for gap, _ in known), none), sum((gap for gap, waits in known if waits), none)
    back = (view.q - view.turning_point).abs()
    still = torch.where(back > STANDSTILL, (gap - back).clamp(min=0.0), 0.0)  # what is not taken up yet
    return (0.5 * whole - still) * direction


def _size(step: Tensor) -> Tensor:
    return torch.nan_to_num(step.norm(dim=1), nan=torch.inf)


def _assembled(mechanism: Mechanism, best: Tensor, wanted: Tensor, here: Tensor) -> Tensor:
    """A move as far as the links stay together: halved where they would not, given up where that does not help."""
    q = torch.where(torch.isfinite(wanted).all(dim=1)[:, None], wanted, 0.5 * (best + here))
    for _ in range(HALVINGS):
        apart = ~torch.isfinite(mechanism.forward(q)).all(dim=1)
        if not bool(apart.any()):
            return q
        q = torch.where(apart[:, None], 0.5 * (best + q), q)
    return torch.where(torch.isfinite(mechanism.forward(q)).all(dim=1)[:, None], q, best)
