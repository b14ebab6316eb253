"""Joints to spare: sliding along an arm's self-motion without moving the tool."""

import torch
from torch import Tensor

from ptt.mechanisms.serial_descent import LONGEST_STEP_RAD, TOLERANCE_MM, PoseTask, descend, free_columns, length

STEPS = 60
STILL_RAD = 1e-7  # slope along the self-motion below which a row has arrived
GIVE_UP = 1e-4


def settle(task: PoseTask, q: Tensor, near: Tensor) -> tuple[Tensor, Tensor]:
    """Slide along the self-motion until joint values are as close to given ones as they can be nearby.

    Gradient projection (Liegeois, Automatic supervisory control of multibody mechanisms, 1977): a step in the null
    space of the task's Jacobian, then back onto the task; a step that does not help is shortened.

    Args:
        task: n poses.
        q: (n, k) joint values that reach them, rad.
        near: (n, k) joint values to stay close to, rad.

    Returns:
        (n, k) joint values that reach the poses still, rad, and (n,) what is left to go, mm.
    """
    q, error = q.clone(), length(task.error(q))
    gain = torch.ones_like(error)
    apart = (q - near).square().sum(-1)
    for _ in range(STEPS):
        slope = _null_part(task, q, near - q)
        rows = torch.nonzero((slope.abs().amax(-1) > STILL_RAD) & (gain > GIVE_UP)).flatten()
        if not len(rows):
            break
        part = task.rows(rows)
        step = gain[rows, None] * slope[rows]
        step = step * (LONGEST_STEP_RAD / step.abs().amax(-1, keepdim=True).clamp(min=LONGEST_STEP_RAD))
        trial, trial_error = descend(part, q[rows] + step)
        trial_apart = (trial - near[rows]).square().sum(-1)
        better = (trial_error < TOLERANCE_MM) & (trial_apart < apart[rows])
        kept = rows[better]
        q[kept], error[kept], apart[kept] = trial[better], trial_error[better], trial_apart[better]
        gain[rows] = gain[rows] * torch.where(better, 1.5, 0.25)
    return q, error


def _null_part(task: PoseTask, q: Tensor, uphill: Tensor) -> Tensor:
    """Part (n, k) of a direction that leaves the tool where it is, joints held that would leave their limits."""
    free = free_columns(task, q, uphill)
    jacobian = task.jacobian(q) * free[:, None, :]
    wanted = (uphill * free)[..., None]
    tiny = 1e-12 * task.arm.length_mm**2 * torch.eye(jacobian.shape[-2], dtype=q.dtype)
    lost = jacobian.mT @ torch.linalg.solve(jacobian @ jacobian.mT + tiny, jacobian @ wanted)
    return ((wanted - lost) * free[..., None]).squeeze(-1)
