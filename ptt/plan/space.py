"""Poses that a machine can be sent to: within travel, away from singularities, inside a box if one is given."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import torch
from torch import Tensor

from ptt.errors import WorkspaceError
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import singularities
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.mechanisms.workspace import NEAR_CONDITION, condition_in_rank
from ptt.progress import Progress
from ptt.run.viewing import joint_limits

MARGIN = 0.01  # share of the travel that is left alone at either end
SAFE = 0.5  # least margin of a pose to the nearest singularity, as a share of that of the home pose
GRID = 13  # heights of each slider in the grid that finds the extent of the workspace
MOST_FREE = 5  # joints whose directions are drawn freely beside the opposite ones: 64 ways in all
OVERSHOOT = 40  # draws for each wanted pose, at most
BATCH, LARGE_BATCH = 512, 16_384  # poses drawn at once, at least and at most; the sequence does not depend on it


@dataclass(frozen=True, eq=False)
class Space:
    """Poses that may be driven.

    Attributes:
        mechanism: the machine.
        lower: (k,) mm or rad, joint limits with a margin.
        upper: (k,) mm or rad.
        box: (2, 3) mm, lowest and highest tool position.
        by_tool: whether poses are drawn evenly over the tool's volume (3-PTT), not over the joints' travel (arm).
    """

    mechanism: Mechanism
    lower: Tensor
    upper: Tensor
    box: Tensor
    by_tool: bool

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return len(self.lower)


def build_space(file: MachineFile, half_size: tuple[float, float, float] | None = None) -> Space:
    """Find where a machine can go.

    Args:
        file: the machine.
        half_size: half the size in x, y, z of a box about the middle of the reach, to stay inside of; mm.

    Returns:
        The space.

    Raises:
        WorkspaceError: nothing inside the box can be reached.
    """
    mechanism = build_mechanism(file.machine)
    limits = joint_limits(file)
    margin = MARGIN * (limits[:, 1] - limits[:, 0])
    lower, upper = limits[:, 0] + margin, limits[:, 1] - margin
    by_tool = isinstance(mechanism, ThreePtt)
    everywhere = torch.tensor([[-torch.inf] * 3, [torch.inf] * 3], dtype=torch.float64)
    space = narrow_space(Space(mechanism, lower, upper, everywhere, by_tool), lower, upper)
    if half_size is None:
        return space
    half = torch.tensor(half_size, dtype=torch.float64)
    centre = mechanism.forward(mechanism.home()[None])[0] if by_tool else space.box.mean(dim=0)
    return boxed(space, centre - half, centre + half)


def narrow_space(space: Space, lower: Tensor, upper: Tensor) -> Space:
    """The part of a space within narrower joint limits, its extent found anew.

    Args:
        space: the whole.
        lower: (k,) mm or rad.
        upper: (k,) mm or rad.

    Returns:
        The part.

    Raises:
        WorkspaceError: nothing in it can be driven.
    """
    part = replace(space, lower=torch.maximum(space.lower, lower), upper=torch.minimum(space.upper, upper))
    reached = part.mechanism.forward(_survey(part))
    if not len(reached):
        fix = "widen travel, limits or box"
        raise WorkspaceError("no pose is inside the travel and away from singularities", [], where="[machine]", fix=fix)
    return boxed(part, reached.amin(dim=0), reached.amax(dim=0))


def boxed(space: Space, low: Tensor, high: Tensor) -> Space:
    """A space within a further box, whose corners are (3,) mm."""
    return replace(space, box=torch.stack([torch.maximum(space.box[0], low), torch.minimum(space.box[1], high)]))


def can_drive(space: Space, q: Tensor) -> np.ndarray:
    """Whether joint values may be driven.

    Args:
        space: the machine's.
        q: (n, k) mm or rad.

    Returns:
        (n,) bool.
    """
    p = space.mechanism.forward(q)
    inside = torch.isfinite(p).all(dim=1) & torch.isfinite(q).all(dim=1)
    inside &= ((q >= space.lower) & (q <= space.upper)).all(dim=1)
    inside &= ((p >= space.box[0]) & (p <= space.box[1])).all(dim=1)
    good = torch.nonzero(inside).flatten()
    if len(good):
        mechanism = space.mechanism
        if isinstance(mechanism, ThreePtt):
            near = _margin(mechanism, p[good]) < SAFE * _margin(mechanism, mechanism.forward(mechanism.home()[None]))
        else:
            near = condition_in_rank(mechanism, q[good]) > NEAR_CONDITION
        inside[good[near]] = False
    return inside.numpy()


def draw_poses(space: Space, count: int, random: np.random.Generator, progress: Progress | None = None) -> Tensor:
    """Low-discrepancy poses; no slider height is commensurate with a lead.

    Source: M. Roberts, 'The unreasonable effectiveness of quasirandom sequences' (2018), additive recurrence of
    generalised golden ratios, from a random start.

    Args:
        space: the machine's.
        count: how many.
        random: where the sequence starts.
        progress: told what is done, how much of how much.

    Returns:
        (count, k) mm or rad.

    Raises:
        WorkspaceError: hardly any pose of the space can be driven.
    """
    size = 3 if space.by_tool else space.joints
    low, high = (space.box[0], space.box[1]) if space.by_tool else (space.lower, space.upper)
    begin = torch.as_tensor(random.random(size))
    step = torch.as_tensor(_golden(size) ** -np.arange(1.0, size + 1.0))
    found: list[Tensor] = []
    have, done, batch = 0, 0, int(np.clip(count, BATCH, LARGE_BATCH))
    while have < count and done < OVERSHOOT * count + batch:
        if progress is not None:
            progress("poses", have, count)
        index = torch.arange(done + 1, done + batch + 1, dtype=torch.float64)[:, None]
        place = low + torch.remainder(begin + index * step, 1.0) * (high - low)
        q = space.mechanism.inverse(place) if space.by_tool else place
        good = q[torch.as_tensor(can_drive(space, torch.nan_to_num(q, nan=torch.inf)))]
        found.append(good)
        have, done = have + len(good), done + batch
    if have < count:
        raise WorkspaceError(
            f"only {have} of {count} poses can be driven", [], where="[machine]", fix="widen travel, limits or box"
        )
    return torch.cat(found)[:count]


def directions(joints: int) -> np.ndarray:
    """Ways in which all joints can move at once, opposite ones next to each other.

    All of them up to six joints; of more a fractional factorial design, whose further columns are products of the first
    ones, so that any two joints move alike in half of the ways.

    Args:
        joints: k.

    Returns:
        (2^k, k), +1 and -1; at most 64 rows.
    """
    free = min(joints, MOST_FREE + 1) - 1
    index = np.arange(2**free)
    bits = np.array([np.where((index >> bit) & 1, 1.0, -1.0) for bit in range(free)]).reshape(free, -1)
    pairs = [bits[list(some)].prod(axis=0) for size in range(2, free + 1) for some in combinations(range(free), size)]
    half = np.stack([*bits, np.full(len(index), -1.0), *pairs][:joints], axis=1)
    return np.stack([half, -half], axis=1).reshape(-1, joints)


def _margin(mechanism: ThreePtt, p: Tensor) -> Tensor:
    """Least margin of poses to any singularity, a ratio, (n,)."""
    at = singularities(mechanism, p)
    return torch.stack((at.inverse, at.direct, at.constraint)).amin(dim=0)


def _golden(size: int) -> float:
    """Root of x^(d+1) = x + 1."""
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (size + 1.0))
    return root


def _survey(space: Space) -> Tensor:
    """Joint values that can be driven: a grid of the sliders, or many places over the limits of an arm."""
    if space.by_tool:
        part = torch.linspace(0.0, 1.0, GRID, dtype=torch.float64)
        grid = torch.cartesian_prod(*([part] * space.joints))
    else:
        step = torch.as_tensor(_golden(space.joints) ** -np.arange(1.0, space.joints + 1.0))
        grid = torch.remainder(torch.arange(1, 4 * BATCH, dtype=torch.float64)[:, None] * step, 1.0)
    q = space.lower + grid * (space.upper - space.lower)
    return q[torch.as_tensor(can_drive(space, q))]
