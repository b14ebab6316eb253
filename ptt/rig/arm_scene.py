"""The arm and the run that faults are drawn for: levers and loads of the joints, and the noise."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.arm_faults import tool_jacobian, tool_on_drawing
from ptt.rig.draw import DrawnRig
from ptt.rig.draw_faults import Random, log_uniform
from ptt.rig.draw_noise import stated_sigma
from ptt.rig.nominal import Array
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.rig.units import GRAVITY, MM_PER_UM

SHIFTS = (3.0, 20.0)  # shifts of the tool, times the noise of one reading, that faults are drawn for
WEAK = 0.1  # share of the greatest lever below which a fault of a joint hardly moves the tool
STILL = 0.02  # rad: a joint of a smaller range stands still in a run


@dataclass(frozen=True)
class ArmScene:
    """An arm, its run and its noise.

    Attributes:
        spec: the drawing.
        q: (n, k) rad, commands of the run.
        lever: (k,) mm/rad, root mean square over the run of the tool's derivative by each joint.
        reach: mm, root mean square distance of the tool from the base's origin.
        noise: mm, of one reading, its three coordinates together.
        payload: (n,) kg.
        seconds: duration of the run, s, about.
        warming_k: K, rise of the room's temperature until halfway through the run, negative where it cools.
        tool_range: least and greatest coordinates of the tool in the run, (3,) mm each, base frame.
        protocol: how the run is measured.
    """

    spec: SerialSpec
    q: Array
    lever: Array
    reach: float
    noise: float
    payload: Array
    seconds: float
    warming_k: float
    tool_range: tuple[Array, Array]
    protocol: str

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.spec.joints

    @property
    def warming_size_k(self) -> float:
        """Size of the change of temperature, K."""
        return abs(self.warming_k)

    @property
    def span(self) -> tuple[Array, Array]:
        """Least and greatest value of each joint, (k,) rad each."""
        return self.q.min(axis=0), self.q.max(axis=0)

    @property
    def step(self) -> Array:
        """Median travel of each joint between rows in which it moves, (k,) rad; 1 where it never does."""
        steps = np.abs(np.diff(self.q, axis=0))
        usual = [float(np.median(step[step > 1e-9])) if (step > 1e-9).any() else 1.0 for step in steps.T]
        return np.array(usual)

    @property
    def visible_joints(self) -> Array:
        """Numbers from 0 of the joints that move in the run, and move the tool; all where none does."""
        low, high = self.span
        good = (self.lever > WEAK * self.lever.max()) & (high - low > STILL)
        return np.flatnonzero(good) if good.any() else np.arange(self.joints)

    @property
    def loaded_joints(self) -> Array:
        """Numbers from 0 of those that a weight at the tool loads; all visible joints where it loads none."""
        levers = np.array([self.weight_lever(joint) for joint in self.visible_joints])
        return (
            self.visible_joints[levers > WEAK * levers.max(initial=0.0)]
            if (levers > 1.0).any()
            else self.visible_joints
        )

    def draw_shift(self, random: Random) -> float:
        """Shift of the tool that a fault is to make, mm, log-uniform."""
        return self.noise * log_uniform(random, *SHIFTS)

    def draw_joint(self, random: Random) -> int:
        """Number from 0 of a random visible joint."""
        return int(random.choice(self.visible_joints))

    def draw_angle(self, random: Random, joint: int) -> float:
        """Error of a joint, rad, that shifts the tool by a drawn amount."""
        return self.draw_shift(random) / max(float(self.lever[joint]), 1.0)  # no millimetre for a radian moves nothing

    def draw_angles(self, random: Random, *, signed: bool = True) -> list[float]:
        """Errors of one visible joint or of all, (k,) rad, each of which shifts the tool by a drawn amount."""
        picked = {self.draw_joint(random)} if random.random() < 0.5 else set(self.visible_joints.tolist())
        sizes = [self.draw_angle(random, joint) if joint in picked else 0.0 for joint in range(self.joints)]
        return [size * float(random.choice([-1.0, 1.0])) if signed else size for size in sizes]

    def torques(self, mass: Array | None = None) -> Array:
        """Root mean square torque of payload and links about each joint, (k,) N mm.

        Args:
            mass: (k, 4) masses of the links, kg, and centres of mass in their frames, mm; None for the drawing's.
        """
        faults = replace(ArmFaults.none(self.joints), mass=mass)
        rig = ArmRig(self.spec, faults, np.zeros(3), np.eye(4), 0.0)
        return np.sqrt(np.square(rig.torques(self.q, self.payload)).mean(axis=0))

    def weight_lever(self, joint: int) -> float:
        """Root mean square torque of gravity about a joint for each kg at the tool, N mm/kg."""
        down = np.asarray(self.spec.gravity) / np.linalg.norm(self.spec.gravity)
        slopes = tool_jacobian(self.spec, self.q)[..., joint]
        return float(np.sqrt(np.square(GRAVITY * slopes @ down).mean()))


def scene_of_arm(drawn: DrawnRig) -> ArmScene:
    """The scene of a drawn arm and its run.

    Args:
        drawn: the rig and its targets.

    Returns:
        The scene.
    """
    rig = drawn.rig
    spec = rig.serial
    assert spec is not None
    q = drawn.targets[rig.commanded].to_numpy(float)
    tool = tool_on_drawing(spec, q)
    values = rig.tracker.model_dump(exclude_none=True)
    away = float(np.linalg.norm(rig.tracker.station_mm))
    noise = np.hypot(stated_sigma(values, away), MM_PER_UM * rig.tracker.wander_um) * 3.0**0.5
    seconds = len(q) * rig.conditions.cycles * max(rig.conditions.dwell_s, 1.0)
    load = drawn.targets["payload_kg"].to_numpy(float) if "payload_kg" in drawn.targets else np.zeros(len(q))
    per_cycle = rig.conditions.payload_per_cycle_kg
    load = np.resize(per_cycle, len(q)) if per_cycle else load
    room = rig.conditions.room
    return ArmScene(
        spec=spec,
        q=q,
        lever=np.sqrt(np.square(tool_jacobian(spec, q)).sum(axis=1).mean(axis=0)),
        reach=float(np.sqrt(np.square(tool).sum(axis=1).mean())),
        noise=float(noise),
        payload=load,
        seconds=seconds,
        warming_k=room.rise_k * float(1.0 - np.exp(-0.5 * seconds / room.time_constant_s)),
        tool_range=(tool.min(axis=0), tool.max(axis=0)),
        protocol=drawn.protocol,
    )
