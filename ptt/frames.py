"""Rigid motions: the best one between two sets of points, and rotations with their derivatives."""

import numpy as np
import torch
from torch import Tensor

TRIMS = 4


def align(place: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best rigid motion that carries places to readings, gross outliers left out.

    Source: Kabsch, Acta Cryst. A32 (1976) 922.

    Args:
        place: (m, 3) mm.
        reading: (m, 3) mm.

    Returns:
        R (3, 3) and t (3,) mm with reading = R place + t.
    """
    kept = np.ones(len(place), dtype=bool)
    for _ in range(TRIMS):
        turn, shift = _kabsch(place[kept], reading[kept])
        distance = np.linalg.norm(reading - place @ turn.T - shift, axis=1)
        near = distance <= max(6.0 * np.median(distance), 1e-9)
        if near.sum() < 4 or (near == kept).all():
            break
        kept = near
    return turn, shift


def best_fit(place: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Readings after the rigid motion that brings them nearest to their places.

    Args:
        place: (m, 3) mm.
        reading: (m, 3) mm.

    Returns:
        (m, 3) mm.
    """
    turn, shift = align(place, reading)
    return (reading - shift) @ turn


def rotation(vector: Tensor) -> tuple[Tensor, Tensor]:
    """Rotation matrices of rotation vectors, with derivatives.

    Source: Rodrigues' formula; derivatives by torch.func.

    Args:
        vector: (f, 3) rad.

    Returns:
        R (f, 3, 3) and dR/dvector (f, 3, 3, 3), last axis the vector's.
    """
    by_vector = torch.func.vmap(torch.func.jacfwd(_rodrigues))(vector)
    return torch.func.vmap(_rodrigues)(vector), by_vector


def _rodrigues(vector: Tensor) -> Tensor:
    x, y, z = vector.unbind()
    zero = torch.zeros_like(x)
    cross = torch.stack([torch.stack([zero, -z, y]), torch.stack([z, zero, -x]), torch.stack([-y, x, zero])])
    square = (vector * vector).sum()
    # The series is used throughout: after the first alignment angles stay small, and it has no division by zero.
    first = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    second = 0.5 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)))
    return torch.eye(3, dtype=vector.dtype) + first * cross + second * (cross @ cross)


def _kabsch(place: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    middle, centre = place.mean(axis=0), reading.mean(axis=0)
    left, _, right = np.linalg.svd((reading - centre).T @ (place - middle))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    turn = left @ mirror @ right
    return turn, centre - turn @ middle
