"""Redundant arms: motion in the null space of the Jacobian, which leaves the tool where it is."""

import torch
from torch import Tensor

from ptt.mechanisms.serial_descent import LONGEST_STEP_RAD, TOLERANCE_MM, PoseTask, descend, free_joints, length

STEPS = 60  # at most
STILL_RAD = 1e-7  # null-space part of the way to `near` below which a row has arrived
LEAST_GAIN = 1e-4  # share of the full step below which a row is left where it is


def slide_toward(task: PoseTask, q: Tensor, near: Tensor) -> tuple[Tensor, Tensor]:
    """Slide along the self-motion to the joint values that are closest to given ones (a local optimum).

    Gradient projection (Liegeois, Automatic supervisory control of multibody mechanisms, 1977): a step in the null
    space of the task's Jacobian, then back onto the task by `descend`; a step that does not help is shortened.

    Args:
        task: n poses.
        q: (n, k) joint values that reach them, rad.
        near: (n, k) joint values to stay close to, rad.

    Returns:
        (n, k) joint values that still reach the poses, rad, and (n,) length of the pose error that is left, mm.
    """
    q, error = q.clone(), length(task.error(q))
    gain = torch.ones_like(error)
    distance = (q - near).square().sum(-1)
    for _ in range(STEPS):
        slope = _null_part(task, q, near - q)
        rows = torch.nonzero((slope.abs().amax(-1) > STILL_RAD) & (gain > LEAST_GAIN)).flatten()
        if not len(rows):
            break
        part = task.rows(rows)
        step = gain[rows, None] * slope[rows]
        step = step * (LONGEST_STEP_RAD / step.abs().amax(-1, keepdim=True).clamp(min=LONGEST_STEP_RAD))
        trial, trial_error = descend(part, q[rows] + step)
        trial_distance = (trial - near[rows]).square().sum(-1)
        better = (trial_error < TOLERANCE_MM) & (trial_distance < distance[rows])
        kept = rows[better]
        q[kept], error[kept], distance[kept] = trial[better], trial_error[better], trial_distance[better]
        gain[rows] = gain[rows] * torch.where(better, 1.5, 0.25)
    return q, error


def _null_part(task: PoseTask, q: Tensor, direction: Tensor) -> Tensor:
    """Projection of a joint direction on the null space of the Jacobian, (n, k); joints are held at their limits."""
    free = free_joints(task, q, direction)
    jacobian = task.jacobian(q) * free[:, None, :]
    wanted = (direction * free)[..., None]
    tiny = 1e-12 * task.arm.length_mm**2 * torch.eye(jacobian.shape[-2], dtype=q.dtype)
    in_row_space = jacobian.mT @ torch.linalg.solve(jacobian @ jacobian.mT + tiny, jacobian @ wanted)
    return ((wanted - in_row_space) * free[..., None]).squeeze(-1)
