"""Targets turned into commands: what is sent to each row, what becomes of it, and the nearest place that works."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.correct.commands import NEAR_SINGULAR, OK, OUT_OF_REACH, OUT_OF_TRAVEL, TOO_LARGE, sent_rows
from ptt.correct.lead import Lead, lead_of
from ptt.correct.nearest import Nearest, find_ways
from ptt.correct.newton import MISSED, gaps_of, holding, invert, invert_together, open_gaps
from ptt.correct.task import CommandTask, Handover
from ptt.effects.memory import TravelBefore
from ptt.fitting.chunks import CHUNK, enter, stretches
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.workspace import near_singular, translation_rank
from ptt.model.chain import EffectTerms, predict
from ptt.run.table import take_rows
from ptt.run.view import View

SPARES = (1e-3, 1e-2, 0.1, 0.4, 1.0)  # shares of the way to a row that is not sent, left unused one after the other
PASSES = 4  # rows that are not sent change the travel of those behind them


@dataclass(frozen=True)
class Solved:
    """What an inversion ends with, n rows.

    Attributes:
        height: commands without reversal compensation, (n, k); rows that are not sent hold the row before.
        q: commands with it, (n, k).
        missed: by how much these miss, (n, 3) mm; infinite where nothing was found.
        reached: rows that the effects without reversal let get there, (n,) bool.
    """

    height: Tensor
    q: Tensor
    missed: Tensor
    reached: np.ndarray


@dataclass(frozen=True)
class Outcome:
    """What becomes of n targets.

    Attributes:
        solved: their commands.
        status: (n,) str, as in `ptt.correct.commands`.
        shift_mm: static correction, (n,); NaN where no command was found.
    """

    solved: Solved
    status: np.ndarray
    shift_mm: np.ndarray


def settle(task: CommandTask) -> Outcome:
    """Invert what can be inverted, and say of every row what becomes of it.

    Args:
        task: the targets.
    """
    status = _before(task)
    status[: task.given] = OUT_OF_REACH  # they are done with
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
    """What the rows behind must know of those before them.

    Args:
        task: the targets, in travel order.
        solved: their commands.
        rows: how many of them are before; those behind were looked at on the way only.
        beside: how many of them are handed on, at most.

    Returns:
        It; None where nothing was sent so far.
    """
    if task.handover is None and not solved.reached[:rows].any():
        return None
    first = max(rows - beside, 0)
    view = task.see(solved.q)
    turned = view.turning_point[first] - view.q[first]
    travel = TravelBefore(enter(view, [first])[0], view.direction[first], turned)
    sent = solved.reached & torch.isfinite(solved.missed).all(dim=1).numpy()
    return Handover(travel, solved.height[first:rows], solved.q[first:rows], task.stands(sent)[first:rows])


def nearest_commands(task: CommandTask, rows: np.ndarray, nearest: Nearest) -> tuple[np.ndarray, np.ndarray]:
    """Commands that work beside targets that are not sent.

    Args:
        task: the targets.
        rows: those that are not sent, (m,) int.
        nearest: from places to those that are sent nearest, and their joint values; None where there are none.

    Returns:
        Commands (n, k) of the last places that work on the way, without reversal, and the distance (n,) mm from there
        to the target; NaN where there are none.
    """
    q, distance = np.full(task.nominal.shape, np.nan), np.full(len(task.nominal), np.nan)
    for first, last in stretches(len(rows), CHUNK):
        here = rows[first:last]
        q[here], distance[here] = _nearest(task, here, nearest)
    return q, distance


def _nearest(task: CommandTask, rows: np.ndarray, nearest: Nearest) -> tuple[np.ndarray, np.ndarray]:
    """The same for some rows that are not sent, (m,) int."""
    q, distance = np.full((len(rows), task.nominal.shape[1]), np.nan), np.full(len(rows), np.nan)
    goal = task.wanted[rows]
    ways, table = find_ways(task.mechanism, goal, nearest), take_rows(task.targets, rows)
    for spare in SPARES:
        place, start = ways.places(spare)
        part = replace(
            task, targets=table, wanted=place, asked=place, nominal=start, start=start, reversing=(), clock=None,
            time=task.time[rows],
        )  # fmt: skip
        found = settle(part)
        better = (found.status == OK) & found.solved.reached & np.isnan(distance)
        q[better] = found.solved.q.numpy()[better]
        distance[better] = (place - goal).norm(dim=1).numpy()[better]
        if np.isfinite(distance).all():
            break
    return q, distance


def first_order(mechanism: Mechanism, wanted: Tensor, height: Tensor, sent: np.ndarray) -> Tensor:
    """H_m(b - db) = f(p) - J_a dp (eq. 13 of the source paper) with dp = p - N(p), N the corrected target.

    J_a is taken half-way, at p - dp/2: there the first-order form is good to the third order in dp.

    Args:
        mechanism: the nominal one.
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
    """What the drawing and the network say of each row, before the model is asked; the gravest last."""
    status = np.full(len(task.wanted), OK, dtype=object)
    status[near_singular(task.mechanism, task.wanted, task.nominal).numpy()] = NEAR_SINGULAR
    status[~((task.asked - task.wanted).norm(dim=1) <= task.limit).numpy()] = TOO_LARGE
    status[~torch.isfinite(task.start).all(dim=1).numpy()] = OUT_OF_REACH
    return status


