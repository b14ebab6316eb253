"""The arm and the run that faults are drawn for: how far each joint moves the tool, what it bears, the noise."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.arm_faults import tool_on_drawing
from ptt.rig.arm_state import tool_slopes
from ptt.rig.draw import DrawnRig
from ptt.rig.draw_faults import Random, log_uniform
from ptt.rig.draw_noise import stated_sigma
from ptt.rig.nominal import Array
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.rig.units import GRAVITY, MM_PER_UM

WANTED = (3.0, 20.0)  # times the noise of one reading: what a fault is drawn to do to the tool
WEAK = 0.1  # of the strongest joint's lever: a fault of a joint with less hardly moves the tool
STILL = 0.02  # rad: a joint that goes less far in a run stands still


@dataclass(frozen=True)
class ArmScene:
    """An arm, its run and its noise.

    Attributes:
        spec: the drawing.
        q: (n, k) rad, commands of the run.
        lever: (k,) mm/rad, root mean square over the run of how far each joint moves the tool.
        reach: mm, root mean square distance of the tool from the base's origin.
        noise: mm, of one reading, its three coordinates together.
        payload: (n,) kg.
        seconds: how long the run takes, about.
        warms: K, how far the room is warmer than at the start halfway through the run, negative where it cools.
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
    warms: float
    tool_range: tuple[Array, Array]
    protocol: str

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.spec.joints

    @property
    def warmer(self) -> float:
        """Usual change of temperature in the run, K."""
        return abs(self.warms)

    @property
    def span(self) -> tuple[Array, Array]:
        """Least and greatest value of each joint, (k,) rad each."""
        return self.q.min(axis=0), self.q.max(axis=0)

    @property
    def step(self) -> Array:
        """Usual way of each joint between rows, (k,) rad."""
        ways = np.abs(np.diff(self.q, axis=0))
        usual = [float(np.median(way[way > 1e-9])) if (way > 1e-9).any() else 1.0 for way in ways.T]
        return np.array(usual)

    @property
    def strong(self) -> Array:
        """Numbers from 0 of the joints that move, and move the tool."""
        low, high = self.span
        good = (self.lever > WEAK * self.lever.max()) & (high - low > STILL)
        return np.flatnonzero(good)

    @property
    def loaded(self) -> Array:
        """Numbers from 0 of those among them that a weight at the tool turns; all of them where none is."""
        levers = np.array([self.weight_lever(joint) for joint in self.strong])
        return self.strong[levers > WEAK * levers.max(initial=0.0)] if (levers > 1.0).any() else self.strong

    def wanted(self, random: Random) -> float:
        """How far a fault is to move the tool, mm."""
        return self.noise * log_uniform(random, *WANTED)

    def some_joint(self, random: Random) -> int:
        """Number from 0 of a joint that can be seen."""
        return int(random.choice(self.strong))

    def angle(self, random: Random, joint: int) -> float:
        """An error of a joint, rad, that moves the tool as far as wanted."""
        return self.wanted(random) / float(self.lever[joint])

    def angles(self, random: Random, *, signed: bool = True) -> list[float]:
        """Errors of one joint or of all that can be seen, (k,) rad, each as large as wanted."""
        picked = {self.some_joint(random)} if random.random() < 0.5 else set(self.strong.tolist())
        sizes = [self.angle(random, joint) if joint in picked else 0.0 for joint in range(self.joints)]
        return [size * float(random.choice([-1.0, 1.0])) if signed else size for size in sizes]

    def torques(self, mass: Array | None = None) -> Array:
        """Root mean square torque of payload and links about each joint, (k,) N mm.

        Args:
            mass: (k, 4) what the links weigh, kg, and their centres, mm; None for the drawing's.
        """
        faults = replace(ArmFaults.none(self.joints), mass=mass)
        rig = ArmRig(self.spec, faults, np.zeros(3), np.eye(4), 0.0)
        return np.sqrt(np.square(rig.torques(self.q, self.payload)).mean(axis=0))

    def weight_lever(self, joint: int) -> float:
        """Root mean square torque about a joint by each kg at the tool, N mm."""
        down = np.asarray(self.spec.gravity) / np.linalg.norm(self.spec.gravity)
        slopes = tool_slopes(self.spec, self.q)[..., joint]
        return float(np.sqrt(np.square(GRAVITY * slopes @ down).mean()))


def scene_of_arm(drawn: DrawnRig) -> ArmScene:
    """The scene of a drawn arm.

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
        lever=np.sqrt(np.square(tool_slopes(spec, q)).sum(axis=1).mean(axis=0)),
        reach=float(np.sqrt(np.square(tool).sum(axis=1).mean())),
        noise=float(noise),
        payload=load,
        seconds=seconds,
        warms=room.rise_k * float(1.0 - np.exp(-0.5 * seconds / room.time_constant_s)),
        tool_range=(tool.min(axis=0), tool.max(axis=0)),
        protocol=drawn.protocol,
    )
