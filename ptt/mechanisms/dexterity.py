"""Dexterity of a 3-PTT pose and its distance from singularities: determinant, margins, condition, manipulability."""

from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.mechanisms.three_ptt import ThreePtt

NEAR_RATIO = 0.1
"""Margin below which a pose is near a singularity: some error or force then grows more than tenfold on its way."""

ROUNDING = 1e-14
"""Share of the largest singular value below which the least one is zero but for rounding."""


@dataclass(frozen=True, eq=False)
class Singularities:
    """Margins of n poses to each kind of singularity, and their condition number and manipulability.

    `direct` and `constraint` are least singular values of three unit vectors (1 orthogonal, 0 in one plane): the load
    on the platform, in its weakest direction, that link forces or joint moments of size 1 hold. They need no length as
    a scale, and 1/margin bounds how much a slider or joint error grows on its way to the tool. Upright machines with
    equal links stay a little under direct = sqrt(3/2) |R - r| / L wherever they reach; only R = r makes them singular.

    Attributes:
        inverse_mm: (n,) least |w_i| = |s_i . rail_i|; 0 where a link stands square to its rail.
        edge_mm: (n,) least L_i - |part of s_i across rail_i|, sideways travel left until then.
        inverse: (n,) least |w_i| / L_i, so that all three margins are ratios.
        direct: (n,) least singular value of the unit link vectors.
        direct_volume: (n,) their signed determinant, which changes sign at the singularity.
        constraint: (n,) least singular value of the unit constraint moments of the universal joints.
        constraint_volume: (n,) their signed determinant, proportional to g_1 g_2 w_3 + g_2 g_3 w_1 + g_1 g_3 w_2.
        condition: (n,) condition number of J, 1 is even in all directions; the same for db/dp and dp/db.
        manipulability: (n,) mm^3 per mm^3, |det dp/db|: 0 at an inverse singularity, infinite at a direct one.
    """

    inverse_mm: Tensor
    edge_mm: Tensor
    inverse: Tensor
    direct: Tensor
    direct_volume: Tensor
    constraint: Tensor
    constraint_volume: Tensor
    condition: Tensor
    manipulability: Tensor

    @property
    def near(self) -> Tensor:
        """Mask (n,) of the poses with any margin under NEAR_RATIO; False out of reach."""
        return torch.stack((self.inverse, self.direct, self.constraint)).amin(0) < NEAR_RATIO


def determinant(mechanism: ThreePtt, p: Tensor) -> Tensor:
    """Determinant of J = db/dp.

    Source: J = diag(1 / (s_i . rail_i)) S for link vectors s_i, the rows of S; so det J vanishes with the volume that
    the links span and grows without bound where a link stands square on its rail.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.

    Returns:
        (n,), NaN out of reach.
    """
    vector = mechanism.link_vectors(p)
    return _volume(vector) / (vector * mechanism.rail).sum(-1).prod(-1)


def singularities(mechanism: ThreePtt, p: Tensor) -> Singularities:
    """Margins of poses to the inverse, the direct and the constraint singularity, and the dexterity there.

    Source: link vectors s_i and the constraint moments of the universal joints, s_i less its part along the outer axis
    (no joint of leg i turns about that direction); a set of three loses rank at its singularity.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.

    Returns:
        The margins, NaN out of reach.
    """
    vector = mechanism.link_vectors(p)
    along = (vector * mechanism.rail).sum(-1)
    across = vector - along.unsqueeze(-1) * mechanism.rail
    unit, moment = _directions(mechanism, vector)
    ratio = (unit * mechanism.rail).sum(-1)
    spread = singular_values(unit)
    flat = spread[..., -1] <= ROUNDING * spread[..., 0]  # R = r: the links are parallel, and what is left is rounding
    zero = torch.zeros_like(along[..., 0])
    volume, unit_volume = (torch.where(flat, zero, _volume(rows)) for rows in (vector, unit))
    return Singularities(
        inverse_mm=along.abs().amin(-1),
        edge_mm=(mechanism.link - across.norm(dim=-1)).amin(-1),
        inverse=ratio.abs().amin(-1),
        direct=torch.where(flat, zero, spread[..., -1]),
        direct_volume=unit_volume,
        constraint=singular_values(moment)[..., -1],
        constraint_volume=_volume(moment),
        condition=condition_number(unit * (ratio.roll(-1, -1) * ratio.roll(-2, -1)).unsqueeze(-1)),
        manipulability=(along.prod(-1) / volume).abs(),
    )


def near_singularity(mechanism: ThreePtt, p: Tensor) -> Tensor:
    """Equal to `singularities(...).near`, but singular values are computed only where a bound leaves it open.

    Three unit vectors have singular values whose squares sum to 3, so the product of the two largest is at most 3/2
    and the least is at least 2/3 of their volume.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.

    Returns:
        (n,) bool, False out of reach.
    """
    unit, moment = _directions(mechanism, mechanism.link_vectors(p))
    near = (unit * mechanism.rail).sum(-1).abs().amin(-1) < NEAR_RATIO
    least = torch.minimum(_volume(unit).abs(), _volume(moment).abs()) / 1.5
    open_ = (~near & (least < 1.01 * NEAR_RATIO)).nonzero()[:, 0]  # 1.01: beyond rounding
    near[open_] = singularities(mechanism, p[open_]).near
    return near


def _directions(mechanism: ThreePtt, vector: Tensor) -> tuple[Tensor, Tensor]:
    """Unit vectors of links and of the constraint moments of their joints, (n, 3, 3) each."""
    moment = vector - (vector * mechanism.outer_axis).sum(-1, keepdim=True) * mechanism.outer_axis
    return torch.nn.functional.normalize(vector, dim=-1), torch.nn.functional.normalize(moment, dim=-1)


def condition_number(jacobian: Tensor) -> Tensor:
    """Condition number |J| |J^-1| of batched Jacobians, of db/dp and dp/dq alike.

    Args:
        jacobian: (n, 3, k); a common factor does not matter.

    Returns:
        (n,), 1 is even in all directions, infinite is singular up to rounding, NaN where the Jacobian is.
    """
    values = singular_values(jacobian)
    ratio = values[..., 0] / values[..., -1]
    return torch.where(values[..., -1] <= ROUNDING * values[..., 0], torch.inf, ratio)


def manipulability(jacobian: Tensor) -> Tensor:
    """Manipulability w = sqrt(det(J J^T)) of batched Jacobians dp/dq.

    Source: Yoshikawa; the product of the singular values.

    Args:
        jacobian: (n, 3, k) mm per mm or mm per rad, dp/dq.

    Returns:
        (n,), 0 is singular, NaN where the Jacobian is.
    """
    return singular_values(jacobian).prod(-1)


def singular_values(matrix: Tensor) -> Tensor:
    """Singular values of batched matrices that may hold NaN, which the library's own routine refuses.

    Args:
        matrix: (n, i, j).

    Returns:
        (n, min(i, j)), largest first, NaN for a matrix with anything but numbers.
    """
    finite = torch.isfinite(matrix).all(-1).all(-1)[..., None, None]
    values = torch.linalg.svdvals(torch.where(finite, matrix, torch.zeros_like(matrix)))
    return torch.where(finite[..., 0], values, torch.nan)


def _volume(rows: Tensor) -> Tensor:
    """Triple product (n,) of the rows of (n, 3, 3)."""
    return (rows[..., 0, :] * torch.linalg.cross(rows[..., 1, :], rows[..., 2, :])).sum(-1)
