"""Joints to spare: sliding along an arm's self-motion without moving the tool."""

import math
from typing import Literal

import torch
from torch import Tensor

from ptt.mechanisms.serial_descent import LONGEST_STEP_RAD, TOLERANCE_MM, PoseTask, descend, free_columns, length

Redundancy = Literal["near", "manipulability"]

STEPS = 60
STILL_RAD = 1e-7  # slope along the self-motion below which a row has arrived
GIVE_UP = 1e-4
FIRST_GAIN = {"near": 1.0, "manipulability": 0.1}


def settle(task: PoseTask, q: Tensor, near: Tensor, redundancy: Redundancy) -> tuple[Tensor, Tensor]:
    """Slide along the self-motion until a second wish is met as well as it can be nearby.

    Gradient projection (Liegeois, Automatic supervisory control of multibody mechanisms, 1977): a step in the null
    space of the task's Jacobian, then back onto the task; a step that does not help is shortened.

    Args:
        task: n poses.
        q: (n, k) joint values that reach them, rad.
        near: (n, k) joint values to stay close to, rad.
        redundancy: "near", or "manipulability" for the largest sqrt(det J J^T).

    Returns:
        (n, k) joint values that reach the poses still, rad, and (n,) what is left to go, mm.
    """
    q, error = q.clone(), length(task.error(q))
    gain = torch.full_like(error, FIRST_GAIN[redundancy])
    value, uphill = _wish(task, q, near, redundancy)
    for _ in range(STEPS):
        slope = _null_part(task, q, uphill)
        rows = torch.nonzero((slope.abs().amax(-1) > STILL_RAD) & (gain > GIVE_UP)).flatten()
        if not len(rows):
            break
        part = task.rows(rows)
        step = gain[rows, None] * slope[rows]
        step = step * (LONGEST_STEP_RAD / step.abs().amax(-1, keepdim=True).clamp(min=LONGEST_STEP_RAD))
        trial, trial_error = descend(part, q[rows] + step)
        trial_value, trial_uphill = _wish(part, trial, near[rows], redundancy)
        better = (trial_error < TOLERANCE_MM) & (trial_value > value[rows])
        kept = rows[better]
        q[kept], error[kept] = trial[better], trial_error[better]
        value[kept], uphill[kept] = trial_value[better], trial_uphill[better]
        gain[rows] = gain[rows] * torch.where(better, 1.5, 0.25)
    return q, error


def _wish(task: PoseTask, q: Tensor, near: Tensor, redundancy: Redundancy) -> tuple[Tensor, Tensor]:
    """Value (n,) of the second wish and its slope (n, k) by the joints."""
    if redundancy == "near":
        return -(q - near).square().sum(-1) / 2, near - q
    with torch.enable_grad():
        leaf = q.detach().requires_grad_()
        jacobian = task.jacobian(leaf) / task.arm.length_mm
        tiny = 1e-12 * torch.eye(jacobian.shape[-2], dtype=q.dtype)
        value = torch.logdet(jacobian @ jacobian.mT + tiny) / 2
        (slope,) = torch.autograd.grad(value.sum(), leaf)
    return value.detach().nan_to_num(-math.inf), slope.nan_to_num(0.0)


def _null_part(task: PoseTask, q: Tensor, uphill: Tensor) -> Tensor:
    """Part (n, k) of a direction that leaves the tool where it is, joints held that would leave their limits."""
    free = free_columns(task, q, uphill)
    jacobian = task.jacobian(q) * free[:, None, :]
    wanted = (uphill * free)[..., None]
    tiny = 1e-12 * task.arm.length_mm**2 * torch.eye(jacobian.shape[-2], dtype=q.dtype)
    lost = jacobian.mT @ torch.linalg.solve(jacobian @ jacobian.mT + tiny, jacobian @ wanted)
    return ((wanted - lost) * free[..., None]).squeeze(-1)
