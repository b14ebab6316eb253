"""Solids as triangle meshes: tubes, boxes, plates and arrows, for interactive and static pictures alike."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

SIDES = 10  # of the polygon that stands for a circle
CONE_SIDES = 7  # the same for the head of an arrow
HEAD, WIDTH = 0.38, 0.13  # length and half width of an arrow's head, as shares of the arrow's length


@dataclass(frozen=True, eq=False)
class Solid:
    """A triangle mesh.

    Attributes:
        points: (v, 3) mm.
        faces: (f, 3) int, corners of each triangle.
    """

    points: np.ndarray
    faces: np.ndarray


def joined(solids: Iterable[Solid]) -> Solid:
    """Several solids as one."""
    points, faces, start = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=int)], 0
    for solid in solids:
        points.append(solid.points)
        faces.append(solid.faces + start)
        start += len(solid.points)
    return Solid(np.concatenate(points), np.concatenate(faces))


def tube(start: np.ndarray, end: np.ndarray, radius: float, sides: int = SIDES) -> Solid:
    """A round bar with closed ends.

    Args:
        start: (3,) mm.
        end: (3,) mm.
        radius: mm.
        sides: number of sides of its cross-section; four for a square one.

    Returns:
        The bar.
    """
    across, other = _square_to(end - start)
    turn = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    ring = radius * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other)
    points = np.concatenate([start + ring, end + ring, [start], [end]])
    near = np.arange(sides)
    after = (near + 1) % sides
    walls = np.concatenate(
        [np.column_stack([near, after, near + sides]), np.column_stack([after, after + sides, near + sides])]
    )
    caps = [
        np.column_stack([after, near, np.full(sides, 2 * sides)]),
        np.column_stack([near + sides, after + sides, np.full(sides, 2 * sides + 1)]),
    ]
    return Solid(points, np.concatenate([walls, *caps]))


def block(centre: np.ndarray, along: np.ndarray, half: tuple[float, float]) -> Solid:
    """A slider: a square block along its rail.

    Args:
        centre: (3,) mm.
        along: (3,) direction of the rail.
        half: half its length and half its width, mm.

    Returns:
        The block.
    """
    way = along / max(float(np.linalg.norm(along)), 1e-12) * half[0]
    return tube(centre - way, centre + way, half[1] * np.sqrt(2.0), 4)


def ball(centre: np.ndarray, radius: float) -> Solid:
    """A joint: an octahedron."""
    offsets = np.concatenate([np.eye(3), -np.eye(3)]) * radius
    faces = [(i, j, k) for i in (0, 3) for j in (1, 4) for k in (2, 5)]
    return Solid(centre + offsets, np.asarray(faces))


def plate(corners: np.ndarray, thick: float) -> Solid:
    """A platform: a triangle with a thickness.

    Args:
        corners: (3, 3) mm.
        thick: thickness, mm, half of it on either side.

    Returns:
        The plate.
    """
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    step = 0.5 * thick * normal / max(float(np.linalg.norm(normal)), 1e-12)
    points = np.concatenate([corners + step, corners - step])
    sides = [face for a, b in ((0, 1), (1, 2), (2, 0)) for face in ((a, b, a + 3), (b, b + 3, a + 3))]
    return Solid(points, np.asarray([(0, 1, 2), (3, 5, 4), *sides]))


def arrows(start: np.ndarray, vector: np.ndarray, least: float, most: float = math.inf) -> tuple[Solid, np.ndarray]:
    """Arrows with round shafts and heads.

    Args:
        start: (n, 3) mm.
        vector: (n, 3) mm, from tail to tip.
        least: arrows shorter than this are as thick as one of this length, mm.
        most: largest half width of a head, mm, so that neighbouring arrows stay apart.

    Returns:
        All arrows as one solid, without those of length zero, and the index of the arrow of each point, (v,).
    """
    length = np.linalg.norm(vector, axis=1)
    drawn = np.flatnonzero(length > 0.0)
    tail, way, length = start[drawn, None], vector[drawn, None], length[drawn]
    # However short, an arrow is at most as thick as one 2.5 times as long, so that it still looks like an arrow.
    thick = np.minimum(WIDTH * np.minimum(np.maximum(length, least), 2.5 * length), most)
    across, other = _square_to(vector[drawn])
    one = _one_arrow()
    flat = one.points[:, 1:2] * across[:, None] - one.points[:, 0:1] * other[:, None]  # shape: (n, v, 3)
    points = tail + one.points[:, 2:] * way + thick[:, None, None] * flat
    faces = one.faces + len(one.points) * np.arange(len(drawn))[:, None, None]
    return Solid(points.reshape(-1, 3), faces.reshape(-1, 3)), np.repeat(drawn, len(one.points))


@lru_cache(maxsize=1)
def _one_arrow() -> Solid:
    """An arrow of length one along z whose head has radius one."""
    neck, tip = np.array([0.0, 0.0, 1.0 - HEAD]), np.array([0.0, 0.0, 1.0])
    return joined((tube(np.zeros(3), neck, 0.38, 5), _cone(neck, tip)))


def _square_to(way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors perpendicular to each direction (..., 3) and to each other."""
    unit = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-12)
    helper = np.where(np.abs(unit[..., 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    across = np.cross(unit, helper)
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
    return across, np.cross(unit, across)


def _cone(base: np.ndarray, tip: np.ndarray) -> Solid:
    across, other = _square_to(tip - base)
    near, sides = np.arange(CONE_SIDES), CONE_SIDES
    turn = 2.0 * np.pi * near / sides
    ring = base + np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other
    after = (near + 1) % sides
    points = np.concatenate([ring, [tip], [base]])
    faces = [
        np.column_stack([near, after, np.full(sides, sides)]),
        np.column_stack([after, near, np.full(sides, sides + 1)]),
    ]
    return Solid(points, np.concatenate(faces))
