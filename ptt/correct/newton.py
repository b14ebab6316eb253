"""Newton inversion of the causal chain, all rows at once: a row without a solution does not stop the others.

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
from ptt.run.beside import rows_beside
from ptt.run.direction import STANDSTILL
from ptt.run.travel import arrival_direction
from ptt.run.view import View

ROUNDS = 60  # as in the exported C; with many harmonics of a turn a round leaves up to half of the miss
SETTLED = 1e-10  # mm: a miss below ends the iteration; exports agree with commands to ten times that
NEARER = 0.9  # a miss below this share of the one before is progress; a usual round leaves 0.01, a halved step 0.5
MISSED = 1e-4  # mm: a row with a larger miss after all rounds cannot be reached
IDLE = 3  # rounds without progress in any row: what is left alternates over a gap, and further rounds do not help
PASSES = 5  # over rows that follow some which do not settle: each pass settles one more of those that depend on another
HALVINGS = 6  # of a step that would take the links apart


def _held(sent: np.ndarray, given: int) -> tuple[Tensor, Tensor]:
    """Index of the row whose command holds at each row, (n,) int, and which rows are solved for, (n,) bool."""
    known = np.arange(len(sent)) < given
    return torch.as_tensor(rows_beside(sent | known)), torch.as_tensor(sent & ~known)


def invert(
    terms: EffectTerms,
    mechanism: Mechanism,
    view_of: Callable[[Tensor], View],
    start: Tensor,
    goal: Tensor,
    sent: np.ndarray,
    given: int = 0,
) -> tuple[Tensor, Tensor]:
    """Joint values at which the model puts the tool at its goal, by Newton's method.

    The view is built anew in every round, because reversal effects depend on the travel that the commands make. Where
    they leave a step that no command can make, a row alternates and keeps its best round; every other row keeps the
    first round in which it and all before it have settled, so the result does not depend on how many rows are inverted
    together. At a row that is not sent the machine stands where the row before left it.

    Args:
        terms: effects with their parameters.
        mechanism: the nominal mechanism.
        view_of: commands (n, k) -> the view of the travel that they make.
        start: commands to start from, (n, k), finite where sent.
        goal: positions that the model is to reach, (n, 3) mm.
        sent: (n,) bool, at least one beyond those given.
        given: how many leading rows keep the commands of `start`.

    Returns:
        Commands (n, k), and their miss, goal less position, in the directions in which the joints move the tool,
        (n, 3) mm; infinite in rows that are not sent or were given.
    """
    hold, rows = _held(sent, given)
    best, least = start[hold], torch.full_like(goal, torch.inf)
    if not terms:
        return best, torch.where(rows[:, None], torch.zeros_like(goal), least)
    search = _Search(terms, mechanism, view_of, goal, hold, given)
    moves = rows
    for _ in range(PASSES):
        best, least = search.settle(best, least, moves)
        if bool((_size(least)[rows] <= SETTLED).all()):
            break
        # A row that does not settle ends in its best round, while rows behind it settled beside another of its rounds.
        before, least = _size(least), search.missed(view_of(best[hold]))
        moves = rows & (_size(least) > before + SETTLED)
        if not bool(moves.any()):
            break
    return best[hold], torch.where(rows[:, None], least, torch.inf)


@dataclass(frozen=True)
class _Search:
    """Newton's method over one travel; attributes as the arguments of `invert`, `hold` as of `_held`."""

    terms: EffectTerms
    mechanism: Mechanism
    view_of: Callable[[Tensor], View]
    goal: Tensor
    hold: Tensor
    given: int

    @property
    def rank(self) -> int:
        """Rank of the mechanism's dp/dq."""
        return translation_rank(self.mechanism)

    def missed(self, view: View) -> Tensor:
        """Part of each row's miss that the joints can correct, (n, 3) mm."""
        return _attainable(view.jacobian, self.goal - predict(self.terms, view).p, self.rank)

    def settle(self, best: Tensor, least: Tensor, moves: Tensor) -> tuple[Tensor, Tensor]:
        """Best commands (n, k) and misses (n, 3) of the rows in `moves` (n,) bool, the others held at `best`."""
        q, idle, stays = best[self.hold], 0, ~moves
        least = torch.where(moves[:, None], torch.inf, least)
        for _ in range(ROUNDS):
            view = self.view_of(q)
            step = self.missed(view)
            least = torch.where(stays[:, None], step, least)  # rows before may have moved since it settled
            size, before = _size(step), _size(least)
            better = ((size < before) & (before > SETTLED) & moves)[:, None]
            idle = 0 if bool((moves & (size < NEARER * before) & (before > SETTLED)).any()) else idle + 1
            best, least = torch.where(better, q, best), torch.where(better, step, least)
            stays = ~moves | (_size(least) <= SETTLED)
            if bool(stays.all()) or idle == IDLE:
                break
            step[: self.given] = 0.0
            wanted = q + least_move(view.jacobian, step, self.rank)
            ahead = _with_gaps_taken_up(self.terms, view, wanted, self.hold, self.given > 0)
            q = torch.where(stays[:, None], best, _assembled(self.mechanism, best, ahead, q))[self.hold]
        return best, least


