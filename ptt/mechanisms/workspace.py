"""Where a mechanism can go: the status of targets, and maps of its dexterity."""

import functools
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ptt.mechanisms.dexterity import condition_number, near_singularity, singular_values, singularities
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import sample_joints
from ptt.mechanisms.three_ptt import ThreePtt

OK, OUT_OF_TRAVEL, OUT_OF_REACH, NEAR_SINGULAR = "ok", "out of travel", "out of reach", "near singular"

NEAR_CONDITION = 50.0
"""Condition number of dp/dq from which an arm's pose counts as near singular; a 3-PTT has margins of its own."""

FLAT = 1e-9
"""Singular value of dp/dq, as a share of the largest, below which it is zero but for rounding."""

PLACES = 13
"""Places of each slider, all combinations, that show how far the tool can go."""

LEVELS = 2001
"""Heights at which it is asked whether the travel reaches the middle."""


@dataclass(frozen=True, eq=False)
class WorkspaceMap:
    """Condition number and travel margin over a grid of tool positions at a few heights.

    Attributes:
        x: (i,) mm.
        y: (j,) mm.
        z: (h,) mm.
        condition: (h, j, i) condition number of the Jacobian, NaN out of reach.
        travel_margin: (h, j, i) mm or rad, as `travel_margin` has it.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    condition: Tensor
    travel_margin: Tensor


def reach(mechanism: Mechanism, p: Tensor, q: Tensor | None = None) -> np.ndarray:
    """Say of each target whether the mechanism can go there; the graver status wins.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.
        q: (n, k) mm or rad, joint values that go there; None for those of the inverse.

    Returns:
        (n,) str: "ok", "out of travel", "out of reach" or "near singular".
    """
    q = mechanism.inverse(p) if q is None else q
    status = np.full(len(p), OK, dtype=f"<U{len(OUT_OF_TRAVEL)}")
    status[near_singular(mechanism, p, q).numpy()] = NEAR_SINGULAR
    status[(travel_margin(mechanism, q) < 0.0).numpy()] = OUT_OF_TRAVEL
    status[~torch.isfinite(q).all(-1).numpy()] = OUT_OF_REACH
    return status


def travel_margin(mechanism: Mechanism, q: Tensor) -> Tensor:
    """Travel left to the nearest end of travel, the least over the joints.

    Args:
        mechanism: the machine.
        q: (n, k) mm or rad, joint values.

    Returns:
        (n,) mm or rad, negative beyond an end, infinite where there is none, NaN where q is.
    """
    lower, upper = mechanism.limits()
    return torch.minimum(q - lower, upper - q).amin(-1)


def workspace_map(mechanism: Mechanism, x: Tensor, y: Tensor, z: Tensor) -> WorkspaceMap:
    """Condition number and travel margin over a grid.

    Args:
        mechanism: the machine.
        x: (i,) mm.
        y: (j,) mm.
        z: (h,) mm.

    Returns:
        The map.
    """
    grid = torch.stack(torch.meshgrid(z, y, x, indexing="ij")[::-1], -1)  # shape: (h, j, i, xyz)
    place, shape = grid.reshape(-1, 3), grid.shape[:-1]
    q = mechanism.inverse(place)
    if isinstance(mechanism, ThreePtt):
        condition = singularities(mechanism, place).condition
    else:
        condition = condition_number(mechanism.jacobian(q))
    return WorkspaceMap(x, y, z, condition.reshape(shape), travel_margin(mechanism, q).reshape(shape))


def reached_box(mechanism: ThreePtt) -> tuple[Tensor, Tensor]:
    """Lowest and highest x, y, z that the sliders' travel reaches.

    Args:
        mechanism: the machine, with finite travel.

    Returns:
        (3,) mm each.
    """
    low, high = mechanism.limits()
    share = torch.linspace(0.0, 1.0, PLACES, dtype=torch.float64)
    place = mechanism.forward(low + torch.cartesian_prod(*[share] * len(low)) * (high - low))
    place = place[torch.isfinite(place).all(dim=1)]
    if len(place):
        return place.amin(dim=0), place.amax(dim=0)
    # Equal radii leave every pose to the inverse alone: no position is farther than a link from a rail's travel.
    ends = mechanism.foot + torch.stack((low, high))[..., None] * mechanism.rail  # shape: (ends, legs, xyz)
    link = mechanism.link[:, None]
    return (ends.amin(0) - link).amax(0), (ends.amax(0) + link).amin(0)


def heights_in_the_middle(mechanism: ThreePtt) -> tuple[float, float]:
    """Lowest and highest z of the longest piece of the line x = y = 0 that the sliders' travel reaches.

    Args:
        mechanism: the machine, with finite travel.

    Returns:
        mm each; where it reaches nothing of that line, of all positions that it reaches.
    """
    least, most = reached_box(mechanism)
    z = torch.linspace(float(least[2]), float(most[2]), LEVELS, dtype=torch.float64)
    place = torch.stack((0.0 * z, 0.0 * z, z), -1)
    within = np.flatnonzero(travel_margin(mechanism, mechanism.inverse(place)) >= 0.0)  # False where it is NaN
    if not len(within):
        return float(least[2]), float(most[2])
    piece = max(np.split(within, np.flatnonzero(np.diff(within) > 1) + 1), key=len)
    return float(z[piece[0]]), float(z[piece[-1]])


def near_singular(mechanism: Mechanism, p: Tensor, q: Tensor) -> Tensor:
    """Say which poses are close to a singularity.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.
        q: (n, k) mm or rad, their joint values.

    Returns:
        (n,) bool, False out of reach.
    """
    if isinstance(mechanism, ThreePtt):
        return near_singularity(mechanism, p)
    return condition_in_rank(mechanism, q) > NEAR_CONDITION


def condition_in_rank(mechanism: Mechanism, q: Tensor) -> Tensor:
    """Condition number of dp/dq over the directions in which the joints can move the tool at all.

    A planar arm, or one of two joints, has a Jacobian of rank 2 everywhere, which is no singularity: the ratio is that
    of its largest singular value to the smallest of the first two.

    Args:
        mechanism: the machine.
        q: (n, k) mm or rad, joint values.

    Returns:
        (n,), infinite at a singularity up to rounding, NaN where q is.
    """
    jacobian = mechanism.jacobian(q)
    rank = translation_rank(mechanism)
    if rank == 3:
        return condition_number(jacobian)
    values = singular_values(jacobian)
    least = values[..., rank - 1]
    return torch.where(least <= FLAT * values[..., 0], torch.inf, values[..., 0] / least)


def translation_rank(mechanism: Mechanism) -> int:
    """Rank of dp/dq at a general pose, 1 to 3: the number of directions in which joints can move the tool point."""
    return arm_translation_rank(mechanism) if isinstance(mechanism, Serial) else 3


@functools.lru_cache(maxsize=64)
def arm_translation_rank(arm: Serial) -> int:
    """Rank of an arm's dp/dq at a general pose: the highest over many sampled poses."""
    values = singular_values(arm.jacobian(sample_joints(arm, 256)))
    return max(int((values > FLAT * values[:, :1]).sum(dim=-1).max()), 1)
