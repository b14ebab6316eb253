"""A virtual serial arm with faults: Denavit-Hartenberg chain, loads by virtual work, play along the travel."""

import math
from dataclasses import dataclass

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig import drive
from ptt.rig.motion import joint_path, travel_direction
from ptt.rig.nominal import Array
from ptt.rig.screws import screw, shifted, turned
from ptt.rig.units import GRAVITY

NUDGE = 1e-5  # rad, step of the numerical derivative of the potential energy
SETTLE = 4  # iterations of torque and deflection: joints yield by milliradians, each round by a thousandth of the last


@dataclass(frozen=True)
class ArmFaults:
    """Faults of an arm of k joints.

    Attributes:
        link: (k, 4) errors of the Denavit-Hartenberg parameters a (mm), alpha (rad), d (mm) and theta (rad).
        gap: (k,) rad, play of each joint.
        compliance: (k,) rad per N mm, of each joint.
        growth: 1/K, thermal expansion of every length a, and of every offset d unless `offset_growth` is given.
        wobble: (k, m, 2) rad, cosine and sine coefficient of the harmonics 1 to m of each joint.
        mass: (k, 4) true mass of each link, kg, and its centre of mass in the frame that it carries, mm; None for the
            drawing's.
        beta: (k,) rad, rotation about the y axis after each twist (Hayati): how far parallel axes are from parallel.
        scale: (k,) relative error of each joint's rotation.
        added: (k,) rad, backlash that the controller compensates: half of it is added in the direction of travel.
        windup: (k, 2) rad, size and length of each joint's wind-up; None without any.
        offset_growth: 1/K, thermal expansion of every offset d; None for that of the lengths.
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
    """Shifts of an arm of k joints that change from row to row.

    Attributes:
        joint: (n, k) rad, added to the joints behind their play.
        gap: (n, k) rad, added to the play.
        tilt: (n, k, 2) rad, rotation of each joint's axis about the x and the y axis of its frame.
        hand: (n, 3) mm, shift of the tool in its holder, in the frame of the last link.
        base: (n, 3) rad, rotation vector of the base about its origin.
        sight: (n, 3) mm, shift of the readings alone, base frame.
    """

    joint: Array
    gap: Array
    tilt: Array
    hand: Array
    base: Array
    sight: Array

    @classmethod
    def none(cls, rows: int, joints: int) -> "ArmShifts":
        """Shifts of zero."""
        flat, three = (rows, joints), (rows, 3)
        shapes = (flat, flat, (*flat, 2), three, three, three)
        return cls(*(np.zeros(shape) for shape in shapes))


@dataclass(frozen=True)
class ArmRig:
    """A virtual arm under a tracker.

    Attributes:
        spec: the drawing.
        faults: deviations from it.
        reflector_mm: (3,) mm, reflector from the drawing's tool point, in the frame of the last link.
        tracker: (4, 4), base frame to tracker frame; for `measure`.
        sigma_mm: standard deviation of one coordinate; for `measure`.
    """

    spec: SerialSpec
    faults: ArmFaults
    reflector_mm: Array
    tracker: Array
    sigma_mm: float

    def measure(self, q: Array, payload: Array, temperature: Array, seed: int) -> Array:
        """Readings of the tracker at each of the joint commands.

        Args:
            q: (n, k) rad, in travel order.
            payload: (n,) kg at the tool point.
            temperature: (n,) deg C.
            seed: of the noise.

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
        """Joints and last link at rest after each command.

        Args:
            q: (n, k) rad, in travel order.
            payload: (n,) kg at the tool point.
            temperature: (n,) deg C.
            shifts: of the rows; None for none.
            run: (n,) int, number of each row's run; None for a single one.

        Returns:
            True joint values (n, k) rad, and the frame that the last link carries, (n, 4, 4), in the base frame.
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
        """Position of the drawing's tool point on the last link's frames (n, 4, 4), (n, 3) mm, base frame."""
        return np.asarray(frame[:, :3, :3] @ np.asarray(self.spec.tool_mm) + frame[:, :3, 3])

    def tip(self, frame: Array) -> Array:
        """Position of the reflector on the last link's frames (n, 4, 4), (n, 3) mm, base frame."""
        return self.tool(frame) + frame[:, :3, :3] @ self.reflector_mm

    def _driven(self, q: Array, gap: Array, run: Array | None) -> Array:
        """Joint values without load, (n, k) rad: compensation, play, wind-up, harmonics and scale."""
        faults, path = self.faults, joint_path(q, run)
        harmonic = np.arange(1, faults.wobble.shape[1] + 1)
        phase = q[..., None] * harmonic
        uneven = (np.cos(phase) * faults.wobble[..., 0] + np.sin(phase) * faults.wobble[..., 1]).sum(axis=-1)
        sent = path.slider + 0.5 * np.asarray(faults.added) * travel_direction(path.slider)
        follower = drive.play(sent, (faults.gap + gap)[path.row])[path.last]
        if faults.windup is not None:
            follower = follower + drive.windup(path.slider, *faults.windup.T)[path.last]
        return np.asarray(follower + uneven + faults.scale * q)

    def _yielded(self, joint: Array, payload: Array, growth: Array) -> Array:
        """Joint values under load, (n, k) rad: each yields by compliance times torque, in the posture of the load."""
        at = joint
        for _ in range(SETTLE if self.faults.compliance.any() else 0):
            torque = [self._torque(at, index, payload, growth) for index in range(joint.shape[1])]
            at = joint + self.faults.compliance * np.stack(torque, axis=-1)
        return at

    def _torque(self, joint: Array, index: int, payload: Array | float, growth: Array | float) -> Array:
        """Torque of all weights about one joint, (...) N mm: minus the derivative of the potential energy by it."""
        step = NUDGE * np.eye(joint.shape[-1])[index]
        fall = self._energy(joint - step, payload, growth) - self._energy(joint + step, payload, growth)
        return np.asarray(fall / (2.0 * NUDGE))

    def torques(self, joint: Array, payload: Array | float) -> Array:
        """Torques of links and payload about each joint at (n, k) rad and reference temperature, (n, k) N mm."""
        return np.stack([self._torque(joint, index, payload, 1.0) for index in range(joint.shape[1])], axis=-1)

    def _energy(self, joint: Array, payload: Array | float, growth: Array | float) -> Array:
        """Potential energy of links and payload (at the tool point), (...) N mm."""
        frames = self._frames(joint, growth)
        down = np.asarray(self.spec.gravity) / np.linalg.norm(self.spec.gravity)
        energy = -payload * GRAVITY * ((frames[-1] @ np.append(self.spec.tool_mm, 1.0))[..., :3] @ down)
        for frame, (mass, *centre) in zip(frames, self._masses(), strict=True):
            energy = energy - mass * GRAVITY * ((frame @ np.array([*centre, 1.0]))[..., :3] @ down)
        return np.asarray(energy)

    def _masses(self) -> Array:
        """Mass of each link, kg, and its centre of mass in the frame that it carries, mm, (k, 4)."""
        if self.faults.mass is not None:
            return self.faults.mass
        return np.array([[link.mass_kg or 0.0, *(link.com_mm or (0.0, 0.0, 0.0))] for link in self.spec.joint])

    def _frames(self, joint: Array, growth: Array | float, tilt: Array | None = None) -> list[Array]:
        """Frames that the links carry at (..., k) rad, in the base frame, (..., 4, 4) each.

        Source: Denavit and Hartenberg, standard or modified (Craig); `growth` (..., 2) are factors on a and d.
        """
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
    """Homogeneous transformation of coordinates into a frame that is turned against the old one.

    Args:
        turn: (3,) rad, rotation vector of the new frame against the old; coordinates turn by its opposite.
        shift: (3,) mm, origin of the old frame in the new.

    Returns:
        (4, 4).
    """
    matrix: Array = turned(-np.asarray(turn)[None])[0]
    matrix[:3, 3] = shift
    return matrix
