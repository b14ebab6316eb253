"""Inverse kinematics of serial arms: damped least squares on all rows at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.mechanisms.serial_descent import TOLERANCE_MM, Arm, PoseTask, descend, length
from ptt.mechanisms.serial_redundancy import slide_toward

STARTS = 12  # restarts of a row that does not converge from its first start
CANDIDATES = 1024  # sampled joint values from which the restarts are chosen
BENT_RAD = 0.4  # added to each joint: in the middle of the limits an arm is often stretched, which is singular
ROWS_AT_ONCE = 20_000  # so that memory does not grow with the number of poses


@dataclass(frozen=True)
class InverseResult:
    """Result of an inverse kinematics.

    Attributes:
        q: (n, k) joint values, rad; NaN rows where the target was not reached.
        converged: (n,) bool.
        error_mm: (n,) pose error left at the best joint values; an orientation error counts times `Serial.length_mm`.
    """

    q: Tensor
    converged: Tensor
    error_mm: Tensor


@torch.no_grad()
def solve_inverse(
    arm: Arm,
    p: Tensor,
    *,
    rotation: Tensor | None = None,
    geometry: Tensor | None = None,
    near: Tensor | None = None,
    starts: int = STARTS,
) -> InverseResult:
    """Find joint values within the limits that reach tool positions or poses.

    Damped least squares (Levenberg-Marquardt) from `near`, then, for rows that did not converge, from those of the
    sampled joint values whose poses lie closest. The answer of a redundant arm then slides along the self-motion as
    close to `near` as it can (a local optimum).

    Args:
        arm: the arm.
        p: (n, 3) tool positions, mm.
        rotation: (n, 3, 3) tool orientations; None leaves the orientation free.
        geometry: (n, G) or (1, G) errors of the geometry slots; None for the drawing.
        near: (n, k) or (1, k) joint values to start from, rad; None for the bent middle of the limits.
        starts: how many restarts a row gets.

    Returns:
        Joint values, which rows converged, and the pose error left.
    """
    task = PoseTask(arm, p, rotation, geometry)
    first = (middle(arm)[None] if near is None else near).expand(len(p), -1)
    parts = torch.arange(len(p)).split(ROWS_AT_ONCE)
    solved = [_solve(task.rows(rows), first[rows], starts) for rows in parts] or [_solve(task, first, 0)]
    q, error = (torch.cat(items) for items in zip(*solved, strict=True))
    converged = error < TOLERANCE_MM
    return InverseResult(torch.where(converged[:, None], q, math.nan), converged, error)


def middle(arm: Arm) -> Tensor:
    """Joint values to start from when nothing better is known: the middle of the limits plus `BENT_RAD`.

    Args:
        arm: the arm.

    Returns:
        (k,) rad, within the limits.
    """
    low, high = finite_limits(arm)
    return torch.minimum((low + high) / 2 + BENT_RAD, high)


def sample_joints(arm: Arm, count: int) -> Tensor:
    """Sample joint values evenly over the limits (a Sobol sequence; one turn where a joint has no limit).

    Args:
        arm: the arm.
        count: how many.

    Returns:
        (count, k) rad, the same at every call.
    """
    low, high = finite_limits(arm)
    engine = torch.quasirandom.SobolEngine(arm.joints, scramble=True, seed=0)
    return low + (high - low) * engine.draw(count, dtype=torch.float64)


def _solve(task: PoseTask, first: Tensor, starts: int) -> tuple[Tensor, Tensor]:
    """Joint values (n, k) and pose errors (n,) mm, infinite out of reach, from first starts (n, k) and restarts."""
    q, error = first.clone(), torch.full_like(task.p[:, 0], math.inf)
    inside = torch.isfinite(task.p).all(-1) & torch.isfinite(first).all(-1) & (length(task.p) <= _farthest(task))
    rows = torch.nonzero(inside).flatten()
    if not len(rows):
        return q, error
    q[rows], error[rows] = descend(task.rows(rows), first[rows])
    _retry(task, q, error, rows[error[rows] >= TOLERANCE_MM], starts)
    done = torch.nonzero(error < TOLERANCE_MM).flatten()
    if len(done) and task.arm.joints > (3 if task.rotation is None else 6):
        q[done], error[done] = slide_toward(task.rows(done), q[done], first[done])
    return q, error


def _retry(task: PoseTask, q: Tensor, error: Tensor, rows: Tensor, starts: int) -> None:
    """Start the given rows again from joint values whose poses are close; better answers go into `q` and `error`."""
    if not len(rows) or not starts:
        return
    candidates = sample_joints(task.arm, CANDIDATES)
    order = _closest(task.rows(rows), candidates, starts)
    for start in order.T:
        left = error[rows] >= TOLERANCE_MM
        if not left.any():
            return
        again = rows[left]
        trial, trial_error = descend(task.rows(again), candidates[start[left]])
        better = trial_error < error[again]
        q[again[better]], error[again[better]] = trial[better], trial_error[better]


def _closest(task: PoseTask, candidates: Tensor, count: int) -> Tensor:
    """Numbers (n, count) of the candidates whose poses lie closest to the task's, the closest first."""
    p, rotation = task.arm.pose(candidates)
    if task.rotation is None:
        return torch.cdist(task.p, p).topk(count, largest=False).indices
    here = torch.cat([p, task.arm.length_mm * rotation.flatten(1)], -1)
    there = torch.cat([task.p, task.arm.length_mm * task.rotation.flatten(1)], -1)
    return torch.cdist(there, here).topk(count, largest=False).indices


def finite_limits(arm: Arm) -> tuple[Tensor, Tensor]:
    """Ends of travel, (k,) rad each, half a turn either way where a joint has no limit."""
    low, high = arm.limits()
    open_ = torch.isinf(low) | torch.isinf(high)
    return torch.where(open_, -math.pi, low), torch.where(open_, math.pi, high)


def _farthest(task: PoseTask) -> float | Tensor:
    """Upper bound on the distance of the tool from the base, mm, with room for geometry errors."""
    room = 0.0 if task.geometry is None else task.geometry.abs().sum(-1)
    return task.arm.reach_mm + room
