"""Virtual arms with one hidden fault, and runs on them: kinds of faults, their usual sizes, how they are measured."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.arm_faults import joint_limits
from ptt.rig.nominal import Array
from ptt.rig.serial_arm import ArmFaults, ArmRig, rigid

ArmFault = Literal["compliance", "backlash", "link", "growth", "weight", "none"]
ARM_FAULTS: tuple[ArmFault, ...] = get_args(ArmFault)
WIDE_RAD = 2.0  # joints keep within this, and within four fifths of their limits
SECONDS_A_ROW = 30.0
STEEL, ALUMINIUM = 1.0e-5, 2.4e-5  # 1/K


@dataclass(frozen=True)
class ArmRun:
    """One drawn arm and the run it is measured on.

    Attributes:
        rig: the arm.
        fault: what is hidden in it; 'weight' hides the masses too: `rig.spec` is a drawing that states none.
        q: (n, k) rad, commands in travel order.
        payload_kg: (n,) kg.
        temp_c: (n,) deg C.
        time_s: (n,) s.
        seed: of the noise.
    """

    rig: ArmRig
    fault: ArmFault
    q: Array
    payload_kg: Array
    temp_c: Array
    time_s: Array
    seed: int

    @property
    def readings(self) -> Array:
        """Readings of the tracker, (n, 3) mm, tracker frame."""
        return self.rig.measure(self.q, self.payload_kg, self.temp_c, self.seed)


def draw_arm(spec: SerialSpec, fault: ArmFault, seed: int, rows: int = 220, sigma_mm: float = 0.01) -> ArmRun:
    """Draw an arm with a hidden fault and a run that can show all of them: two loads, a warm-up, all directions.

    For tests and benchmarks; `ptt.rig.draw_foreign_arm` draws the machines of challenges.

    Args:
        spec: the drawing.
        fault: which kind.
        seed: of everything.
        rows: poses of the run.
        sigma_mm: standard deviation of one coordinate.

    Returns:
        The run.
    """
    random = np.random.default_rng([seed, ARM_FAULTS.index(fault), len(spec.joint)])
    faults = draw_faults(fault, len(spec.joint), random)
    if fault == "weight":
        spec, faults = unweighed(spec), replace(faults, mass=draw_masses(spec, random))
    q = random.uniform(*joint_ranges(spec), (rows, len(spec.joint)))
    place = np.arange(rows)
    frame = rigid(random.uniform(-0.5, 0.5, 3), random.uniform(-800.0, 800.0, 3))
    rig = ArmRig(spec, faults, random.uniform(-30.0, 30.0, 3), frame, sigma_mm)
    warm = spec.reference_temp_c + random.uniform(4.0, 9.0) * (1.0 - np.exp(-place / random.uniform(0.15, 0.5) / rows))
    carried = 0.0 if fault == "weight" else random.uniform(3.0, 8.0)  # a payload would load the same springs
    load = np.where(place // max(rows // 4, 1) % 2 == 0, 0.0, carried)
    return ArmRun(rig, fault, q, load, warm, SECONDS_A_ROW * place, int(random.integers(1 << 30)))


def draw_faults(fault: ArmFault, joints: int, random: np.random.Generator) -> ArmFaults:
    """Draw a fault of one kind.

    Strain-wave gears yield by 2 to 15 nrad per N mm, under a payload or the links themselves; play is 0.2 to 1 mrad in
    one or two joints; length, twist and offset of one link are off by 0.2 to 1 mm or 0.3 to 1.5 mrad; lengths grow by
    the expansion of steel to that of aluminium.

    Args:
        fault: which kind.
        joints: k.
        random: source of numbers.

    Returns:
        The faults of the arm.
    """
    faults = ArmFaults.none(joints)
    if fault in ("compliance", "weight"):
        return replace(faults, compliance=_log(random, 2e-9, 1.5e-8, joints))
    if fault == "backlash":
        # The last joint hardly moves a reflector near its axis; a single joint has no other.
        loose = random.permutation(max(joints - 1, 1))[: random.integers(1, 3)]
        return replace(faults, gap=np.where(np.isin(np.arange(joints), loose), _log(random, 2e-4, 1e-3, joints), 0.0))
    if fault == "link":
        link = np.zeros((joints, 4))
        size = _log(random, 1.0, 5.0, 3) * np.array([0.2, 3e-4, 0.2]) * random.choice([-1.0, 1.0], 3)
        some = random.random(3) < 0.6
        some[random.integers(0, 2)] = True  # an offset alone may be a tracker's shift
        # The first link may be the tracker's frame and the last ones the reflector's mount, where there are others.
        link[min(int(random.integers(1, max(joints - 2, 2))), joints - 1), :3] = np.where(some, size, 0.0)
        return replace(faults, link=link)
    return replace(faults, growth=float(random.uniform(STEEL, ALUMINIUM))) if fault == "growth" else faults


def draw_masses(spec: SerialSpec, random: np.random.Generator) -> Array:
    """Draw masses of the links of an arm: 8 to 30 kg for each metre between its joints, and a drive of 0.5 to 4 kg.

    Centres of mass lie between the joints, 20 mm (rms) off the line between them.

    Args:
        spec: the drawing.
        random: source of numbers.

    Returns:
        (k, 4) kg and mm, centres of mass in the frame that each link carries.
    """
    masses = np.empty((len(spec.joint), 4))
    for index, link in enumerate(spec.joint):
        span = np.array([link.a_mm, 0.0, link.d_mm])
        masses[index, 0] = random.uniform(8.0, 30.0) * np.linalg.norm(span) * 1e-3 + random.uniform(0.5, 4.0)
        # A link's frame is at its far end in the standard convention: the link lies behind it.
        masses[index, 1:] = -random.uniform(0.2, 0.8) * span + random.normal(0.0, 20.0, 3)
    return masses


def unweighed(spec: SerialSpec) -> SerialSpec:
    """The drawing without masses."""
    links = tuple(link.model_copy(update={"mass_kg": None, "com_mm": None}) for link in spec.joint)
    return spec.model_copy(update={"joint": links})


def joint_ranges(spec: SerialSpec) -> tuple[Array, Array]:
    """Least and greatest value of each joint in a drawn run, (k,) rad each: within four fifths of limits and WIDE_RAD.

    Where that leaves nothing, as between limits of 4 and 6 rad, the range is that of the limits.
    """
    limits = joint_limits(spec)
    low, high = np.clip(np.clip(0.8 * limits, -0.8 * WIDE_RAD, 0.8 * WIDE_RAD), *limits)
    return np.where(low < high, low, limits[0]), np.where(low < high, high, limits[1])


def _log(random: np.random.Generator, low: float, high: float, count: int) -> Array:
    return np.exp(random.uniform(np.log(low), np.log(high), count))
