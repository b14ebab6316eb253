"""A virtual serial arm with faults: a chain of 4 x 4 matrices in numpy, loads by virtual work, play step by step."""

import math
from dataclasses import dataclass

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig import drive
from ptt.rig.arm_travel import arm_path
from ptt.rig.motion import travel_direction
from ptt.rig.nominal import Array
from ptt.rig.screws import screw, shifted, turned
from ptt.rig.units import GRAVITY

NUDGE = 1e-5  # rad, step of the numerical derivative of the potential energy
SETTLE = 4  # rounds in which load and deflection find each other


@dataclass(frozen=True)
class ArmFaults:
    """What is wrong with an arm of k joints.

    Attributes:
        link: (k, 4) errors of a (mm), alpha (rad), d (mm) and theta (rad).
        gap: (k,) play of each joint, rad.
        compliance: (k,) yield of each joint, rad per N mm.
        growth: expansion of every length a, 1/K, and of every offset d where `offset_growth` says nothing else.
        wobble: (k, m, 2) cosine and sine of the m-th harmonic of each joint's turn, rad.
        mass: (k, 4) what each link really weighs, kg, and its centre of mass in the frame that it carries, mm; None
            for the drawing's.
        beta: (k,) turn about the y axis that follows each twist, rad: how far parallel axes are from being so.
        scale: (k,) share by which each joint turns too far.
        added: (k,) play that the controller makes up for, half of it to either side, rad.
        windup: (k, 2) height (rad) and length (rad) of a gradual change-over after a reversal.
        offset_growth: expansion of every offset d, 1/K; None for that of the lengths.
    """

    link: Array
    gap: Array
    compliance: Array
    growth: float
    wobble: Array
    mass: Array | None = None
    beta: Array | float = 0.0
    scale: Array | float = 0.0
    added: Array | float = 0.0
    windup: Array | None = None
    offset_growth: float | None = None

    @classmethod
    def none(cls, joints: int) -> "ArmFaults":
        """A sound arm."""
        return cls(np.zeros((joints, 4)), np.zeros(joints), np.zeros(joints), 0.0, np.zeros((joints, 0, 2)))


