"""Effects of a 3-PTT as nodes of an ONNX graph."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.correct.exports.graph import Node
from ptt.correct.exports.graph_legs import GraphLegs, Vector, cross, dot, intersect_spheres
from ptt.effects import Effect
from ptt.effects.layout import sizes
from ptt.effects.shapes import SHAPES, WAVES, curve_pieces, wavy_pieces


def _minors(link: Vector) -> tuple[Vector, Any]:
    """Cofactors of the 3 x 3 matrix of link vectors, three (n, 3), and its determinant (n, 1)."""
    minor = cross([part.take(1, 2, 0) for part in link], [part.take(2, 0, 1) for part in link])
    return minor, dot(link, minor).take(0)


def _solve(rows: Vector, right: Any) -> Vector:
    """Solution of a 3 x 3 system by Cramer's rule, three (n, 1)."""
    minor, volume = _minors(rows)
    return [(right * part).sum() / volume for part in minor]


def _tension(s: GraphLegs) -> Any:
    """Tension in each link under the weight of platform and payload, (n, 3) N."""
    link = s.links()
    minor, volume = _minors(link)
    return -(s.weight() * minor[2]) * dot(link, link).sqrt() / volume


def _curve(s: GraphLegs, pieces: np.ndarray, ends: np.ndarray, q: Node) -> Node:
    """A piecewise cubic of each leg, pieces (3, c, 4) by ascending power, constant beyond its range, ends (3, 2) mm."""
    graph, count = s.graph, pieces.shape[1]
    place = (q - ends[None, :, 0]) / (ends[:, 1] - ends[:, 0])[None]
    place = graph.node("Min", graph.node("Max", place, [[0.0]]), [[1.0]])
    piece = graph.node("Min", graph.node("Floor", place * np.array([[float(count)]])), [[count - 1.0]])
    offset = place - piece / np.array([[float(count)]])
    row = graph.node("Cast", piece + (count * np.arange(3.0))[None], to=7)  # int64
    parts = [graph.node("Gather", graph.constant(pieces[:, :, power].ravel()), row, axis=0) for power in range(4)]
    return ((parts[0] * offset + parts[1]) * offset + parts[2]) * offset + parts[3]


def _cut(effect: Effect, theta: np.ndarray) -> list[np.ndarray]:
    return np.split(theta, np.cumsum(sizes(effect, 3))[:-1])


def _pieces(curve: np.ndarray, lines: np.ndarray) -> np.ndarray:
    return np.stack([curve_pieces(curve.reshape(3, SHAPES)[leg], lines[leg]) for leg in range(3)])


