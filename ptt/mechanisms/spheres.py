"""Intersection of three spheres for long batches: components on the first axes, rows on the last, block by block."""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

BLOCK_ROWS = 16384  # an array of three components then takes 400 kB


def intersect_spheres(centre: Tensor, radius: Tensor, side: float) -> Tensor:
    """Point at given distances from three centres, closed form.

    Source: trilateration; the point is split into its parts along two edges of the centres' triangle and along its
    normal n = (c_2 - c_1) x (c_3 - c_1). Written out by components: a stacked cross product keeps torch.compile from
    using vector registers and makes a pose cost fifteen times as much.

    Args:
        centre: (3, 3, n) mm, axes sphere, xyz, row.
        radius: (3, n) or (3, 1) mm.
        side: +1 for the point on the normal's side of the centres' plane, -1 for the other.

    Returns:
        (3, n) mm, NaN where the spheres do not meet.
    """
    first, second, third = (sphere.unbind(0) for sphere in centre.unbind(0))
    edge2 = [b - a for a, b in zip(first, second, strict=True)]
    edge3 = [b - a for a, b in zip(first, third, strict=True)]
    (x2, y2, z2), (x3, y3, z3) = edge2, edge3
    normal = [y2 * z3 - z2 * y3, z2 * x3 - x2 * z3, x2 * y3 - y2 * x3]
    d22, d23, d33, area2 = (
        torch.addcmul(torch.addcmul(u[0] * v[0], u[1], v[1]), u[2], v[2])
        for u, v in ((edge2, edge2), (edge2, edge3), (edge3, edge3), (normal, normal))
    )
    one, two, three = (radius * radius).unbind(0)
    along2, along3 = 0.5 * (d22 + (one - two)), 0.5 * (d33 + (one - three))
    part2 = (along2 * d33 - along3 * d23) / area2
    part3 = (along3 * d22 - along2 * d23) / area2
    height = side * torch.sqrt((one - part2 * along2 - part3 * along3) / area2)
    legs = zip(first, edge2, edge3, normal, strict=True)
    return torch.stack([a + part2 * e2 + part3 * e3 + height * n for a, e2, e3, n in legs])


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


def with_batch_axes(constant: Tensor, batch_axes: int) -> Tensor:
    """View of a constant with one trailing axis of length 1 for each batch axis, so that it broadcasts over the rows.

    Args:
        constant: any shape.
        batch_axes: how many axes the batch has.

    Returns:
        The view.
    """
    return constant.reshape(constant.shape + (1,) * batch_axes)


def rows_last(rows: Tensor) -> Tensor:
    """(n, k) -> (k, n), contiguous: one component of all rows lies together, as the processor's vector units want it.

    Args:
        rows: (n, k).

    Returns:
        (k, n).
    """
    return rows.movedim(-1, 0).contiguous()


def in_blocks(solve: Callable[[Tensor, Tensor | None], Tensor], rows: Tensor, geometry: Tensor | None) -> Tensor:
    """Solve a long batch block by block, so that intermediate arrays stay in the processor's cache.

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
