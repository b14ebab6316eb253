"""Rotations as matrices, rotation vectors and quaternions."""

import torch
from torch import Tensor


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
