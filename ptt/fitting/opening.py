"""Rows at which it is unknown on which side of its play a joint is: they open a run, or no force decides it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from ptt.effects import Effect
from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.direction import STANDSTILL
from ptt.run.noise import Noise
from ptt.run.problem import Problem

MOST_FIRST = 0.1  # greatest share of the rows that may open a run and be left out for it: of short runs one in ten
# Greatest share that may be left out where it is known what remembers: beyond, hardly a row would be left to show it
MOST_REMEMBERING = 0.25
MOST_IN_TURN = 0.4  # that share where joints are moved one after another, and each but the first waits for its turn
LEAST_IN_TURN = 0.05  # share of rows in which some joints have moved and others not, from which they are
MOST_UNDECIDED = 0.25  # greatest share at which errors of the drawing may decide on which side a pin lies
MOST_ENTERING = 0.5  # greatest share that a first fit leaves out: it has only to tell which rows remember
MATTERS_SIGMA = 1.0  # standard deviations of a reading from which it matters how a run was entered
# nats that a wrong guess of it may give to whatever else begins early in a run: about the price of a name
AT_STAKE_NATS = 10.0


def opening_rows(problem: Problem) -> np.ndarray:
    """The rows of a run before it first moves, whose direction of arrival, and so the side of any play, is unknown.

    Args:
        problem: n rows.

    Returns:
        (n,) bool; none where they are more than a few, or where directions do not vary.
    """
    view = problem.view
    starts, q = view.starts.numpy(), view.q.numpy()
    moves = np.cumsum((np.abs(np.diff(q, axis=0, prepend=q[:1])) > STANDSTILL).any(axis=1) & ~starts)
    still = moves == np.maximum.accumulate(np.where(starts, moves, 0))
    first = problem.used & still & (view.direction.numpy() != 0.0).any(axis=1)
    few = "direction" in view.varies and first.sum() < MOST_FIRST * problem.used.sum()
    return first if few else np.zeros_like(first)


def entering_rows(problem: Problem) -> np.ndarray:
    """The rows of a run in which some joints have moved and others, that will, have not: each may stand on either side.

    Where joints are moved one after the other these are many, and a fit to all rows takes how they were left for slow
    effects. A fit without them tells which rows remember.

    Args:
        problem: n rows.

    Returns:
        (n,) bool, the rows before a run first moves included; none where every joint moves at once, or where more than
        half of the rows would go.
    """
    some, partly = _waiting(problem)
    few = some.sum() < MOST_ENTERING * problem.used.sum()
    return some if few and _in_turn(partly, problem) else np.zeros_like(some)


def _waiting(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Rows in which a joint that will move in its run has not yet, and those in which another has, (n,) bool each."""
    view = problem.view
    starts, q = view.starts.numpy(), view.q.numpy()
    moves = (np.abs(np.diff(q, axis=0, prepend=q[:1])) > STANDSTILL) & ~starts[:, None]
    some, partly = np.zeros(len(q), dtype=bool), np.zeros(len(q), dtype=bool)
    for rows in np.split(np.arange(len(q)), np.flatnonzero(starts)[1:]):
        will = moves[rows].any(axis=0)
        waiting = ~np.logical_or.accumulate(moves[rows]) & will
        some[rows] = waiting.any(axis=1)
        partly[rows] = waiting.any(axis=1) & (waiting != will).any(axis=1)
    return some & problem.used, partly & problem.used


def _in_turn(partly: np.ndarray, problem: Problem) -> bool:
    """Whether joints begin to move one after another, by the second rows of `_waiting`: so many that they matter."""
    return bool(partly.sum() > LEAST_IN_TURN * problem.used.sum())


def remembering_rows(terms: Sequence[Term], problem: Problem, noise: Noise) -> np.ndarray:
    """Rows whose readings still depend on the direction in which the run was entered, under fitted reversing effects.

    On a path of small steps, a drive that winds up takes dozens of rows to turn over.

    Args:
        terms: of a fitted model.
        problem: n rows.
        noise: the noise floor.

    Returns:
        (n,) bool; none where they matter too little to imitate another effect, or where they are too many.
    """
    view, none = problem.view, np.zeros(problem.table.rows, dtype=bool)
    known = [(term.effect, term.theta) for term in terms if term.effect.reverses and len(term.theta)]
    if not known:
        return none
    other = replace(view, direction=torch.where(view.starts[:, None], -view.direction, view.direction))
    shifts = [
        effect.shift(theta, view) - effect.shift(theta, other) for effect, theta in known if _is_of_joints(effect)
    ]
    apart = torch.stack([torch.zeros_like(view.q), *shifts]).sum(dim=0)
    moved = noise.whitener @ (view.jacobian * apart[:, None, :]).numpy()  # shape: (n, 3, k)
    square = np.square(moved).sum(axis=(1, 2))
    if elsewhere := [(effect, theta) for effect, theta in known if not _is_of_joints(effect)]:
        there = (predict(elsewhere, view).reading - predict(elsewhere, other).reading).numpy()
        square += np.square(there @ noise.whitener.T).sum(axis=1)
    told = problem.used & (square > MATTERS_SIGMA**2)
    most = MOST_IN_TURN if _in_turn(_waiting(problem)[1], problem) else MOST_REMEMBERING
    few = told.sum() < most * problem.used.sum()
    return told if few and 0.5 * square[told].sum() > AT_STAKE_NATS else none


def _is_of_joints(effect: Effect) -> bool:
    return effect.stage == "drive"


def undecided_rows(terms: Sequence[Term], problem: Problem) -> np.ndarray:
    """Rows at which errors of the drawing may change the side of a joint's play under a fitted effect.

    Play that is on the wrong side at all visits of two poses would look like an unknown.

    Args:
        terms: of a fitted model.
        problem: n rows.

    Returns:
        (n,) bool; none where they are too many.
    """
    sides = [term.effect.undecided(problem.view).numpy() for term in terms if len(term.theta)]
    told = problem.used & np.any(sides, axis=0) if sides else np.zeros(problem.table.rows, dtype=bool)
    return told if told.sum() < MOST_UNDECIDED * problem.used.sum() else np.zeros_like(told)


def untold_rows(terms: Sequence[Term], problem: Problem, noise: Noise) -> np.ndarray:
    """Rows of `remembering_rows` or `undecided_rows`, (n,) bool."""
    return remembering_rows(terms, problem, noise) | undecided_rows(terms, problem)


def told_aside(rows: int) -> str:
    """Words on rows that were set aside.

    Args:
        rows: that are left aside, one at the least.
    """
    which, their = ("one row", "its") if rows == 1 else (f"{rows} rows", "their")
    return f"{which} set aside: {their} direction of arrival, or the side on which a pin lies, is unknown"


def without_opening(problem: Problem, rows: np.ndarray) -> Problem:
    """The problem with some rows masked and without readings, so that they do not date events either.

    Args:
        problem: n rows.
        rows: which to leave out, (n,) bool.
    """
    if not rows.any():
        return problem
    left = torch.as_tensor(~rows)
    read = left if problem.view.read is None else problem.view.read & left
    return replace(problem.masked(rows), view=replace(problem.view, read=read))
