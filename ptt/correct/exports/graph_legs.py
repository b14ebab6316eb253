"""Legs of a 3-PTT as nodes of an ONNX graph: columns are legs, a vector is three such nodes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ptt.correct.exports.graph import Graph, Node
from ptt.machine import MachineFile
from ptt.mechanisms.statics import GRAVITY
from ptt.mechanisms.three_ptt import ThreePtt

Vector = Sequence[Any]


def _none() -> list[Any]:
    return [None, None, None]


@dataclass
class GraphLegs:
    """Nodes that effects of a 3-PTT need at a command, n rows, and the shifts that effects have added so far.

    Attributes:
        graph: the graph.
        file: the machine.
        mechanism: the drawing.
        q: command, (n, 3) mm.
        a: actual slider heights, command with drive errors, (n, 3) mm.
        p: the drawing's tool at the command, three (n, 1) mm; None where no effect needs it.
        payload: (n, 1) kg.
        warmth: temperature less reference temperature, (n, 1) K.
        drive: shift of the drives, (n, 3) mm.
        centre: shift of the joint centres, three (n, 3) mm.
        length: shift of the link lengths, (n, 3) mm.
        platform: shift of the tool on the platform, three (n, 1) mm.
        tool: shift of the tool in space, three (n, 1) mm.
    """

    graph: Graph
    file: MachineFile
    mechanism: ThreePtt
    q: Node
    a: Node
    p: Vector | None
    payload: Node
    warmth: Node
    drive: Any = None
    centre: list[Any] = field(default_factory=_none)
    length: Any = None
    platform: list[Any] = field(default_factory=_none)
    tool: list[Any] = field(default_factory=_none)

    @property
    def home(self) -> np.ndarray:
        """Heights at p = 0, (1, 3) mm."""
        return np.asarray(self.mechanism.home().numpy()[None])

    @property
    def outward(self) -> np.ndarray:
        """Radial directions, (3, 3)."""
        return np.asarray(self.mechanism.outward.numpy())

    @property
    def across(self) -> np.ndarray:
        """Directions at right angles to the rails, as their upper ends lean outward, (3, 3)."""
        return np.asarray(self.mechanism.across.numpy())

    @property
    def aside(self) -> np.ndarray:
        """Tangential directions, (3, 3)."""
        return np.asarray(self.mechanism.outer_axis.numpy())

    def links(self) -> Vector:
        """The drawing's link vectors, three (n, 3) mm."""
        assert self.p is not None
        foot, rail = self.mechanism.foot.numpy(), self.mechanism.rail.numpy()
        return [self.p[x] - foot[None, :, x] - self.q * rail[None, :, x] for x in range(3)]

    def weight(self) -> Node:
        """Weight of platform and payload, (n, 1) N."""
        spec = self.file.machine
        assert spec.kind == "three-ptt"
        return (self.payload + np.array([[spec.platform_mass_kg]])) * np.array([[GRAVITY]])

    def move_drive(self, shift: Any) -> None:
        """Add to the drives."""
        self.drive = self.graph.value(shift) if self.drive is None else self.drive + shift

    def move_centre(self, shift: Vector) -> None:
        """Add to the joint centres."""
        self.centre = [
            self.graph.value(new) if old is None else old + new for old, new in zip(self.centre, shift, strict=True)
        ]

    def stretch(self, shift: Any) -> None:
        """Add to the link lengths."""
        self.length = self.graph.value(shift) if self.length is None else self.length + shift

    def move_tool(self, shift: Vector) -> None:
        """Add to where the tool is in space."""
        self.tool = [old if new is None else new if old is None else old + new
                     for old, new in zip(self.tool, shift, strict=True)]  # fmt: skip


def split_columns(p: Node) -> Vector:
    """(n, 3) as three (n, 1)."""
    return [p.take(axis) for axis in range(3)]


def cross(u: Vector, v: Vector) -> Vector:
    """Cross product of vectors whose parts broadcast."""
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def dot(u: Vector, v: Vector) -> Any:
    """Inner product of vectors whose parts broadcast."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def intersect_spheres(graph: Graph, mechanism: ThreePtt, q: Node, grown: tuple[Vector, Any] | None) -> Vector:
    """Forward kinematics: intersection of three spheres, three (n, 1) mm; `grown` shifts centres and link lengths."""
    foot, rail, link = mechanism.foot.numpy(), mechanism.rail.numpy(), mechanism.link.numpy()
    centre = [q * rail[None, :, x] + foot[None, :, x] for x in range(3)]
    length: Any = graph.value(link[None])
    if grown is not None:
        centre = [part + shift for part, shift in zip(centre, grown[0], strict=True)]
        length = length + grown[1]
    first, second, third = ([part.take(leg) for part in centre] for leg in range(3))
    square = length * length
    one, two, three = (square.take(leg) for leg in range(3))
    e2, e3 = ([b - a for a, b in zip(first, other, strict=True)] for other in (second, third))
    normal = cross(e2, e3)
    d22, d23, d33, area = dot(e2, e2), dot(e2, e3), dot(e3, e3), dot(normal, normal)
    along2, along3 = 0.5 * (d22 + (one - two)), 0.5 * (d33 + (one - three))
    part2 = (along2 * d33 - along3 * d23) / area
    part3 = (along3 * d22 - along2 * d23) / area
    height = mechanism.side * ((one - part2 * along2 - part3 * along3) / area).sqrt()
    return [first[x] + part2 * e2[x] + part3 * e3[x] + height * normal[x] for x in range(3)]
