"""Smooth shapes along an axis, with the constant and the linear part taken out."""

from functools import lru_cache

import numpy as np
import torch
from scipy.interpolate import CubicSpline
from torch import Tensor

KNOTS = 9


@lru_cache(maxsize=8)
def _spline(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Natural cubic splines through discrete orthogonal polynomials of degree 2, 3, ... at the knots."""
    knots = np.linspace(0.0, 1.0, KNOTS)
    powers = np.vander(2.0 * knots - 1.0, count + 2, increasing=True)
    orthogonal, triangle = np.linalg.qr(powers)
    shapes = (orthogonal * np.sign(np.diag(triangle)))[:, 2:]
    shapes = shapes / np.abs(shapes).max(axis=0)  # a unit parameter is then a shape of unit height
    return knots, CubicSpline(knots, shapes, bc_type="natural").c


def straight_shapes(position: Tensor) -> Tensor:
    """The straight part that smooth shapes leave out: a line of height one at both ends, and a constant.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...).

    Returns:
        (..., 2).
    """
    return torch.stack([2.0 * position.clamp(0.0, 1.0) - 1.0, torch.ones_like(position)], dim=-1)


def smooth_shapes(position: Tensor, count: int) -> Tensor:
    """Evaluate the smooth shapes.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...); held beyond it.
        count: number of shapes: parabola, cubic, and so on.

    Returns:
        (..., count), each of height one at the knots, orthogonal there to each other, to a constant and to a line.
    """
    knots, coefficients = _spline(count)
    table = torch.as_tensor(coefficients, dtype=position.dtype)  # shape: (4, pieces, count)
    inside = position.clamp(0.0, 1.0)
    piece = (inside.detach() * (KNOTS - 1)).floor().long().clamp(0, KNOTS - 2)
    offset = (inside - torch.as_tensor(knots, dtype=position.dtype)[piece]).unsqueeze(-1)
    cubic, square, linear, constant = (row[piece] for row in table)
    return ((cubic * offset + square) * offset + linear) * offset + constant