def invert_together(
    terms: EffectTerms,
    mechanism: Mechanism,
    view_of: Callable[[Tensor], View],
    start: Tensor,
    goal: Tensor,
    sent: np.ndarray,
    given: int,
    lead: Callable[[Tensor], Tensor],
) -> tuple[Tensor, Tensor]:
    """As `invert`, where a row depends on its neighbours' commands because lagging axes follow their velocity.

    All rows end with the same round, because each is right only together with those of its round. `lead` gives for
    steps of the axes the steps of their commands that make them, (n, k); no effect depends on the travel before.
    """
    hold, rows = _held(sent, given)
    q, least, idle = start[hold], torch.full((len(sent),), torch.inf, dtype=torch.float64), 0
    rank = translation_rank(mechanism)
    for turn in range(ROUNDS):
        view = view_of(q)
        step = _attainable(view.jacobian, goal - predict(terms, view).p, rank)
        size = torch.where(rows, _size(step), 0.0)
        idle = 0 if bool((rows & (size < NEARER * least)).any()) else idle + 1
        least = torch.minimum(least, size)
        if bool((size <= SETTLED).all()) or idle == IDLE or turn == ROUNDS - 1:
            break
        step[:given] = 0.0
        wanted = q + lead(least_move(view.jacobian, step, rank))
        q = torch.cat([start[:given], _assembled(mechanism, q, wanted, q)[hold][given:]])
    return q, torch.where(rows[:, None], step, torch.inf)


def _attainable(jacobian: Tensor, step: Tensor, rank: int) -> Tensor:
    """Part of a tool step that the joints can make, (n, 3) mm: all of it where dp/dq has rank 3."""
    if rank == step.shape[-1]:
        return step
    return (jacobian @ least_move(jacobian, step, rank)[..., None])[..., 0]


def _with_gaps_taken_up(terms: EffectTerms, view: View, wanted: Tensor, hold: Tensor, going: bool) -> Tensor:
    """Commands with every gap taken up, so that a joint inside its play does not stay there: the backlash inverse.

    Args:
        terms: effects with their parameters.
        view: the travel of the round before.
        wanted: commands that would be right with the play of that view, (n, k).
        hold: index of the row whose command holds at each row, (n,).
        going: whether the travel began before the first row.

    Returns:
        Commands half a gap ahead of the nuts, (n, k).
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
    """The backlashes among effects."""
    return [(effect, theta) for effect, theta in terms if isinstance(effect, Backlash)]


def open_gaps(gaps: EffectTerms, direction: Tensor, view: View) -> Tensor:
    """Command less nut position: half the gap ahead in the direction of travel.

    Where a joint turned on the way to a row and came back by less than a gap that is waited for, the nut is still in
    contact on the former side, and so much is taken off.

    Args:
        gaps: backlashes with their parameters.
        direction: of arrival, (n, k).
        view: the travel with its turning points.

    Returns:
        (n, k) mm or rad.
    """
    known = [gap_of(theta) for _, theta in gaps]
    none = torch.zeros(view.joints, dtype=direction.dtype)
    whole, gap = sum((gap for gap, _ in known), none), sum((gap for gap, waits in known if waits), none)
    back = (view.q - view.turning_point).abs()
    still = torch.where(back > STANDSTILL, (gap - back).clamp(min=0.0), 0.0)  # not taken up yet
    return (0.5 * whole - still) * direction


def _size(step: Tensor) -> Tensor:
    """Length of each step (n, 3), (n,); infinite where it is not a number."""
    return torch.nan_to_num(step.norm(dim=1), nan=torch.inf)


def _assembled(mechanism: Mechanism, best: Tensor, wanted: Tensor, here: Tensor) -> Tensor:
    """Commands shortened toward the best ones until the mechanism can be assembled; the best ones where none can."""
    q = torch.where(torch.isfinite(wanted).all(dim=1)[:, None], wanted, 0.5 * (best + here))
    for _ in range(HALVINGS):
        apart = ~torch.isfinite(mechanism.forward(q)).all(dim=1)
        if not bool(apart.any()):
            return q
        q = torch.where(apart[:, None], 0.5 * (best + q), q)
    return torch.where(torch.isfinite(mechanism.forward(q)).all(dim=1)[:, None], q, best)
