"""Drawings of random arms of the usual families, each with the joint ranges of its run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.machine import MachineFile, SerialSpec
from ptt.machine_schema import BasePoint, TrackerSpec
from ptt.rig.arm_faults import joint_limits, tool_jacobian
from ptt.rig.draw_arm import draw_masses, joint_ranges
from ptt.rig.draw_machine import Frame
from ptt.rig.nominal import Array

Random = np.random.Generator
Links = list[tuple[float, float, float]]  # a, alpha (deg), d of each link, standard convention; lengths per reach
REACH_MM = (400.0, 3000.0)  # desk-top arms to those that lift cars
TEETH = (50, 80, 100, 101, 120, 160)  # of gears whose turn a drawing tells
HOMES = 12  # postures of which the one farthest from singular ones is the middle of a run
WIDE = (0.35, 1.2)  # rad to either side, what a joint of a run covers
TURNS = 2.4  # rad: joints of a run keep within this, and within nine tenths of their limits
ODD_TWIST = 0.15  # share of wrists whose axes meet at other angles than the family's


@dataclass(frozen=True)
class ForeignArm:
    """A random drawing of an arm.

    Attributes:
        file: the machine, its tracker frame and tool (`sigma_mm` is left to who draws the noise).
        family: of FAMILIES; 'given' where it was not drawn.
        low: (k,) rad, least joint values of a run.
        high: (k,) rad, greatest ones.
        reach_mm: about its reach, mm.
    """

    file: MachineFile
    family: str
    low: Array
    high: Array
    reach_mm: float


def draw_arm_file(seed: int, *, weighed: bool | None = None) -> ForeignArm:
    """Draw an arm: four to seven joints, standard or modified convention, standing, hanging, on a wall or tilted.

    Args:
        seed: of everything.
        weighed: whether the drawing tells masses; None lets the seed choose.

    Returns:
        The drawing, and where its joints go.
    """
    random = np.random.default_rng([seed, 81])
    family = str(random.choice(list(FAMILIES)))
    reach = float(np.exp(random.uniform(*np.log(REACH_MM))))
    spec = _spec(random, family, FAMILIES[family](random), reach)
    told = bool(random.random() < 0.5) if weighed is None else weighed
    if told:
        spec = _weigh(spec, random)
    low, high = _ranges(spec, random)
    return ForeignArm(
        MachineFile(spec, tracker=_tracker(random, reach), source=f"arm {seed}"), family, low, high, reach
    )


def given_arm(file: MachineFile) -> ForeignArm:
    """A drawing of an arm that is given, its joints in a run within four fifths of their limits.

    Args:
        file: of a serial arm.

    Returns:
        The drawing, and where its joints go.
    """
    spec = file.machine
    assert isinstance(spec, SerialSpec)
    low, high = joint_ranges(spec)
    return ForeignArm(file, "given", low, high, sum(abs(link.a_mm) + abs(link.d_mm) for link in spec.joint))


def inverse_condition(spec: SerialSpec, q: Array) -> Array:
    """Inverse condition number of dp/dq: how far postures are from singular ones for the tool's position.

    Args:
        spec: the drawing.
        q: (n, k) rad.

    Returns:
        (n,), least over greatest singular value, 0 at a singularity.
    """
    sizes = np.linalg.svd(tool_jacobian(spec, q), compute_uv=False)
    return np.asarray(sizes[:, -1] / np.maximum(sizes[:, 0], 1e-9))  # 0 where no joint moves the tool


def _scara(random: Random) -> Links:
    """SCARA-like: two parallel upright axes, then one of pitch and one of roll instead of the spindle."""
    return [
        (random.uniform(0.3, 0.5), 0.0, random.uniform(0.3, 0.6)),
        (random.uniform(0.25, 0.45), 90.0 * _sign(random), random.uniform(-0.1, 0.1)),
        (random.uniform(0.1, 0.25), 90.0 * _sign(random), 0.0),
        (0.0, 0.0, random.uniform(0.05, 0.15)),
    ]


def _bench(random: Random) -> Links:
    """Five joints: waist, shoulder, elbow and wrist parallel, then the roll of the hand."""
    return [
        (random.uniform(0.0, 0.1), 90.0, random.uniform(0.2, 0.4)),
        (random.uniform(0.3, 0.5), 0.0, 0.0),
        (random.uniform(0.25, 0.45), 0.0, random.uniform(-0.03, 0.03)),
        (random.uniform(0.0, 0.05), 90.0, 0.0),
        (0.0, 0.0, random.uniform(0.08, 0.2)),
    ]


def _puma(random: Random) -> Links:
    """Six joints, the last three through one point or nearly."""
    wrist = random.uniform(0.0, 0.06) * (random.random() < 0.3)
    return [
        (random.uniform(0.0, 0.2), -90.0, random.uniform(0.2, 0.5)),
        (random.uniform(0.3, 0.5), 0.0, random.uniform(-0.15, 0.15)),
        (random.uniform(-0.05, 0.12), 90.0, 0.0),
        (0.0, -90.0, random.uniform(0.3, 0.5)),
        (wrist, 90.0, 0.0),
        (0.0, 0.0, random.uniform(0.06, 0.15)),
    ]


def _three_parallel(random: Random) -> Links:
    """UR-like: shoulder, elbow and first wrist axis parallel, no axes of the wrist through one point."""
    return [
        (0.0, 90.0, random.uniform(0.1, 0.2)),
        (-random.uniform(0.35, 0.5), 0.0, 0.0),
        (-random.uniform(0.3, 0.45), 0.0, 0.0),
        (0.0, 90.0, random.uniform(0.08, 0.15)),
        (0.0, -90.0, random.uniform(0.06, 0.12)),
        (0.0, 0.0, random.uniform(0.05, 0.1)),
    ]


def _seven(random: Random) -> Links:
    """iiwa-like: shoulder and wrist of three axes each, an elbow that may swivel."""
    upper, fore = random.uniform(0.3, 0.45), random.uniform(0.3, 0.45)
    side = random.uniform(0.02, 0.1) * (random.random() < 0.3)
    twists, offsets = (-90.0, 90.0, 90.0, -90.0, -90.0, 90.0), (random.uniform(0.2, 0.4), 0.0, upper, 0.0, fore, 0.0)
    lengths = (0.0, 0.0, side, -side, 0.0, 0.0)
    return [*zip(lengths, twists, offsets, strict=True), (0.0, 0.0, random.uniform(0.1, 0.2))]


FAMILIES: dict[str, Callable[[Random], Links]] = {
    "scara": _scara,
    "bench": _bench,
    "puma": _puma,
    "ur": _three_parallel,
    "iiwa": _seven,
}


def _spec(random: Random, family: str, links: Links, reach: float) -> SerialSpec:
    """A drawing in half millimetres, its convention, limits, gravity and tool by chance."""
    joints = len(links)
    scale = reach / sum(abs(a) + abs(d) for a, _, d in links[1:])
    a, alpha, d = np.array(links).T * [[scale], [1.0], [scale]]
    if random.random() < ODD_TWIST:
        alpha[joints - 2] += float(np.round(random.uniform(10.0, 35.0) * _sign(random)))
    offset = 90.0 * random.integers(-1, 3, joints) * (random.random() < 0.5)
    modified = random.random() < 0.5
    if modified:  # the x screw of a link comes before its joint; the last one of all is a unit
        a, alpha = np.roll(a, 1), np.roll(alpha, 1)
    wide = np.round(random.uniform(100.0, 178.0, joints))
    limits = [None if random.random() < 0.1 else (-float(w), float(w)) for w in wide]
    rows = zip(_half(a), alpha, _half(d), offset, limits, strict=True)
    keys = ("a_mm", "alpha_deg", "d_mm", "theta_offset_deg", "limits_deg")
    tool = np.array([random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), random.uniform(0.05, 0.2)]) * reach
    values: dict[str, Any] = {
        "kind": "serial",
        "name": family,
        "convention": "modified" if modified else "standard",
        "tool_mm": np.round(tool, 1).tolist(),
        "joint": [dict(zip(keys, row, strict=True)) for row in rows],
        "reference_temp_c": float(random.choice([18.0, 20.0, 22.0])),
        "gear_period_rad": 2.0 * np.pi / int(random.choice(TEETH)) if random.random() < 0.5 else None,
        "gravity": _gravity(random),
    }
    return SerialSpec.model_validate(values)


def _gravity(random: Random) -> list[float]:
    """Standing, hanging, on a wall, tilted."""
    side = random.normal(size=3)
    ways = {"stands": [0.0, 0.0, -1.0], "hangs": [0.0, 0.0, 1.0], "wall": [_sign(random), 0.0, 0.0]}
    way = str(random.choice(["stands", "stands", "stands", "hangs", "wall", "tilted"]))
    return ways.get(way) or np.round(side / np.linalg.norm(side), 4).tolist()


def _weigh(spec: SerialSpec, random: Random) -> SerialSpec:
    masses = draw_masses(spec, random)
    links = [
        link.model_copy(update={"mass_kg": round(float(mass), 2), "com_mm": tuple(np.round(centre, 1).tolist())})
        for link, (mass, *centre) in zip(spec.joint, masses, strict=True)
    ]
    return spec.model_copy(update={"joint": tuple(links)})


def _ranges(spec: SerialSpec, random: Random) -> tuple[Array, Array]:
    """Joint values of a run about a posture that is far from singular ones, (k,) rad each."""
    low, high = np.clip(0.9 * joint_limits(spec), -TURNS, TURNS)
    homes = random.uniform(0.8 * low, 0.8 * high, (HOMES, spec.joints))
    home = homes[np.argmax(inverse_condition(spec, homes))]
    half = random.uniform(*WIDE, spec.joints)
    return np.maximum(home - half, low), np.minimum(home + half, high)


def _tracker(random: Random, reach: float) -> TrackerSpec:
    """What is known of the tracker's frame and of the reflector's mount."""
    frames: tuple[Frame, ...] = ("fitted", "fitted", "fitted", "trusted", "fitted-per-run", "measured")
    frame = frames[random.integers(len(frames))]
    tool = str(random.choice(["fitted", "fitted", "trusted"]))
    if frame == "fitted-per-run" and tool == "fitted" and random.random() < 0.5:
        tool = "fitted-per-run"
    if frame != "measured":
        return TrackerSpec.model_validate({"frame": frame, "tool": tool})
    angle = np.radians([20.0, 140.0, 255.0, 330.0]) + random.uniform(-0.3, 0.3, 4)
    place = np.column_stack([np.cos(angle), np.sin(angle), random.uniform(-0.2, 0.3, 4)]) * 0.6 * reach
    base = tuple(
        BasePoint(name=f"base {number}", xyz_mm=tuple(at)) for number, at in enumerate(np.round(place, 2).tolist(), 1)
    )
    return TrackerSpec.model_validate({"frame": frame, "tool": tool, "base_point": base})


def _half(values: Array) -> list[float]:
    return (np.round(2.0 * np.asarray(values)) / 2.0).tolist()


def _sign(random: Random) -> float:
    return float(random.choice([-1.0, 1.0]))
