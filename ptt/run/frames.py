"""Rigid motions: alignment of two point sets (Kabsch), and rotation vectors with derivatives."""

import numpy as np
import torch
from torch import Tensor

TRIMS = 4  # rounds of leaving out outliers
LINE = 0.03  # width by length from which on no error of a machine determines the turn of places about their line
TOLD = 10.0  # width of narrower places in errors of their fit, above which they tell that turn, to a tenth of a radian
FAINT = 1e-9  # of the direction of a line: prefers the least turn about it, and turns the line by no more than that
ROUNDING = 1e-12  # share of the largest inertia, size or coordinate of points below which another is rounding


def align(place: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares rigid motion from places to readings, outliers beyond six median distances left out.

    Source: Kabsch, Acta Cryst. A32 (1976) 922.

    Args:
        place: (m, 3) mm.
        reading: (m, 3) mm.

    Returns:
        R (3, 3) and t (3,) mm with reading = R place + t.
    """
    if not len(place):
        return kabsch(place, reading)
    kept = np.ones(len(place), dtype=bool)
    for _ in range(TRIMS):
        turn, shift = kabsch(place[kept], reading[kept])
        distance = np.linalg.norm(reading - place @ turn.T - shift, axis=1)
        near = distance <= max(6.0 * np.median(distance), 1e-9)
        if near.sum() < 4 or (near == kept).all():
            break
        kept = near
    return turn, shift


def rotation(vector: Tensor) -> tuple[Tensor, Tensor]:
    """Rotation matrices of rotation vectors, with derivatives.

    Source: Rodrigues' formula, differentiated term by term.

    Args:
        vector: (f, 3) rad.

    Returns:
        R (f, 3, 3) and dR/dvector (f, 3, 3, 3), last axis the vector's.
    """
    square = (vector * vector).sum(dim=1)[:, None, None]
    # Power series of sin(x)/x and (1 - cos(x))/x^2: after the first alignment angles are small.
    first = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    second = 0.5 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)))
    by_first = -1.0 / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0))  # 2 d first / d square
    by_second = -1.0 / 12.0 * (1.0 - square / 15.0 * (1.0 - 3.0 * square / 112.0))
    generators = _GENERATORS.to(vector.dtype)
    cross = torch.einsum("fc,cij->fij", vector, generators)
    twice = cross @ cross
    turns = torch.eye(3, dtype=vector.dtype) + first * cross + second * twice
    mixed = generators @ cross[:, None] + cross[:, None] @ generators  # shape: (f, c, 3, 3)
    own = vector[:, :, None, None] * (by_first * cross + by_second * twice)[:, None]
    by_vector = own + first[:, None] * generators + second[:, None] * mixed
    return turns, by_vector.permute(0, 2, 3, 1)


def rigid_columns(p: Tensor, about: Tensor | None = None, length: float = 1.0) -> Tensor:
    """Jacobian of points by a small rigid motion of all of them: Rodrigues' formula to first order.

    Args:
        p: (..., 3) mm.
        about: centre of rotation, (3,) mm; None for the origin.
        length: mm that a turn of one radian counts as, so that shifts and turns move points about as far.

    Returns:
        (..., 3, 6): by translations along x, y, z, mm per mm; by rotations about them, mm per rad, over `length`.
    """
    arm = (p if about is None else p - about) / length
    turns = torch.einsum("cij,...j->...ic", _GENERATORS.to(p.dtype), arm)  # shape: (..., xyz, axis)
    return torch.cat([torch.eye(3, dtype=p.dtype).expand(turns.shape), turns], dim=-1)


def rigid_part(moved: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Least-squares small rigid motion of points.

    About the centroid shift and rotation decouple: the shift is the mean motion, and the rotation w solves
    J w = sum p x m with the inertia J of the points p and their motions m. A rotation about a line on which all points
    lie is set to zero.

    Args:
        moved: motion of each point, (n, 3) mm.
        place: the points, (n, 3) mm.

    Returns:
        (n, 3) mm.
    """
    shift, arm = moved.mean(axis=0), place - place.mean(axis=0)
    second = arm.T @ arm
    inertia, moment = np.trace(second) * np.eye(3) - second, arm.T @ (moved - shift)
    axial = np.array([moment[1, 2] - moment[2, 1], moment[2, 0] - moment[0, 2], moment[0, 1] - moment[1, 0]])
    turn = np.linalg.pinv(inertia, rcond=ROUNDING, hermitian=True) @ axial
    return np.asarray(shift + np.cross(turn, arm))


def without_rigid_parts(moved: np.ndarray, place: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Motions of points less the best small rigid motion of each group of them.

    Args:
        moved: motion of each point, (n, 3) mm.
        place: the points, (n, 3) mm.
        owner: (n,), frame or run of each.

    Returns:
        (n, 3) mm.
    """
    left = np.array(moved)
    for one in np.unique(owner):
        left[owner == one] -= rigid_part(moved[owner == one], place[owner == one])
    return left


def by_own(columns: np.ndarray, owner: np.ndarray, count: int | None = None) -> list[np.ndarray]:
    """Jacobian columns of each frame or mount: those given in its own rows, zero in the others.

    Args:
        columns: (n, 3, c).
        owner: (n,) int, frame or mount of each row.
        count: how many there are; None for those that own a row, by whatever labels.

    Returns:
        (n, 3, c) for each.
    """
    if count == 1:
        return [columns]
    owners = np.unique(owner) if count is None else np.arange(count)
    return [np.where((owner == one)[:, None, None], columns, 0.0) for one in owners]


_GENERATORS = torch.tensor(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ],
    dtype=torch.float64,
)


def kabsch(place: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares rigid motion from places to readings; of places on a line with the least turn about it.

    A single place gives no rotation; without any place all is NaN.

    Args:
        place: (n, 3) mm.
        reading: (n, 3) mm.

    Returns:
        R (3, 3) and t (3,) mm with reading = R place + t.

    Source: Kabsch, Acta Crystallographica A32 (1976) 922.
    """
    if not len(place):
        return np.full((3, 3), np.nan), np.full(3, np.nan)
    middle, centre = place.mean(axis=0), reading.mean(axis=0)
    about, read = place - middle, reading - centre
    turn = _turn_of(read.T @ about)
    _, sizes, axes = np.linalg.svd(about, full_matrices=False)
    if sizes[0] <= ROUNDING * np.abs(place).max() * np.sqrt(len(place)):  # one place, but for rounding
        return np.eye(3), centre - middle
    width = sizes[1] / np.sqrt(len(place)) if len(sizes) > 1 else 0.0
    if len(sizes) < 2 or sizes[1] < LINE * sizes[0]:
        left = float(np.median(np.linalg.norm(read - about @ turn.T, axis=1)))
        if width <= max(TOLD * left, ROUNDING * sizes[0]):
            along = read.T @ (about @ axes[0])
            turn = _turn_of(np.outer(along / max(float(np.linalg.norm(along)), 1e-300), axes[0]) + FAINT * np.eye(3))
    return turn, centre - turn @ middle


def _turn_of(cross: np.ndarray) -> np.ndarray:
    """The rotation nearest to a cross-covariance, (3, 3)."""
    left, _, right = np.linalg.svd(cross)
    return np.asarray(left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right)
