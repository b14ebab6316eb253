"""Vector arithmetic on mixed nodes and plain numbers; operations that are trivial or between numbers make no node."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ptt.correct.exports.graph import Node

Vector = Sequence[Any]
ONE = np.array([[1.0]])  # makes a number a (1, 1) constant
NEARLY = 1e-3  # onnxruntime drops a factor that differs from one by a hundred-thousandth: add the difference instead


def multiply(a: Any, b: Any) -> Any:
    """Product."""
    if isinstance(a, Node) or isinstance(b, Node):
        number, value = (a, b) if isinstance(b, Node) else (b, a)
        if isinstance(number, Node):
            return a * b
        if number in (0.0, 1.0):
            return value if number else 0.0
        if abs(number - 1.0) < NEARLY:
            return value + value * (ONE * (number - 1.0))
        return value * (ONE * number)
    return a * b


def add(a: Any, b: Any) -> Any:
    """Sum."""
    if not isinstance(a, Node) and not isinstance(b, Node):
        return a + b
    number, value = (a, b) if isinstance(b, Node) else (b, a)
    if isinstance(number, Node):
        return a + b
    return value if number == 0.0 else value + ONE * number


def subtract(a: Any, b: Any) -> Any:
    """Difference."""
    return add(a, multiply(-1.0, b))


def cross(u: Vector, v: Vector) -> Vector:
    """Cross product."""
    return [subtract(multiply(u[i], v[j]), multiply(u[j], v[i])) for i, j in ((1, 2), (2, 0), (0, 1))]


def dot(u: Vector, v: Vector) -> Any:
    """Inner product."""
    return add(add(multiply(u[0], v[0]), multiply(u[1], v[1])), multiply(u[2], v[2]))


def turned(u: Vector, v: Vector, cosine: Any, sine: Any) -> tuple[Vector, Vector]:
    """Two axes rotated in their plane, from the first toward the second."""
    pairs = list(zip(u, v, strict=True))
    one = [add(multiply(cosine, a), multiply(sine, b)) for a, b in pairs]
    return one, [subtract(multiply(cosine, b), multiply(sine, a)) for a, b in pairs]


def move_along(origin: Vector, axis: Vector, way: Any) -> Vector:
    """A point moved along an axis."""
    return [add(o, multiply(way, a)) for o, a in zip(origin, axis, strict=True)]
