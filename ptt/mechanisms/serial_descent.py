"""Damped least squares of a serial arm toward wanted poses, all rows at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor

from ptt.mechanisms.rotations import rotation_vector

TOLERANCE_MM = 1e-9
ITERATIONS = 60
LONGEST_STEP_RAD = 0.7
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e6  # in units of the squared characteristic length


class Arm(Protocol):
    """What the inverse asks of an arm of k joints; `ptt.mechanisms.serial.Serial` says what each is."""

    @property
    def joints(self) -> int:
        """Number of joints k."""

    @property
    def length_mm(self) -> float:
        """A rotation by one radian counts as much as a shift by this."""

    @property
    def reach_mm(self) -> float:
        """A length that the tool cannot get farther than from the base."""

    def limits(self) -> Tensor:
        """Ends of travel, (2, k) rad."""

    def forward(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Tool position, (..., 3) mm."""

    def pose(self, q: Tensor, geometry: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Tool position (..., 3) mm and orientation (..., 3, 3)."""

    def pose_jacobian(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """dp/dq and rotation per joint, (..., 6, k)."""


@dataclass(frozen=True)
class PoseTask:
    """Poses that an arm is asked to reach.

    Attributes:
        arm: the arm.
        p: (n, 3) tool positions, mm.
        rotation: (n, 3, 3) tool orientations; None leaves them free.
        geometry: (n, G) or (1, G) errors of the geometry slots; None for the drawing.
    """

    arm: Arm
    p: Tensor
    rotation: Tensor | None = None
    geometry: Tensor | None = None

    def rows(self, index: Tensor) -> PoseTask:
        """Keep some rows only; `index` is (m,) row numbers or an (n,) mask."""
        shared = self.geometry is None or len(self.geometry) == 1
        return replace(
            self,
            p=self.p[index],
            rotation=None if self.rotation is None else self.rotation[index],
            geometry=self.geometry if shared or self.geometry is None else self.geometry[index],
        )

    def error(self, q: Tensor) -> Tensor:
        """What is left to go: (n, 3) mm, or (n, 6) with the rotation vector times the characteristic length below."""
        if self.rotation is None:
            return self.p - self.arm.forward(q, self.geometry)
        p, rotation = self.arm.pose(q, self.geometry)
        turn = rotation_vector(self.rotation @ rotation.mT)
        return torch.cat([self.p - p, self.arm.length_mm * turn], -1)

    def jacobian(self, q: Tensor) -> Tensor:
        """Derivative of the pose reached, in the units of `error`: (n, 3 or 6, k) mm/rad."""
        jacobian = self.arm.pose_jacobian(q, self.geometry)
        if self.rotation is None:
            return jacobian[..., :3, :]
        return torch.cat([jacobian[..., :3, :], self.arm.length_mm * jacobian[..., 3:, :]], -2)


def descend(task: PoseTask, q: Tensor) -> tuple[Tensor, Tensor]:
    """Go from joint values toward the task's poses by damped least squares within the limits.

    Args:
        task: n poses.
        q: (n, k) where to start, rad.

    Returns:
        (n, k) joint values, rad, and (n,) what is left to go, mm.
    """
    low, high = task.arm.limits()
    q = torch.clamp(q, low, high)
    error = task.error(q)
    damping = torch.full_like(error[:, 0], FIRST_DAMPING)
    for _ in range(ITERATIONS):
        rows = torch.nonzero((length(error) > TOLERANCE_MM / 10) & (damping < MOST_DAMPING)).flatten()
        if not len(rows):
            break
        part = task.rows(rows)
        trial = torch.clamp(q[rows] + _step(part, q[rows], error[rows], damping[rows]), low, high)
        trial_error = part.error(trial)
        better = length(trial_error) < length(error[rows])
        q[rows[better]], error[rows[better]] = trial[better], trial_error[better]
        eased = torch.where(better, damping[rows] / 10, damping[rows] * 8)
        damping[rows] = eased.clamp(min=LEAST_DAMPING)
    return q, length(error)


def free_columns(task: PoseTask, q: Tensor, uphill: Tensor) -> Tensor:
    """Mark the joints that may move: not at a limit, or pulled back from it.

    Args:
        task: n poses.
        q: (n, k) joint values, rad.
        uphill: (n, k) direction each joint is pulled in.

    Returns:
        (n, k) one where free, zero where held.
    """
    low, high = task.arm.limits()
    return (~(((q <= low) & (uphill < 0)) | ((q >= high) & (uphill > 0)))).to(q.dtype)


def length(vectors: Tensor) -> Tensor:
    """Euclidean length of vectors (..., m), (...,)."""
    return torch.linalg.vector_norm(vectors, dim=-1)


def _step(task: PoseTask, q: Tensor, error: Tensor, damping: Tensor) -> Tensor:
    """Damped least-squares step, (n, k) rad, joints held that would leave their limits."""
    jacobian = task.jacobian(q)
    uphill = (jacobian.mT @ error[..., None]).squeeze(-1)
    jacobian = jacobian * free_columns(task, q, uphill)[:, None, :]
    square = task.arm.length_mm**2 * damping[:, None, None] * torch.eye(error.shape[-1], dtype=q.dtype)
    step = (jacobian.mT @ torch.linalg.solve(jacobian @ jacobian.mT + square, error[..., None])).squeeze(-1)
    longest = step.abs().amax(-1, keepdim=True)
    return step * (LONGEST_STEP_RAD / longest.clamp(min=LONGEST_STEP_RAD))
