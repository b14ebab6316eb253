"""A serial arm as nodes of an ONNX graph: its chain, its effects, and the iteration for corrected joint values.

A vector is three values, each a node (n, 1) or a plain number; constants stay numbers until a node enters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from ptt.correct.exports.graph import Graph, Node
from ptt.correct.exports.graph_vectors import ONE, Vector, add, cross, dot, move_along, multiply, subtract, turned
from ptt.effects import Effect
from ptt.effects.layout import sizes
from ptt.machine import SerialSpec
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.statics import GRAVITY, gravity_of
from ptt.mechanisms.workspace import translation_rank

ROUNDS = 7  # of Newton: each leaves a hundredth of the error or less, so five or six reach rounding
FAINT = 1e-12  # damping, of the squared length of an arm whose tool moves in a plane: J J^T is singular there


@dataclass(frozen=True)
class Frame:
    """A frame in base coordinates: unit vectors, and the origin in mm."""

    x: Vector
    y: Vector
    z: Vector
    origin: Vector

    def point(self, local: Vector) -> Vector:
        """A point of this frame in base coordinates, mm."""
        parts = zip(self.x, self.y, self.z, self.origin, strict=True)
        return [
            add(add(add(o, multiply(local[0], x)), multiply(local[1], y)), multiply(local[2], z))
            for x, y, z, o in parts
        ]


@dataclass(frozen=True)
class GraphArm:
    """Nodes that effects of an arm need at a command, n rows.

    Attributes:
        graph: the graph.
        arm: the drawing.
        spec: its [machine] section.
        q: commands, k of (n, 1) rad.
        axes: k frames whose z are the joint axes.
        ends: k frames at the ends of the links.
        lever: Jacobian columns dp/dq of the joints, k vectors, mm/rad.
        payload: (n, 1) kg.
        warmth: temperature less reference temperature, (n, 1) K.
    """

    graph: Graph
    arm: Serial
    spec: SerialSpec
    q: Sequence[Node]
    axes: Sequence[Frame]
    ends: Sequence[Frame]
    lever: Sequence[Vector]
    payload: Node
    warmth: Node


def link_parameters(arm: Serial, errors: np.ndarray | None) -> list[list[Any]]:
    """Denavit-Hartenberg a, alpha, d, theta offset and beta of each link (mm, rad), plus errors (k, 5) where given."""
    drawn = np.column_stack([arm.a_mm, arm.alpha_rad, arm.d_mm, arm.offset_rad, np.zeros(arm.joints)])
    return (drawn if errors is None else drawn + errors).tolist()


def frames_along_chain(
    arm: Serial, links: Sequence[Sequence[Any]], q: Sequence[Node]
) -> tuple[list[Frame], list[Frame]]:
    """Forward kinematics along the chain: frames whose z are the joint axes, and frames at the links' ends."""
    unit: Sequence[Vector] = np.eye(3).tolist()
    here, axes, ends = Frame(unit[0], unit[1], unit[2], [0.0, 0.0, 0.0]), list[Frame](), list[Frame]()
    for (a, alpha, d, turn, beta), value in zip(links, q, strict=True):
        if arm.convention != "standard":
            here = _screw_x(here, a, alpha, beta)
        axes.append(here)
        angle = add(value, turn)
        x, y = turned(here.x, here.y, _cosine(angle), angle.graph.node("Sin", angle))
        here = Frame(x, y, here.z, move_along(here.origin, here.z, d))
        if arm.convention == "standard":
            here = _screw_x(here, a, alpha, beta)
        ends.append(here)
    return axes, ends


def _screw_x(here: Frame, a: Any, alpha: float, beta: float) -> Frame:
    """A frame moved by a along x, rotated by alpha about x, then by beta about y."""
    y, z = turned(here.y, here.z, float(np.cos(alpha)), float(np.sin(alpha)))
    origin = move_along(here.origin, here.x, a)
    z, x = turned(z, here.x, float(np.cos(beta)), float(np.sin(beta)))
    return Frame(x, y, z, origin)


