"""Commands and status of each target, and for targets that cannot be sent the nearest position that can."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.correct.commands import TOO_LARGE, sent_rows
from ptt.correct.doubt import from_other_side
from ptt.correct.lead import Lead, lead_of
from ptt.correct.nearest import Nearest, find_lines
from ptt.correct.newton import MISSED, gaps_of, invert, invert_together, open_gaps
from ptt.correct.task import CommandTask, Handover
from ptt.effects.memory import TravelBefore
from ptt.fitting.chunks import CHUNK, enter, stretches
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.workspace import NEAR_SINGULAR, OK, OUT_OF_REACH, OUT_OF_TRAVEL, near_singular, translation_rank
from ptt.model.chain import EffectTerms, predict
from ptt.run.beside import rows_beside
from ptt.run.table import take_rows
from ptt.run.view import View

SPARES = (1e-3, 1e-2, 0.1, 0.4, 1.0)  # margins tried in turn: shares of the line to a row that is not sent
PASSES = 4  # a row found not to be sent changes the travel of those behind it, which are then solved again


@dataclass(frozen=True)
class Solved:
    """Result of an inversion, n rows.

    Attributes:
        height: commands without reversal compensation, (n, k); a row that is not sent has those of the row before.
        q: commands with it, (n, k).
        missed: goal less position under `q`, (n, 3) mm; infinite where nothing was found.
        reached: rows with a solution, (n,) bool.
    """

    height: Tensor
    q: Tensor
    missed: Tensor
    reached: np.ndarray


@dataclass(frozen=True)
class Outcome:
    """Commands and status of n targets.

    Attributes:
        solved: their commands.
        status: (n,) str, as in `ptt.correct.commands`.
        shift_mm: size of the static correction, (n,); NaN where no command was found.
    """

    solved: Solved
    status: np.ndarray
    shift_mm: np.ndarray


def settle(task: CommandTask) -> Outcome:
    """Solve for commands, and give every row its status; a row that is not sent takes no part in the travel.

    Args:
        task: the targets.
    """
    status = _before(task)
    status[: task.given] = OUT_OF_REACH  # rows handed on are not solved again
    shift = np.where(status == TOO_LARGE, (task.asked - task.wanted).norm(dim=1).numpy(), np.nan)
    solved = _standing(task)
    for _ in range(PASSES):
        sent = sent_rows(status)
        if not sent.any():
            solved = _standing(task)
            break
        solved = _solve(task, sent)
        status = np.where(sent, _after(task, solved), status)
        shift = np.where(solved.reached, task.shift(solved.height).numpy(), shift)
        if (sent_rows(status) == sent).all():
            break
    return Outcome(solved, status, shift)


def hand_on(task: CommandTask, solved: Solved, rows: int, beside: int) -> Handover | None:
    """State for the rows behind a block.

    Args:
        task: the targets, in travel order.
        solved: their commands.
        rows: how many leading rows are done; the others were solved along as lookahead.
        beside: how many of these are handed on, at most.

    Returns:
        The state; None where nothing was sent so far.
    """
    if task.handover is None and not solved.reached[:rows].any():
        return None
    first = max(rows - beside, 0)
    view = task.view_of(solved.q)
    turned = view.turning_point[first] - view.q[first]
    travel = TravelBefore(enter(view, [first])[0], view.direction[first], turned)
    sent = solved.reached & torch.isfinite(solved.missed).all(dim=1).numpy()
    other = from_other_side(task, view) if task.reversing else None
    side = None if other is None else enter(other, [first])[0]
    return Handover(travel, solved.height[first:rows], solved.q[first:rows], task.positions(sent)[first:rows], side)


def nearest_commands(task: CommandTask, rows: np.ndarray, nearest: Nearest) -> tuple[np.ndarray, np.ndarray]:
    """For targets that are not sent, commands of the nearest position that can be, on the line from one that is.

    Args:
        task: the targets.
        rows: those that are not sent, (m,) int.
        nearest: positions -> the nearest targets that are sent, and their joint values; None where none is sent.

    Returns:
        Commands (n, k) without reversal, and the distance (n,) mm of their position from the target; NaN where there
        are none.
    """
    q, distance = np.full(task.nominal.shape, np.nan), np.full(len(task.nominal), np.nan)
    for first, last in stretches(len(rows), CHUNK):
        here = rows[first:last]
        q[here], distance[here] = _nearest(task, here, nearest)
    return q, distance


def _nearest(task: CommandTask, rows: np.ndarray, nearest: Nearest) -> tuple[np.ndarray, np.ndarray]:
    """`nearest_commands` of some rows (m,) int: commands (m, k) and distances (m,)."""
    q, distance = np.full((len(rows), task.nominal.shape[1]), np.nan), np.full(len(rows), np.nan)
    goal = task.wanted[rows]
    lines, table = find_lines(task.mechanism, goal, nearest), take_rows(task.targets, rows)
    for spare in SPARES:
        place, start = lines.last_positions(spare)
        asked = place if task.correction is None else torch.as_tensor(task.correction(place.numpy(), start.numpy()))
        part = replace(
            task, targets=table, wanted=place, asked=asked, in_domain=task.in_domain[rows], nominal=start,
            start=start, reversing=(), clock=None, time=task.time[rows],
            behind=None if task.behind is None else task.behind[rows],
        )  # fmt: skip
        found = settle(part)
        better = (found.status == OK) & found.solved.reached & np.isnan(distance)
        q[better] = found.solved.q.numpy()[better]
        distance[better] = (place - goal).norm(dim=1).numpy()[better]
        if np.isfinite(distance).all():
            break
    return q, distance


def first_order(mechanism: Mechanism, wanted: Tensor, height: Tensor, sent: np.ndarray) -> Tensor:
    """First-order commands H_m(b - db) = f(p) - J_a dp (eq. 13 of the source paper), dp = p - N(p), N(p) what is asked.

    J_a is taken half-way, at p - dp/2, where the error of the first-order form is of third order in dp.

    Args:
        mechanism: the nominal mechanism.
        wanted: targets, (n, 3) mm.
        height: exact commands without reversal compensation, (n, k).
        sent: rows that have such commands, (n,) bool.

    Returns:
        (n, k); NaN in the other rows.
    """
    rows, inverse = torch.as_tensor(sent), mechanism.inverse
    near, wanted, simple = height[rows], wanted[rows], torch.full_like(height, torch.nan)
    shift = wanted - mechanism.forward(near)
    move = least_move(mechanism.jacobian(inverse(wanted - 0.5 * shift, None, near)), shift, translation_rank(mechanism))
    simple[rows] = inverse(wanted, None, near) - move
    return simple


def _before(task: CommandTask) -> np.ndarray:
    """Status of each row by drawing and network, before the model is inverted; later lines take precedence."""
    status = np.full(len(task.wanted), OK, dtype=object)
    status[near_singular(task.mechanism, task.wanted, task.nominal).numpy()] = NEAR_SINGULAR
    status[~((task.asked - task.wanted).norm(dim=1) <= task.limit).numpy()] = TOO_LARGE
    status[~torch.isfinite(task.start).all(dim=1).numpy()] = OUT_OF_REACH
    return status


def _standing(task: CommandTask) -> Solved:
    """Commands where no row is sent: where the rows before left the machine, else the start of the search."""
    height = q = task.start
    if task.handover is not None:
        last = torch.arange(len(q)).clamp(max=task.given - 1)
        height, q = task.handover.height[last], task.handover.q[last]
    return Solved(height, q, torch.full_like(task.asked, torch.inf), np.zeros(len(q), dtype=bool))


def _solve(task: CommandTask, sent: np.ndarray) -> Solved:
    """Commands, first for the steady effects alone, then with those that depend on direction or travel.

    Newton's method starts from the task's own start in every pass, since an arm's posture follows its start.
    """
    given, before, task = np.arange(len(sent)) < task.given, task.handover, task.paced(sent)
    near = task.start if before is None else torch.cat([before.height, task.start[task.given :]])
    lead, goal = _lead(task, sent), (task.asked, sent, task.given)
    if lead is None:
        height, step = invert(task.steady, task.mechanism, task.view_of, near, *goal)
    else:
        height, step = invert_together(task.steady, task.mechanism, task.view_of, near, *goal, lead)
    reached = sent & (step.abs().amax(dim=1) < MISSED).numpy()
    if not reached.any():
        return replace(_standing(task), missed=step)
    if not task.reversing:
        return Solved(height, height, _missed(task, task.steady, height, step), reached)
    height = height[torch.as_tensor(rows_beside(reached | given))]
    opened = _opened(height, task.reversing, task.view_of(height))
    opened = opened if before is None else torch.cat([before.q, opened[task.given :]])
    terms = [*task.steady, *task.reversing]
    if task.pace is not None:  # a gap is crossed while the axis stands: lags do not follow that motion
        task = replace(task, velocity=torch.as_tensor(task.pace.velocity(height.numpy())))
    q, left = invert(terms, task.mechanism, task.view_of, opened, task.asked, reached, task.given)
    reached = reached & torch.isfinite(left).all(dim=1).numpy()
    return Solved(height, q, _missed(task, terms, q, left), reached)


def _missed(task: CommandTask, terms: EffectTerms, q: Tensor, left: Tensor) -> Tensor:
    """Goal less position, (n, 3) mm: `left`, and for rank below 3 also the part that no joint can correct."""
    if translation_rank(task.mechanism) == 3:
        return left
    return torch.where(left.isfinite().all(dim=1)[:, None], task.asked - predict(terms, task.view_of(q)).p, left)


def _after(task: CommandTask, solved: Solved) -> np.ndarray:
    """Status of each row by its commands; later lines take precedence."""
    limits = task.mechanism.limits().T
    status = np.full(len(solved.q), OK, dtype=object)
    status[((solved.q < limits[:, 0]) | (solved.q > limits[:, 1])).any(dim=1).numpy()] = OUT_OF_TRAVEL
    shift = torch.maximum(task.shift(solved.height), task.shift(solved.q))
    status[~(shift <= task.limit).numpy()] = TOO_LARGE
    status[~solved.reached] = OUT_OF_REACH
    return status


def _lead(task: CommandTask, sent: np.ndarray) -> Lead | None:
    """The factored systems that make commands lead lagging axes; None where no axis lags."""
    if task.pace is None or not task.lags:
        return None
    given = np.arange(len(sent)) < task.given
    return lead_of(task.pace, task.lag.numpy(), rows_beside(sent | given), sent & ~given)


def _opened(height: Tensor, reversing: EffectTerms, view: View) -> Tensor:
    """Commands half the gap ahead in the direction of travel, the backlash inverse, as a start for all reversals."""
    return height + open_gaps(gaps_of(reversing), view.direction, view)