@dataclass(frozen=True)
class ArmShifts:
    """What a run adds row by row to the faults of an arm of k joints.

    Attributes:
        joint: (n, k) rad, added to the driven joints.
        gap: (n, k) rad, added to the play.
        tilt: (n, k, 2) rad, by which each joint's axis leans about the x and the y axis of its own frame.
        hand: (n, 3) mm, shift of the tool in its holder, in the tool's frame.
        base: (n, 3) rad, rotation of the base about its origin.
        sight: (n, 3) mm, the tracker's view of the tool alone, base frame.
    """

    joint: Array
    gap: Array
    tilt: Array
    hand: Array
    base: Array
    sight: Array

    @classmethod
    def none(cls, rows: int, joints: int) -> "ArmShifts":
        """A run that adds nothing."""
        flat, three = (rows, joints), (rows, 3)
        shapes = (flat, flat, (*flat, 2), three, three, three)
        return cls(*(np.zeros(shape) for shape in shapes))


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

    def settle(
        self,
        q: Array,
        payload: Array,
        temperature: Array,
        shifts: ArmShifts | None = None,
        run: Array | None = None,
    ) -> tuple[Array, Array]:
        """Where joints and last link come to rest after each command.

        Args:
            q: (n, k) rad, in travel order.
            payload: (n,) kg at the tool point.
            temperature: (n,) deg C.
            shifts: what the run adds.
            run: (n,) number of each row's run; None for a single one.

        Returns:
            Joint values (n, k) rad, and the frame that the last link carries, (n, 4, 4), in the base frame.
        """
        q = np.asarray(q, dtype=float)
        added = shifts or ArmShifts.none(*q.shape)
        driven = self._driven(q, added.gap, run) + added.joint
        warmer = (np.asarray(temperature) - self.spec.reference_temp_c)[:, None]
        other = self.faults.growth if self.faults.offset_growth is None else self.faults.offset_growth
        growth = 1.0 + warmer * np.array([self.faults.growth, other])
        joint = self._yielded(driven, np.asarray(payload, dtype=float), growth)
        frame = self._frames(joint, growth, added.tilt if added.tilt.any() else None)[-1]
        return joint, turned(added.base) @ frame @ shifted(added.hand)

    def tool(self, frame: Array) -> Array:
        """Place of the drawing's tool point on last links at rest, (n, 3) mm in the base frame."""
        return np.asarray(frame[:, :3, :3] @ np.asarray(self.spec.tool_mm) + frame[:, :3, 3])

    def tip(self, frame: Array) -> Array:
        """Place of the reflector on last links at rest, (n, 3) mm in the base frame."""
        return self.tool(frame) + frame[:, :3, :3] @ self.reflector_mm

    def _driven(self, q: Array, gap: Array, run: Array | None) -> Array:
        """Joint values behind uneven rings, play, friction and what the controller adds."""
        faults, path = self.faults, arm_path(q, run)
        order = np.arange(1, faults.wobble.shape[1] + 1)
        phase = q[..., None] * order
        uneven = (np.cos(phase) * faults.wobble[..., 0] + np.sin(phase) * faults.wobble[..., 1]).sum(axis=-1)
        sent = path.slider + 0.5 * np.asarray(faults.added) * travel_direction(path.slider)
        follower = drive.play(sent, (faults.gap + gap)[path.row])[path.last]
        if faults.windup is not None:
            follower = follower + drive.windup(path.slider, *faults.windup.T)[path.last]
        return np.asarray(follower + uneven + faults.scale * q)

    def _yielded(self, joint: Array, payload: Array, growth: Array) -> Array:
        """Joint values under load, (n, k) rad."""
        at = joint
        for _ in range(SETTLE if self.faults.compliance.any() else 0):
            torque = [self._torque(at, index, payload, growth) for index in range(joint.shape[1])]
            at = joint + self.faults.compliance * np.stack(torque, axis=-1)
        return at

    def _torque(self, joint: Array, index: int, payload: Array | float, growth: Array | float) -> Array:
        """Torque of all weights about one joint, N mm: the fall of the potential energy."""
        step = NUDGE * np.eye(joint.shape[-1])[index]
        fall = self._energy(joint - step, payload, growth) - self._energy(joint + step, payload, growth)
        return np.asarray(fall / (2.0 * NUDGE))

    def torques(self, joint: Array, payload: Array | float) -> Array:
        """Torque of links and payload about each joint of a cold arm at (n, k) rad, (n, k) N mm."""
        return np.stack([self._torque(joint, index, payload, 1.0) for index in range(joint.shape[1])], axis=-1)

    def _energy(self, joint: Array, payload: Array | float, growth: Array | float) -> Array:
        """Potential energy of links and payload, N mm."""
        frames = self._frames(joint, growth)
        down = np.asarray(self.spec.gravity) / np.linalg.norm(self.spec.gravity)
        energy = -payload * GRAVITY * ((frames[-1] @ np.append(self.spec.tool_mm, 1.0))[..., :3] @ down)
        for frame, (mass, *centre) in zip(frames, self._masses(), strict=True):
            energy = energy - mass * GRAVITY * ((frame @ np.array([*centre, 1.0]))[..., :3] @ down)
        return np.asarray(energy)

    def _masses(self) -> Array:
        """Mass and centre of each link, (k, 4) kg and mm."""
        if self.faults.mass is not None:
            return self.faults.mass
        return np.array([[link.mass_kg or 0.0, *(link.com_mm or (0.0, 0.0, 0.0))] for link in self.spec.joint])

    def _frames(self, joint: Array, growth: Array | float, tilt: Array | None = None) -> list[Array]:
        """Frame that each link carries at (..., k) rad, (..., 4, 4) each."""
        shape = joint.shape[:-1]
        longer = np.broadcast_to(growth, (*shape, 2))
        beta = np.broadcast_to(self.faults.beta, joint.shape[-1:])
        frame, frames = np.broadcast_to(np.eye(4), (*shape, 4, 4)), []
        for index, (link, (da, dalpha, dd, dtheta)) in enumerate(zip(self.spec.joint, self.faults.link, strict=True)):
            turn = joint[..., index] + math.radians(link.theta_offset_deg) + dtheta
            along_z = screw(2, turn, (link.d_mm + dd) * longer[..., 1])
            if tilt is not None:
                along_z = turned(np.pad(tilt[:, index], ((0, 0), (0, 1)))) @ along_z
            along_x = screw(0, math.radians(link.alpha_deg) + dalpha, (link.a_mm + da) * longer[..., 0])
            along_x = along_x @ screw(1, beta[index], 0.0)
            frame = frame @ along_z @ along_x if self.spec.convention == "standard" else frame @ along_x @ along_z
            frames.append(frame)
        return frames


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
