"""Levenberg-Marquardt steps of a serial arm toward wanted poses, all rows at once, within the joint limits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor

from ptt.mechanisms.rotations import rotation_vector

TOLERANCE_MM = 1e-9  # error of a solution, an orientation's counted by a characteristic length
ITERATIONS = 60  # at most
LONGEST_STEP_RAD = 0.7  # largest change of a joint in one iteration
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e6  # times the squared characteristic length


class Arm(Protocol):
    """The part of `ptt.mechanisms.serial.Serial` that the inverse needs, which itself imports the inverse."""

    @property
    def joints(self) -> int:
        """Number of joints k."""

    @property
    def length_mm(self) -> float:
        """Characteristic length: a rotation by one radian counts as much as a shift by this."""

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
        """Geometric Jacobian, (..., 6, k): mm/rad above rad/rad."""


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
        """Wanted less reached pose: (n, 3) mm, or (n, 6) with the rotation vector times the characteristic length."""
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
    """Go from joint values toward the task's poses by damped least squares within the limits (Levenberg-Marquardt).

    Damping falls tenfold with each step that comes nearer and grows eightfold with each that does not.

    Args:
        task: n poses.
        q: (n, k) where to start, rad.

    Returns:
        (n, k) joint values, rad, and (n,) length of the pose error that is left, mm.
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


def free_joints(task: PoseTask, q: Tensor, direction: Tensor) -> Tensor:
    """Active set of the joint limits: mark the joints that a step may move, not those it would push past a limit.

    Args:
        task: n poses.
        q: (n, k) joint values, rad.
        direction: (n, k), of which the sign says which way each joint is to move.

    Returns:
        (n, k), 1 where free, 0 where held.
    """
    low, high = task.arm.limits()
    return (~(((q <= low) & (direction < 0)) | ((q >= high) & (direction > 0)))).to(q.dtype)


def length(vectors: Tensor) -> Tensor:
    """Euclidean length of vectors (..., m), (...,)."""
    return torch.linalg.vector_norm(vectors, dim=-1)


def _step(task: PoseTask, q: Tensor, error: Tensor, damping: Tensor) -> Tensor:
    """Damped least-squares step J^T (J J^T + damping)^-1 e, (n, k) rad, joints at a limit held that would leave it."""
    jacobian = task.jacobian(q)
    descent = (jacobian.mT @ error[..., None]).squeeze(-1)
    jacobian = jacobian * free_joints(task, q, descent)[:, None, :]
    damped = task.arm.length_mm**2 * damping[:, None, None] * torch.eye(error.shape[-1], dtype=q.dtype)
    step = (jacobian.mT @ torch.linalg.solve(jacobian @ jacobian.mT + damped, error[..., None])).squeeze(-1)
    longest = step.abs().amax(-1, keepdim=True)
    return step * (LONGEST_STEP_RAD / longest.clamp(min=LONGEST_STEP_RAD))