def _standing(task: CommandTask) -> Solved:
    """Before anything was sent: where the rows before left the machine, else where the search will begin."""
    height = q = task.start
    if task.handover is not None:
        last = torch.arange(len(q)).clamp(max=task.given - 1)
        height, q = task.handover.height[last], task.handover.q[last]
    return Solved(height, q, torch.full_like(task.asked, torch.inf), np.zeros(len(q), dtype=bool))


def _solve(task: CommandTask, sent: np.ndarray) -> Solved:
    """Commands: first for the steady effects, then for those that remember the way.

    The search begins where the task says, whatever came before: an arm's posture follows its start.
    """
    given, before, task = np.arange(len(sent)) < task.given, task.handover, task.paced(sent)
    near = task.start if before is None else torch.cat([before.height, task.start[task.given :]])
    lead, goal = _lead(task, sent), (task.asked, sent, task.given)
    if lead is None:
        height, step = invert(task.steady, task.mechanism, task.see, near, *goal)
    else:
        height, step = invert_together(task.steady, task.mechanism, task.see, near, *goal, lead)
    reached = sent & (step.abs().amax(dim=1) < MISSED).numpy()
    if not reached.any():
        return replace(_standing(task), missed=step)
    if not task.reversing:
        return Solved(height, height, _missed(task, task.steady, height, step), reached)
    height = height[torch.as_tensor(holding(reached | given))]
    opened = _opened(height, task.reversing, task.see(height))
    opened = opened if before is None else torch.cat([before.q, opened[task.given :]])
    terms = [*task.steady, *task.reversing]
    if task.pace is not None:  # a gap is crossed at once while the slider stands: no motion that anything lags behind
        task = replace(task, velocity=torch.as_tensor(task.pace.velocity(height.numpy())))
    q, left = invert(terms, task.mechanism, task.see, opened, task.asked, reached, task.given)
    reached = reached & torch.isfinite(left).all(dim=1).numpy()
    return Solved(height, q, _missed(task, terms, q, left), reached)


def _missed(task: CommandTask, terms: EffectTerms, q: Tensor, left: Tensor) -> Tensor:
    """By how much commands miss, (n, 3) mm: what joints could still do, `left`, and what lies across their plane."""
    if translation_rank(task.mechanism) == 3:
        return left
    return torch.where(left.isfinite().all(dim=1)[:, None], task.asked - predict(terms, task.see(q)).p, left)


def _after(task: CommandTask, solved: Solved) -> np.ndarray:
    """What becomes of each row once the model has been asked; the gravest last."""
    limits = task.mechanism.limits().T
    status = np.full(len(solved.q), OK, dtype=object)
    status[((solved.q < limits[:, 0]) | (solved.q > limits[:, 1])).any(dim=1).numpy()] = OUT_OF_TRAVEL
    shift = torch.maximum(task.shift(solved.height), task.shift(solved.q))
    status[~(shift <= task.limit).numpy()] = TOO_LARGE
    status[~solved.reached] = OUT_OF_REACH
    return status


def _lead(task: CommandTask, sent: np.ndarray) -> Lead | None:
    """How commands run ahead of axes that lag; None where none does."""
    if task.pace is None or not task.late:
        return None
    given = np.arange(len(sent)) < task.given
    return lead_of(task.pace, task.lag.numpy(), holding(sent | given), sent & ~given)


def _opened(height: Tensor, reversing: EffectTerms, view: View) -> Tensor:
    """Commands half the gap ahead in the direction of travel: the exact inverse of the play operator."""
    return height + open_gaps(gaps_of(reversing), view.direction, view)
