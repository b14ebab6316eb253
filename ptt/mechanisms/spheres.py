"""Where three spheres meet, for long batches: components first, rows last, a block at a time."""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

BLOCK_ROWS = 16384


def meet_spheres(centre: Tensor, radius: Tensor, side: float) -> Tensor:
    """Point at given distances from three centres.

    Source: trilateration; the point is split into its parts along two edges of the centres' triangle and along its
    normal n = (c_2 - c_1) x (c_3 - c_1).

    Args:
        centre: (3, 3, n) mm, axes sphere, xyz, row.
        radius: (3, n) or (3, 1) mm.
        side: +1 for the point on the normal's side of the centres' plane, -1 for the other.

    Returns:
        (3, n) mm, NaN where the spheres do not meet.
    """
    first = centre[0]
    edge2, edge3 = centre[1] - first, centre[2] - first
    normal = torch.linalg.cross(edge2, edge3, dim=0)
    d22, d23, d33 = dot(edge2, edge2, 0), dot(edge2, edge3, 0), dot(edge3, edge3, 0)
    area2 = dot(normal, normal, 0)
    square = radius * radius
    along2 = 0.5 * (d22 + (square[0] - square[1]))
    along3 = 0.5 * (d33 + (square[0] - square[2]))
    part2 = (along2 * d33 - along3 * d23) / area2
    part3 = (along3 * d22 - along2 * d23) / area2
    height = side * torch.sqrt((square[0] - part2 * along2 - part3 * along3) / area2)
    return first + part2 * edge2 + part3 * edge3 + height * normal


def dot(left: Tensor, right: Tensor, axis: int) -> Tensor:
    """Inner product over an axis of three, written out because a reduction over so few is several times slower.

    Args:
        left: any shape with 3 on `axis`.
        right: a shape that broadcasts with it.
        axis: the axis to sum over.

    Returns:
        The sum, `axis` removed.
    """
    (x1, y1, z1), (x2, y2, z2) = left.unbind(axis), right.unbind(axis)
    return torch.addcmul(torch.addcmul(x1 * x2, y1, y2), z1, z2)


def columns(constant: Tensor, batch_axes: int) -> Tensor:
    """View of a constant with one trailing axis of length 1 for each batch axis.

    Args:
        constant: any shape.
        batch_axes: how many axes the batch has.

    Returns:
        The view.
    """
    return constant.reshape(constant.shape + (1,) * batch_axes)


def rows_last(rows: Tensor) -> Tensor:
    """(n, k) -> (k, n), contiguous: columns are what the processor's vector units read fastest.

    Args:
        rows: (n, k).

    Returns:
        (k, n).
    """
    return rows.movedim(-1, 0).contiguous()


def in_blocks(solve: Callable[[Tensor, Tensor | None], Tensor], rows: Tensor, geometry: Tensor | None) -> Tensor:
    """Solve a long batch block by block, so that what lies between stays in the processor's cache.

    Args:
        solve: maps rows (n, k) and their geometry shifts to values (n, ...).
        rows: (n, k).
        geometry: (n, G), (1, G) or None.

    Returns:
        (n, ...).
    """
    if rows.ndim != 2 or len(rows) <= BLOCK_ROWS or torch.compiler.is_compiling():
        return solve(rows, geometry)
    blocks = rows.split(BLOCK_ROWS)
    shifts: Sequence[Tensor | None] = [geometry] * len(blocks)
    if geometry is not None and len(geometry) == len(rows):
        shifts = geometry.split(BLOCK_ROWS)
    return torch.cat([solve(block, shift) for block, shift in zip(blocks, shifts, strict=True)])
