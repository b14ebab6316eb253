"""Rotations as matrices, generalised angles, rotation vectors and quaternions."""

import torch
from torch import Tensor


def angles_of(rotation: Tensor) -> Tensor:
    """Read the generalised angles of an orientation [n o a].

    R = Rot(z, alpha) Rot(x, beta) Rot(z, gamma), so that tan(alpha) = -a_x / a_y and
    tan(beta) = (a_x sin(alpha) - a_y cos(alpha)) / a_z as in Hui Jizhuang et al. (2016); here with two-argument
    arctangents, 0 <= beta <= pi. Where beta is 0 or pi only alpha +- gamma is defined, yet the matrix is rebuilt.

    Args:
        rotation: (..., 3, 3), columns n, o, a.

    Returns:
        (..., 3) alpha, beta, gamma, rad.
    """
    n, o, a = rotation.unbind(-1)
    alpha = torch.atan2(a[..., 0], -a[..., 1])
    cos, sin = alpha.cos(), alpha.sin()
    beta = torch.atan2(a[..., 0] * sin - a[..., 1] * cos, a[..., 2])
    gamma = torch.atan2(-(o[..., 0] * cos + o[..., 1] * sin), n[..., 0] * cos + n[..., 1] * sin)
    return torch.stack([alpha, beta, gamma], -1)


def from_angles(angles: Tensor) -> Tensor:
    """Build the orientation from its generalised angles, the inverse of `angles_of`.

    Args:
        angles: (..., 3) alpha, beta, gamma, rad.

    Returns:
        (..., 3, 3) rotation, columns n, o, a.
    """
    ca, cb, cg = angles.cos().unbind(-1)
    sa, sb, sg = angles.sin().unbind(-1)
    n = torch.stack([ca * cg - sa * cb * sg, sa * cg + ca * cb * sg, sb * sg], -1)
    o = torch.stack([-ca * sg - sa * cb * cg, -sa * sg + ca * cb * cg, sb * cg], -1)
    a = torch.stack([sa * sb, -ca * sb, cb], -1)
    return torch.stack([n, o, a], -1)


def quaternion_of(rotation: Tensor) -> Tensor:
    """Read the unit quaternion of a rotation, safe at every angle.

    The symmetric matrix 4 q q^T is linear in the rotation; its row of the largest component, normalised, is q
    (Shepperd, Quaternion from rotation matrix, 1978).

    Args:
        rotation: (..., 3, 3).

    Returns:
        (..., 4) qx, qy, qz, qw with qw >= 0.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (row.unbind(-1) for row in rotation.unbind(-2))
    rows = [
        torch.stack([1 + xx - yy - zz, xy + yx, xz + zx, zy - yz], -1),
        torch.stack([xy + yx, 1 - xx + yy - zz, yz + zy, xz - zx], -1),
        torch.stack([xz + zx, yz + zy, 1 - xx - yy + zz, yx - xy], -1),
        torch.stack([zy - yz, xz - zx, yx - xy, 1 + xx + yy + zz], -1),
    ]
    outer = torch.stack(rows, -2)
    largest = outer.diagonal(dim1=-2, dim2=-1).argmax(-1)
    row = torch.take_along_dim(outer, largest[..., None, None], -2).squeeze(-2)
    unit = row / torch.linalg.vector_norm(row, dim=-1, keepdim=True)
    return torch.where(unit[..., 3:] < 0, -unit, unit)


def from_quaternion(quaternion: Tensor) -> Tensor:
    """Build the rotation from a quaternion of any length but zero.

    Args:
        quaternion: (..., 4) qx, qy, qz, qw.

    Returns:
        (..., 3, 3) rotation.
    """
    x, y, z, w = (quaternion / torch.linalg.vector_norm(quaternion, dim=-1, keepdim=True)).unbind(-1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        torch.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        torch.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
    ]
    return torch.stack(rows, -2)


def rotation_vector(rotation: Tensor) -> Tensor:
    """Read axis times angle of a rotation.

    Args:
        rotation: (..., 3, 3).

    Returns:
        (..., 3) rad, of length 0 to pi.
    """
    quaternion = quaternion_of(rotation)
    axis, w = quaternion[..., :3], quaternion[..., 3:]
    small = axis.abs().amax(-1, keepdim=True) < 1e-8
    sine = torch.linalg.vector_norm(torch.where(small, torch.ones_like(axis), axis), dim=-1, keepdim=True)
    return axis * torch.where(small, 2 / w.clamp(min=0.5), 2 * torch.atan2(sine, w) / sine)


def from_rotation_vector(vector: Tensor) -> Tensor:
    """Build the rotation about an axis by an angle, the inverse of `rotation_vector` (Rodrigues).

    Args:
        vector: (..., 3) axis times angle, rad.

    Returns:
        (..., 3, 3) rotation.
    """
    angle = torch.linalg.vector_norm(vector, dim=-1)[..., None, None]
    zero = torch.zeros_like(vector[..., 0])
    x, y, z = vector.unbind(-1)
    rows = [torch.stack([zero, -z, y], -1), torch.stack([z, zero, -x], -1), torch.stack([-y, x, zero], -1)]
    skew = torch.stack(rows, -2)
    straight = torch.eye(3, dtype=vector.dtype, device=vector.device)
    half = torch.sinc(angle / (2 * torch.pi))  # sin(angle / 2) / (angle / 2), defined at zero too
    return straight + torch.sinc(angle / torch.pi) * skew + half**2 / 2 * (skew @ skew)