def _cosine(angle: Node) -> Node:
    # As a sine: not every runtime has a cosine of doubles.
    return angle.graph.node("Sin", angle + ONE * (0.5 * np.pi))


def inverse_nodes(
    graph: Graph, arm: Serial, spec: SerialSpec, effects: Sequence[tuple[Effect, np.ndarray]], nominal: Node,
    payload: Node, warmth: Node,
) -> Node:  # fmt: skip
    """Corrected joint values beside nominal ones, (n, k) rad, by the steps of `ptt.correct.newton`.

    Args:
        graph: the graph.
        arm: the drawing.
        spec: its file.
        effects: those that are held, with their parameters.
        nominal: joint values of the targets by the drawing, (n, k) rad.
        payload: (n, 1) kg.
        warmth: temperature less reference temperature, (n, 1) K.

    Returns:
        The values.
    """
    drawn, q = link_parameters(arm, None), [nominal.take(joint) for joint in range(arm.joints)]
    errors = [_errors(arm, theta) for effect, theta in effects if effect.name == "dh-offsets"]
    links = link_parameters(arm, sum(errors, np.zeros((arm.joints, 5))))
    goal = frames_along_chain(arm, drawn, q)[1][-1].point(arm.tool_mm)
    damping = FAINT * arm.length_mm**2 if translation_rank(arm) < 3 else 0.0
    for _ in range(ROUNDS if effects else 0):
        axes, ends = frames_along_chain(arm, drawn, q)
        tip = ends[-1].point(arm.tool_mm)
        lever = [cross(axis.z, [subtract(t, o) for t, o in zip(tip, axis.origin, strict=True)]) for axis in axes]
        state = GraphArm(graph, arm, spec, q, axes, ends, lever, payload, warmth)
        moved = list(q)
        for effect, theta in effects:
            if effect.name in DRIVES:
                shifts = DRIVES[effect.name].add(state, theta, effect)
                moved = [add(value, shift) for value, shift in zip(moved, shifts, strict=True)]
        there = frames_along_chain(arm, links, moved)[1][-1].point(arm.tool_mm)
        for effect, theta in effects:
            if effect.name == "frame-growth":
                there = [add(a, b) for a, b in zip(there, _grown(state, moved, theta), strict=True)]
        step = _damped_least_norm_step(lever, [subtract(a, b) for a, b in zip(goal, there, strict=True)], damping)
        q = [add(value, part) for value, part in zip(q, step, strict=True)]
    return graph.node("Concat", *q, axis=1)


def _damped_least_norm_step(lever: Sequence[Vector], step: Vector, damping: float) -> list[Any]:
    """Damped least-norm joint step J^T (J J^T + damping I)^-1 step; the 3 x 3 matrix is inverted by its cofactors."""
    square = [
        [reduce(add, [multiply(each[row], each[column]) for each in lever]) for column in range(3)] for row in range(3)
    ]
    square = [[add(value, damping) if i == j else value for j, value in enumerate(row)] for i, row in enumerate(square)]
    minors = [cross(square[(row + 1) % 3], square[(row + 2) % 3]) for row in range(3)]
    volume = dot(square[0], minors[0])
    force = [reduce(add, [multiply(minors[row][axis], step[row]) for row in range(3)]) / volume for axis in range(3)]
    return [dot(each, force) for each in lever]


def _errors(arm: Serial, theta: np.ndarray) -> np.ndarray:
    errors = theta.reshape(5, arm.joints).T.copy()
    errors[:, 4] *= arm.parallel_axes()
    return errors


def _offset(s: GraphArm, t: np.ndarray, effect: Effect) -> list[Any]:
    return t[: s.arm.joints].tolist()


def _scale(s: GraphArm, t: np.ndarray, effect: Effect) -> list[Any]:
    return [multiply(float(share), value) for share, value in zip(t, s.q, strict=True)]


