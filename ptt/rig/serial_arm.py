"""A virtual serial arm with faults: a chain of 4 x 4 matrices in numpy, loads by virtual work, play step by step."""

import math
from dataclasses import dataclass

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.nominal import Array

GRAVITY = 9.80665  # m/s^2
NUDGE = 1e-5  # rad, step of the numerical derivative of the potential energy
SETTLE = 4  # rounds in which load and deflection find each other


@dataclass(frozen=True)
class ArmFaults:
    """What is wrong with an arm of k joints.

    Attributes:
        link: (k, 4) errors of a (mm), alpha (rad), d (mm) and theta (rad).
        gap: (k,) play of each joint, rad.
        compliance: (k,) yield of each joint, rad per N mm.
        growth: expansion of every length, 1/K.
        wobble: (k, m, 2) cosine and sine of the m-th harmonic of each joint's turn, rad.
        mass: (k, 4) what each link really weighs, kg, and its centre of mass in the frame that it carries, mm; None
            for the drawing's.
    """

    link: Array
    gap: Array
    compliance: Array
    growth: float
    wobble: Array
    mass: Array | None = None

    @classmethod
    def none(cls, joints: int) -> "ArmFaults":
        """A sound arm."""
        return cls(np.zeros((joints, 4)), np.zeros(joints), np.zeros(joints), 0.0, np.zeros((joints, 0, 2)))


@dataclass(frozen=True)
class ArmRig:
    """A virtual arm under a tracker.

    Attributes:
        spec: the drawing.
        faults: what the drawing does not know.
        reflector_mm: (3,) place of the reflector beside the drawing's tool point, in the tool's frame.
        tracker: (4, 4) base frame to tracker frame.
        sigma_mm: scatter of one coordinate.
    """

    spec: SerialSpec
    faults: ArmFaults
    reflector_mm: Array
    tracker: Array
    sigma_mm: float

    def measure(self, q: Array, payload: Array, temperature: Array, seed: int) -> Array:
        """Drive through joint commands and read the tracker at each.

        Args:
            q: (n, k) rad, in travel order.
            payload: (n,) kg at the tool point.
            temperature: (n,) deg C.
            seed: of the scatter.

        Returns:
            (n, 3) mm in tracker coordinates.
        """
        place = self.tip(self.settle(q, payload, temperature)[1])
        turned = place @ self.tracker[:3, :3].T + self.tracker[:3, 3]
        return turned + self.sigma_mm * np.random.default_rng(seed).standard_normal(turned.shape)

    def settle(self, q: Array, payload: Array, temperature: Array) -> tuple[Array, Array]:
        """Where joints and last link come to rest after each command.

        Args:
            q: (n, k) rad, in travel order.
            payload: (n,) kg at the tool point.
            temperature: (n,) deg C.

        Returns:
            Joint values (n, k) rad, and the frame that the last link carries, (n, 4, 4), in the base frame.
        """
        driven = self._driven(np.asarray(q, dtype=float))
        growth = 1.0 + self.faults.growth * (np.asarray(temperature) - self.spec.reference_temp_c)
        joint = np.stack([self._yielded(*row) for row in zip(driven, payload, growth, strict=True)])
        return joint, np.stack([self._frames(*row)[-1] for row in zip(joint, growth, strict=True)])

    def tool(self, frame: Array) -> Array:
        """Place of the drawing's tool point on last links at rest, (n, 3) mm in the base frame."""
        return np.asarray(frame[:, :3, :3] @ np.asarray(self.spec.tool_mm) + frame[:, :3, 3])

    def tip(self, frame: Array) -> Array:
        """Place of the reflector on last links at rest, (n, 3) mm in the base frame."""
        return self.tool(frame) + frame[:, :3, :3] @ self.reflector_mm

    def _driven(self, q: Array) -> Array:
        """Joint values behind uneven rings and play."""
        order = np.arange(1, self.faults.wobble.shape[1] + 1)
        phase = q[..., None] * order
        uneven = (np.cos(phase) * self.faults.wobble[..., 0] + np.sin(phase) * self.faults.wobble[..., 1]).sum(axis=-1)
        half = 0.5 * self.faults.gap
        ahead = np.sign(q[1] - q[0]) if len(q) > 1 else np.ones(q.shape[1])
        follower = np.empty_like(q)
        follower[0] = q[0] - np.where(ahead == 0, 1.0, ahead) * half
        for row in range(1, len(q)):
            follower[row] = np.clip(follower[row - 1], q[row] - half, q[row] + half)
        return follower + uneven

    def _yielded(self, joint: Array, payload: float, growth: float) -> Array:
        """Joint values under load, (k,) rad."""
        at = joint
        for _ in range(SETTLE if self.faults.compliance.any() else 0):
            torque = np.array([self._torque(at, index, payload, growth) for index in range(len(joint))])
            at = joint + self.faults.compliance * torque
        return at

    def _torque(self, joint: Array, index: int, payload: float, growth: float) -> float:
        """Torque of all weights about one joint, N mm: the fall of the potential energy."""
        step = NUDGE * np.eye(len(joint))[index]
        return float(self._energy(joint - step, payload, growth) - self._energy(joint + step, payload, growth)) / (
            2.0 * NUDGE
        )

    def _energy(self, joint: Array, payload: float, growth: float) -> float:
        """Potential energy of links and payload, N mm."""
        frames = self._frames(joint, growth)
        down = np.asarray(self.spec.gravity) / np.linalg.norm(self.spec.gravity)
        energy = -payload * GRAVITY * down @ (frames[-1] @ np.append(self.spec.tool_mm, 1.0))[:3]
        for frame, (mass, *centre) in zip(frames, self._masses(), strict=True):
            energy -= mass * GRAVITY * down @ (frame @ np.array([*centre, 1.0]))[:3]
        return float(energy)

    def _masses(self) -> Array:
        """Mass and centre of each link, (k, 4) kg and mm."""
        if self.faults.mass is not None:
            return self.faults.mass
        return np.array([[link.mass_kg or 0.0, *(link.com_mm or (0.0, 0.0, 0.0))] for link in self.spec.joint])

    def _frames(self, joint: Array, growth: float) -> list[Array]:
        """Frame that each link carries, (4, 4) each."""
        frame, frames = np.eye(4), []
        for link, value, (da, dalpha, dd, dtheta) in zip(self.spec.joint, joint, self.faults.link, strict=True):
            turn = value + math.radians(link.theta_offset_deg) + dtheta
            along_z = _screw(2, turn, (link.d_mm + dd) * growth)
            along_x = _screw(0, math.radians(link.alpha_deg) + dalpha, (link.a_mm + da) * growth)
            frame = frame @ along_z @ along_x if self.spec.convention == "standard" else frame @ along_x @ along_z
            frames.append(frame)
        return frames


def _screw(axis: int, turn: float, slide: float) -> Array:
    """Turn about an axis and slide along it, (4, 4)."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[first, first] = matrix[second, second] = math.cos(turn)
    matrix[first, second], matrix[second, first] = -math.sin(turn), math.sin(turn)
    matrix[axis, 3] = slide
    return matrix


def rigid(turn: Array, shift: Array) -> Array:
    """Rigid motion as a (4, 4) matrix.

    Args:
        turn: (3,) rotation vector, rad.
        shift: (3,) mm.

    Returns:
        The matrix.
    """
    angle = float(np.linalg.norm(turn))
    axis = np.asarray(turn) / angle if angle else np.array([0.0, 0.0, 1.0])
    cross = np.cross(np.eye(3), axis)
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * -cross + (1.0 - math.cos(angle)) * cross @ cross
    matrix[:3, 3] = shift
    return matrix
