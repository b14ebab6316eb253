"""Dexterity of a serial arm: condition number, manipulability, singular and isotropic configurations.

Source: Hu Mingwei et al., motion performance of a collaborative robot: condition number k = |J| |J^-1|, manipulability
w = sqrt(det(J J^T)). With a Jacobian that is not square both are read from its min(m, k) singular values, so that an
arm of four joints is judged by its four motions.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from ptt.mechanisms.dexterity import condition_number, manipulability, singular_values
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import middle, sample_joints

Part = Literal["position", "orientation", "pose"]
SINGULAR = 1e-9  # smallest over largest singular value from which on a configuration counts as singular
NEWTON_STEPS = 60  # at most
POWERS = (2.0, 8.0, 32.0)  # norms that stand for the largest singular value, from smooth to near the maximum itself
SAMPLES = 4096  # joint values of which the best are refined
LONGEST_STEP_RAD = 0.2  # largest change of a joint in one Newton step
CONVERGED = 1e-7  # ratio of singular values; where two families cross Newton gets to the square root of rounding only
PERTURBATIONS, PERTURBATION_RAD = 8, 1e-4  # small steps off a singular pose, in random directions
ALIKE, SLICE = 1e-6, 0.05  # shares of a workspace's size: below the first a side is flat; half width of its only cell
DECIDES = 0.2  # share of the steepest joint's slope from which a joint belongs to a family


def scaled_jacobian(arm: Serial, q: Tensor, part: Part = "pose") -> Tensor:
    """Geometric Jacobian with all rows in rad/rad: position rows are divided by the arm's characteristic length.

    Args:
        arm: the arm.
        q: (n, k) joint values, rad.
        part: rows of the tool's position, of its orientation, or both ('pose').

    Returns:
        (n, 3 or 6, k) rad/rad.
    """
    jacobian = arm.pose_jacobian(q)
    position, orientation = jacobian[..., :3, :] / arm.length_mm, jacobian[..., 3:, :]
    if part == "pose":
        return torch.cat([position, orientation], -2)
    return position if part == "position" else orientation


def nearest_singular(arm: Serial, q: Tensor) -> tuple[Tensor, Tensor]:
    """Go from joint values to singular ones nearby: Newton's method on the smallest singular value.

    Joint limits are kept, so a row may end at a limit without having found a singular pose.

    Args:
        arm: the arm.
        q: (n, k) where to start, rad.

    Returns:
        (n, k) joint values, rad, and (n,) smallest over largest singular value there, 0 where singular.
    """
    low, high = arm.limits()
    best, best_ratio = q.detach(), torch.full_like(q[:, 0], torch.inf)
    here = best
    for _ in range(NEWTON_STEPS):
        leaf = here.clone().requires_grad_()
        values = singular_values(scaled_jacobian(arm, leaf))
        (slope,) = torch.autograd.grad(values[:, -1].sum(), leaf)
        ratio = (values[:, -1] / values[:, 0]).detach()
        better = ratio < best_ratio
        best, best_ratio = torch.where(better[:, None], here, best), torch.minimum(ratio, best_ratio)
        step = -values[:, -1:].detach() * slope / slope.square().sum(-1, keepdim=True).clamp(min=1e-12)
        step = step * (LONGEST_STEP_RAD / step.abs().amax(-1, keepdim=True).clamp(min=LONGEST_STEP_RAD))
        here = torch.clamp(here + torch.where(ratio[:, None] > SINGULAR, step.nan_to_num(0.0), 0.0), low, high)
    return best, best_ratio


def singular_families(arm: Serial, starts: int = 200) -> dict[tuple[int, ...], Tensor]:
    """Find which joints make an arm singular, as q4 alone (elbow) or q2 with q3 (shoulder) of a seven-joint arm.

    Newton's method goes to singular joint values from many starts. The joints that decide a family are those along
    which the smallest singular value rises when the arm is moved a little off the singular pose.

    Args:
        arm: the arm.
        starts: how many sampled joint values Newton's method starts from.

    Returns:
        Zero-based joints of a family -> (m, k) singular joint values, rad; largest family first.
    """
    q, ratio = nearest_singular(arm, sample_joints(arm, starts))
    found = q[ratio < CONVERGED]
    if not len(found):
        return {}
    random = torch.Generator().manual_seed(0)
    rise = torch.zeros_like(found)
    for _ in range(PERTURBATIONS):
        aside = found + PERTURBATION_RAD * torch.randn(found.shape, dtype=found.dtype, generator=random)
        leaf = aside.requires_grad_()
        (slope,) = torch.autograd.grad(singular_values(scaled_jacobian(arm, leaf))[:, -1].sum(), leaf)
        rise = torch.maximum(rise, slope.abs() / slope.abs().amax(-1, keepdim=True).clamp(min=1e-30))
    families: dict[tuple[int, ...], list[Tensor]] = {}
    for row, share in zip(found, rise, strict=True):
        families.setdefault(tuple(torch.nonzero(share > DECIDES).flatten().tolist()), []).append(row)
    return {joints: torch.stack(rows) for joints, rows in sorted(families.items(), key=lambda item: -len(item[1]))}


def most_isotropic(arm: Serial, part: Part = "pose", starts: int = 8) -> tuple[Tensor, float]:
    """Find the joint values of least condition number: those that move the tool most evenly in all directions.

    Args:
        arm: the arm.
        part: which rows of the Jacobian.
        starts: how many of the best samples are refined.

    Returns:
        (k,) joint values, rad, and their condition number, 1 where isotropic.
    """
    candidates = sample_joints(arm, SAMPLES)
    order = condition_number(scaled_jacobian(arm, candidates, part)).argsort()[:starts]
    found = [_refine(arm, candidates[row], part) for row in order]
    return min(found, key=lambda item: item[1])


@dataclass(frozen=True)
class DexterityMap:
    """Dexterity over two coordinates: those of a half plane through axis 1 (mm), or two joints (rad).

    Attributes:
        across: edges (c + 1,) of the cells along the first coordinate, or (c,) its values.
        up: the same along the second coordinate, (d + 1,) or (d,).
        condition: (d, c) condition number, second coordinate by first; NaN in a cell without a pose.
        manipulability: (d, c), unit-free; NaN in a cell without a pose.
    """

    across: np.ndarray
    up: np.ndarray
    condition: np.ndarray
    manipulability: np.ndarray


def dexterity_map(arm: Serial, samples: int, cells: int) -> DexterityMap:
    """Map the best dexterity an arm can have at each distance from axis 1 and height.

    This half plane stands for the whole workspace, because joint 1 changes neither condition number nor manipulability.

    Args:
        arm: the arm; axis 1 is the base's z, as in all standard tables.
        samples: joint values to try, spread over the limits.
        cells: cells along each side of the map; one along a side in which the arm does not move, as a flat one.

    Returns:
        The map: in each cell the smallest condition number and the largest manipulability found there.
    """
    q = sample_joints(arm, samples)
    jacobian = scaled_jacobian(arm, q)
    p = arm.forward(q).numpy()
    radius, height = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
    size = max(float(np.ptp(radius)), float(np.ptp(height)), 1.0)
    across, up = (_edges(axis, size, cells) for axis in (radius, height))
    shape = len(up) - 1, len(across) - 1
    cell = (np.digitize(height, up) - 1) * shape[1] + np.digitize(radius, across) - 1
    best = [
        _best_in_cell(cell, -condition_number(jacobian).numpy(), shape),
        _best_in_cell(cell, manipulability(jacobian).numpy(), shape),
    ]
    return DexterityMap(across, up, -best[0], best[1])


def _edges(values: np.ndarray, size: float, cells: int) -> np.ndarray:
    """Edges of cells over values; of one cell that can be seen beside the other side, `size`, where they are alike."""
    low, high = float(values.min()), float(values.max())
    if high - low < ALIKE * size:
        return np.array([low - SLICE * size, high + SLICE * size])
    return np.linspace(low, high + 1e-9, cells + 1)


def joint_map(arm: Serial, first: int, second: int, cells: int) -> DexterityMap:
    """Map dexterity over two joints, the others at the bent middle of their limits.

    Args:
        arm: the arm.
        first: zero-based joint across.
        second: zero-based joint upward.
        cells: joint values along each side.

    Returns:
        The map over the (c,) values of the two joints.
    """
    low, high = (limit.clamp(-torch.pi, torch.pi) for limit in arm.limits())
    across, up = (torch.linspace(float(low[i]), float(high[i]), cells, dtype=torch.float64) for i in (first, second))
    grid_up, grid_across = torch.meshgrid(up, across, indexing="ij")
    columns = [
        grid_across if i == first else grid_up if i == second else value.expand(cells, cells)
        for i, value in enumerate(middle(arm))
    ]
    jacobian = scaled_jacobian(arm, torch.stack(columns, -1))
    return DexterityMap(
        across.numpy(), up.numpy(), condition_number(jacobian).numpy(), manipulability(jacobian).numpy()
    )


def _best_in_cell(cell: np.ndarray, score: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Largest score (n,) of the poses in each cell of a map of this shape; NaN in an empty one."""
    best = np.full(shape[0] * shape[1], -np.inf)
    np.maximum.at(best, cell, score)
    filled = np.zeros(shape[0] * shape[1], dtype=bool)
    filled[cell] = True
    return np.where(filled, best, np.nan).reshape(shape)


def _refine(arm: Serial, start: Tensor, part: Part) -> tuple[Tensor, float]:
    """Minimise the condition number from one start, as a power mean, which is smooth where singular values cross."""
    q = start.numpy()
    for power in POWERS:
        q = minimize(_smooth_condition, q, (arm, part, power), jac=True, method="L-BFGS-B", bounds=arm.limits_rad).x
    found = torch.from_numpy(q)
    return found, float(condition_number(scaled_jacobian(arm, found[None], part)))


def _smooth_condition(values: np.ndarray, arm: Serial, part: Part, power: float) -> tuple[float, np.ndarray]:
    """log(|J|_p |J^-1|_p), p-norms of the singular values in place of their maximum; and its gradient by q."""
    q = torch.from_numpy(values.copy()).requires_grad_()
    logs = singular_values(scaled_jacobian(arm, q[None], part))[0].clamp(min=1e-30).log()
    value = (torch.logsumexp(power * logs, 0) + torch.logsumexp(-power * logs, 0)) / power
    (slope,) = torch.autograd.grad(value, q)
    return float(value.detach()), slope.numpy()