def _offset(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    s.move_drive(t[None, :3])


def _lead(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    s.move_drive((s.q - s.home) * t[None])


def _turn(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    phase = s.q * np.full((1, 3), 2.0 * np.pi / t[6])  # as an array: onnxruntime drops a scalar factor near one
    # As a sine: not every runtime has a cosine of doubles.
    cosine = s.graph.node("Sin", phase + np.array([[0.5 * np.pi]]))
    s.move_drive(cosine * t[None, :3] + s.graph.node("Sin", phase) * t[None, 3:6])


def _screw_growth(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    s.move_drive(s.warmth * ((s.q - s.home) * t[None, :3] + t[None, 3:6]))  # a held temperature is no longer late


def _screw_map(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    curve, straight, waves, low, high = _cut(effect, t)
    legs = zip(curve.reshape(3, SHAPES), straight.reshape(3, 2), waves.reshape(3, WAVES), strict=True)
    pieces = np.stack([wavy_pieces(*leg) for leg in legs])
    s.move_drive(_curve(s, pieces, np.stack([low, high], axis=1), s.q))


def _axis(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    link, rail = s.links(), s.mechanism.rail.numpy()
    minor, volume = _minors(link)
    along = dot(link, [rail[None, :, x] for x in range(3)])
    s.move_drive(-(s.weight() * minor[2]) * along / volume * t[None])


def _position(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    shift = t[:3, None] * s.mechanism.foot_direction.numpy() + t[3:, None] * s.aside
    s.move_centre([shift[None, :, x] for x in range(3)])


def _tilt(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    rail = s.mechanism.rail.numpy()
    turn = t[:3, None] * s.aside - t[3:, None] * s.across
    once = np.cross(turn, rail)
    lean = once + 0.5 * np.cross(turn, once)
    s.move_centre([(s.a - s.home) * lean[None, :, x] for x in range(3)])


def _guide(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    radial, tangential, straight, low, high = _cut(effect, t)
    lines, ends = straight.reshape(3, 2, 2), np.stack([low, high], axis=1)
    out = _curve(s, _pieces(radial, lines[:, 0]), ends, s.a)
    along = _curve(s, _pieces(tangential, lines[:, 1]), ends, s.a)
    s.move_centre([out * s.across[None, :, x] + along * s.aside[None, :, x] for x in range(3)])


def _length(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    s.stretch(t[None])


def _joint(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    link, lengths = s.links(), 1.0 / s.mechanism.link.numpy()[None]
    rail = s.mechanism.rail.numpy()
    along = dot(link, [rail[None, :, x] for x in range(3)]).abs() * lengths
    aside = dot(link, [s.aside[None, :, x] for x in range(3)]) * lengths
    s.stretch(along * t[None, :3] + (1.0 - aside * aside).sqrt() * t[None, 3:])


def _clearance(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    s.stretch(s.graph.node("Sign", _tension(s)) * (0.5 * t)[None])


def _stretch(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    s.stretch(_tension(s) * t[None])


def _turned(turn: Vector, arm: Vector) -> Vector:
    once = cross(turn, arm)
    return [a + 0.5 * b for a, b in zip(once, cross(turn, once), strict=True)]


def _twist(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    spec = s.file.machine
    assert spec.kind == "three-ptt"
    link, axis = s.links(), [s.aside[None, :, x] for x in range(3)]
    skewed = s.aside + t[:3, None] * s.outward + t[3:, None] * np.array([0.0, 0.0, 1.0])
    skew = [skewed[None, :, x] for x in range(3)]
    arm = [spec.platform_radius_mm * s.outward[None, :, x] for x in range(3)]
    along = dot(link, axis)
    rows = [link[x] - along * axis[x] for x in range(3)]
    turn: Vector = [s.graph.constant([[0.0]]) for _ in range(3)]
    moved, swung = link, arm
    for count in range(2):
        vector = [a + b for a, b in zip(_turned(turn, skew), skew, strict=True)]
        step = _solve(rows, dot(moved, cross(axis, vector)))
        turn = [a - b for a, b in zip(turn, step, strict=True)]
        swung = list(_turned(turn, arm))
        if count == 0:
            centre = _solve(link, dot(link, swung))
            moved = [link[x] + swung[x] - centre[x] for x in range(3)]
    s.move_centre([-part for part in swung])
    shift = _turned(turn, [np.array([[value]]) for value in spec.reflector_mm])
    s.platform = [new if old is None else old + new for old, new in zip(s.platform, shift, strict=True)]


def _bend(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    height = (s.a - s.home).sum() * np.array([[1.0 / 3.0]])
    s.move_tool([s.payload * (t[x] + t[2 + x] * height) for x in (0, 1)] + [None])


def _growth(s: GraphLegs, t: np.ndarray, effect: Effect) -> None:
    spec = s.file.machine
    assert spec.kind == "three-ptt"
    angle = np.radians(spec.slider_azimuth_deg)
    way = np.stack([np.cos(angle), np.sin(angle), np.zeros(3)]) * spec.base_radius_mm * t[0]
    centre = [s.warmth * way[None, x] for x in range(3)]
    grown = intersect_spheres(s.graph, s.mechanism, s.a, (centre, s.warmth * np.array([[t[1] * spec.link_length_mm]])))
    still = intersect_spheres(s.graph, s.mechanism, s.a, None)
    s.move_tool([a - b for a, b in zip(grown, still, strict=True)])


@dataclass(frozen=True)
class GraphEffect:
    """An effect's nodes.

    Attributes:
        add: adds its shifts to the legs, from its parameters.
        context: inputs that it needs beside the position.
        drawn: whether it needs the drawing's link vectors.
    """

    add: Callable[[GraphLegs, np.ndarray, Effect], None]
    context: tuple[str, ...] = ()
    drawn: bool = False


EFFECTS: dict[str, GraphEffect] = {
    "homing-offset": GraphEffect(_offset),
    "homing-slip": GraphEffect(_offset),
    "lead-scale": GraphEffect(_lead),
    "once-per-rev": GraphEffect(_turn),
    "screw-growth": GraphEffect(_screw_growth, ("temperature",)),
    "screw-error-map": GraphEffect(_screw_map),
    "axis-compliance": GraphEffect(_axis, ("payload",), True),
    "tower-position": GraphEffect(_position),
    "tower-tilt": GraphEffect(_tilt),
    "guide-straightness": GraphEffect(_guide),
    "link-length": GraphEffect(_length),
    "joint-offset": GraphEffect(_joint, (), True),
    "joint-clearance": GraphEffect(_clearance, ("payload",), True),
    "link-compliance": GraphEffect(_stretch, ("payload",), True),
    "platform-twist": GraphEffect(_twist, (), True),
    "column-bend": GraphEffect(_bend, ("payload",)),
    "frame-growth": GraphEffect(_growth, ("temperature",)),
}
