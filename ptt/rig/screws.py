"""Homogeneous transformations of the links of an arm."""

import numpy as np

from ptt.rig.nominal import Array
from ptt.rig.platform import rotation_matrix


def screw(axis: int, turn: Array | float, slide: Array | float) -> Array:
    """Screw motion: rotation about a coordinate axis and translation along it.

    Args:
        axis: 0 for x, 1 for y, 2 for z.
        turn: (...) rad, positive counter-clockwise about the axis.
        slide: (...) mm.

    Returns:
        (..., 4, 4).
    """
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.tile(np.eye(4), (*np.broadcast_shapes(np.shape(turn), np.shape(slide)), 1, 1))
    matrix[..., first, first] = matrix[..., second, second] = np.cos(turn)
    matrix[..., second, first] = np.sin(turn)
    matrix[..., first, second] = -np.sin(turn)
    matrix[..., axis, 3] = slide
    return matrix


def turned(vector: Array) -> Array:
    """Rotations as homogeneous transformations.

    Args:
        vector: (n, 3) rad, rotation vectors.

    Returns:
        (n, 4, 4).
    """
    matrix = np.tile(np.eye(4), (len(vector), 1, 1))
    matrix[:, :3, :3] = rotation_matrix(vector)
    return matrix


def shifted(vector: Array) -> Array:
    """Translations as homogeneous transformations.

    Args:
        vector: (n, 3) mm.

    Returns:
        (n, 4, 4).
    """
    matrix = np.tile(np.eye(4), (len(vector), 1, 1))
    matrix[:, :3, 3] = vector
    return matrix
