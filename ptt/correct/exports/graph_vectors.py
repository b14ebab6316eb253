"""Arithmetic of graph values and plain numbers together: what a number settles by itself is no node of the graph."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ptt.correct.exports.graph import Node

Vector = Sequence[Any]
FLAT = np.array([[1.0]])
NEARLY = 1e-3  # onnxruntime leaves out a factor that is one but for a hundred-thousandth


def by(a: Any, b: Any) -> Any:
    """Product."""
    if isinstance(a, Node) or isinstance(b, Node):
        number, value = (a, b) if isinstance(b, Node) else (b, a)
        if isinstance(number, Node):
            return a * b
        if number in (0.0, 1.0):
            return value if number else 0.0
        if abs(number - 1.0) < NEARLY:
            return value + value * (FLAT * (number - 1.0))
        return value * (FLAT * number)
    return a * b


def plus(a: Any, b: Any) -> Any:
    """Sum."""
    if not isinstance(a, Node) and not isinstance(b, Node):
        return a + b
    number, value = (a, b) if isinstance(b, Node) else (b, a)
    if isinstance(number, Node):
        return a + b
    return value if number == 0.0 else value + FLAT * number


def less(a: Any, b: Any) -> Any:
    """Difference."""
    return plus(a, by(-1.0, b))


def cross(u: Vector, v: Vector) -> Vector:
    """Cross product."""
    return [less(by(u[i], v[j]), by(u[j], v[i])) for i, j in ((1, 2), (2, 0), (0, 1))]


def dot(u: Vector, v: Vector) -> Any:
    """Inner product."""
    return plus(plus(by(u[0], v[0]), by(u[1], v[1])), by(u[2], v[2]))


def turned(u: Vector, v: Vector, cosine: Any, sine: Any) -> tuple[Vector, Vector]:
    """Two axes after a turn from the first toward the second."""
    pairs = list(zip(u, v, strict=True))
    one = [plus(by(cosine, a), by(sine, b)) for a, b in pairs]
    return one, [less(by(cosine, b), by(sine, a)) for a, b in pairs]


def along_by(origin: Vector, axis: Vector, way: Any) -> Vector:
    """A point moved along an axis."""
    return [plus(o, by(way, a)) for o, a in zip(origin, axis, strict=True)]