def _turn(s: GraphArm, t: np.ndarray, effect: Effect) -> list[Any]:
    k, found = s.arm.joints, []
    for joint, value in enumerate(s.q):
        phase = multiply(float(2.0 * np.pi / t[2 * k]), value)
        found.append(
            add(multiply(float(t[joint]), _cosine(phase)), multiply(float(t[k + joint]), s.graph.node("Sin", phase)))
        )
    return found


def _error_map(s: GraphArm, t: np.ndarray, effect: Effect) -> list[Any]:
    cut = np.split(t, np.cumsum(sizes(effect, s.arm.joints))[:-1])
    cosine, sine = (
        np.concatenate([part.reshape(s.arm.joints, -1) for part in cut[start::2]], axis=1) for start in (0, 1)
    )
    order, found = np.arange(1.0, cosine.shape[1] + 1.0)[None], []
    for joint, value in enumerate(s.q):
        phase = value * order
        found.append(_cosine(phase) @ cosine[joint][:, None] + s.graph.node("Sin", phase) @ sine[joint][:, None])
    return found


def _yield(s: GraphArm, t: np.ndarray, effect: Effect) -> list[Any]:
    """Joint yield under the torque of the payload at the tool and of links with a stated mass, by virtual work, rad."""
    down = [float(value) for value in gravity_of(s.spec)]
    torque = [multiply(s.payload, multiply(GRAVITY, dot(each, down))) for each in s.lever]
    for index, joint in enumerate(s.spec.joint):
        if joint.mass_kg:
            centre = s.ends[index].point(joint.com_mm or (0.0, 0.0, 0.0))
            force = [GRAVITY * joint.mass_kg * value for value in down]
            for moved in range(index + 1):
                axis = s.axes[moved]
                arm = [subtract(c, o) for c, o in zip(centre, axis.origin, strict=True)]
                torque[moved] = add(torque[moved], dot(cross(axis.z, arm), force))
    return [multiply(float(share), value) for share, value in zip(t, torque, strict=True)]


def _sag(s: GraphArm, t: np.ndarray, effect: Effect) -> list[Any]:
    down, k = [float(value) for value in gravity_of(s.spec)], s.arm.joints
    pairs, number, found = k * (k + 1) // 2, 0, []
    for joint in range(k):
        pull, total = cross(down, s.axes[joint].z), 0.0
        for behind in range(joint, k):
            x = s.ends[behind].x
            total = add(total, multiply(float(t[number]), dot(pull, x)))
            total = add(total, multiply(float(t[pairs + number]), dot(pull, cross(s.axes[behind].z, x))))
            number += 1
        found.append(total)
    return found


def _grown(s: GraphArm, moved: Sequence[Node], t: np.ndarray) -> Vector:
    grown = [
        [
            multiply(add(multiply(float(t[0]), s.warmth), 1.0), a),
            alpha,
            multiply(add(multiply(float(t[1]), s.warmth), 1.0), d),
            turn,
            beta,
        ]
        for a, alpha, d, turn, beta in link_parameters(s.arm, None)
    ]
    still, there = (
        frames_along_chain(s.arm, each, moved)[1][-1].point(s.arm.tool_mm)
        for each in (link_parameters(s.arm, None), grown)
    )
    return [subtract(a, b) for a, b in zip(there, still, strict=True)]


@dataclass(frozen=True)
class GraphDrive:
    """Nodes of an effect's joint shifts, and the context it needs."""

    add: Callable[[GraphArm, np.ndarray, Effect], list[Any]]
    context: tuple[str, ...] = ()


DRIVES: dict[str, GraphDrive] = {
    "homing-offset": GraphDrive(_offset),
    "homing-slip": GraphDrive(_offset),
    "lead-scale": GraphDrive(_scale),
    "once-per-rev": GraphDrive(_turn),
    "joint-error-map": GraphDrive(_error_map),
    "axis-compliance": GraphDrive(_yield, ("payload",)),
    "self-weight": GraphDrive(_sag),
}
CONTEXT = {name: known.context for name, known in DRIVES.items()} | {"dh-offsets": (), "frame-growth": ("temperature",)}
