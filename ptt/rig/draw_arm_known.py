"""Faults of an arm that effects of the library describe, sized by the shift of the tool relative to the noise."""

from typing import Any

import numpy as np

from ptt.rig.arm_scene import ArmScene
from ptt.rig.draw_arm import draw_masses
from ptt.rig.draw_faults import STATIC, Fault, Random, log_uniform, wrong_scale
from ptt.rig.units import MM_PER_UM, PPM, RAD_PER_MRAD, RAD_PER_NRAD, RAD_PER_URAD

PARALLEL_DEG = 1.0  # axes are parallel where the twist is nearer than this to 0 or 180 degrees
GROWTHS = (1.0, 30.0)  # um/m/K: carbon fibre to magnesium
RING = 8  # harmonics of an uneven ring


def _lists(values: list[float], unit: float) -> list[float]:
    return [float(f"{value / unit:.6g}") for value in values]


def _links(random: Random, scene: ArmScene) -> dict[str, Any]:
    """Lengths, twists and offsets of one link or two; where axes are parallel also how far they are not."""
    values: dict[str, list[float]] = {f"link_{key}": [0.0] * scene.joints for key in ("a_mm", "alpha_mrad", "d_mm")}
    lean = [0.0] * scene.joints
    for joint in random.permutation(max(scene.joints - 1, 1))[: int(random.integers(1, 3))].tolist():
        chosen = random.random(4) < 0.6
        chosen[int(random.integers(0, 2))] = True  # an offset alone may be a tracker's shift
        arm = 0.5 * scene.reach  # what turns behind a link, about
        for key, some, unit in zip(
            ("a_mm", "alpha_mrad", "d_mm"), chosen, (1.0, arm * RAD_PER_MRAD, 1.0), strict=False
        ):
            if some:
                values[f"link_{key}"][joint] = scene.draw_shift(random) / unit * float(random.choice([-1.0, 1.0]))
        # A modified drawing's lean belongs to the joint behind the twist, whose own it is there as well.
        if chosen[3] and abs(scene.spec.joint[joint].alpha_deg) % 180.0 < PARALLEL_DEG:
            lean[joint] = scene.draw_shift(random) / (arm * RAD_PER_MRAD) * float(random.choice([-1.0, 1.0]))
    return values | ({"link_beta_mrad": lean} if any(lean) else {})


def _turns(random: Random, scene: ArmScene) -> dict[str, Any]:
    """Once a turn of the gear that the drawing tells, else of the joint."""
    phase = np.round(random.uniform(0.0, 2.0 * np.pi, scene.joints), 6)
    return {
        "turn_urad": _lists(scene.draw_angles(random, signed=False), RAD_PER_URAD),
        "turn_phase_rad": phase.tolist(),
        "turn_harmonic": round(2.0 * np.pi / scene.spec.turn),
    }


def _ring(random: Random, scene: ArmScene) -> dict[str, Any]:
    """An uneven ring: eight harmonics, the more the smaller."""
    sizes = np.outer(scene.draw_angles(random, signed=False), np.ones(RING)) * random.exponential(
        size=(scene.joints, RING)
    )
    sizes = sizes / np.arange(1, RING + 1) / RAD_PER_URAD
    phases = random.uniform(0.0, 2.0 * np.pi, (scene.joints, RING))
    return {"ring_urad": np.round(sizes, 4).tolist(), "ring_phase_rad": np.round(phases, 6).tolist()}


def _play(random: Random, scene: ArmScene) -> dict[str, Any]:
    return {"backlash_mrad": _lists([2.0 * size for size in scene.draw_angles(random, signed=False)], RAD_PER_MRAD)}


def _over_compensation(random: Random, scene: ArmScene) -> dict[str, Any]:
    """A controller that compensates backlash which is not there: a negative gap to the library."""
    return {"added_mrad": _lists([2.0 * size for size in scene.draw_angles(random, signed=False)], RAD_PER_MRAD)}


def _windup(random: Random, scene: ArmScene) -> dict[str, Any]:
    """Wind-up over about the usual travel between rows, so that some rows see it halfway; often of one length."""
    usual = float(np.median(scene.step[scene.visible_joints])) * log_uniform(random, 0.4, 3.0)
    own = np.exp(random.uniform(np.log(0.5), np.log(2.0), scene.joints))  # lengths as far apart as those of sliders
    lengths = usual * (np.ones(scene.joints) if random.random() < 0.5 else own)
    sizes = _lists(scene.draw_angles(random, signed=False), RAD_PER_URAD)
    return {"windup_urad": sizes, "windup_length_mrad": _lists(lengths.tolist(), RAD_PER_MRAD)}


def _slip(random: Random, scene: ArmScene) -> dict[str, Any]:
    """The zero of one joint shifts between a fifth and four fifths of the run."""
    joint = scene.draw_joint(random)
    slip = [0.0] * scene.joints
    slip[joint] = scene.draw_angle(random, joint) * float(random.choice([-1.0, 1.0]))
    return {"slip_mrad": _lists(slip, RAD_PER_MRAD), "slip_share": float(random.uniform(0.2, 0.8))}


def _scale(random: Random, scene: ArmScene) -> dict[str, Any]:
    low, high = scene.span
    far = np.maximum(np.abs(low), np.abs(high))
    sizes = [size / max(float(way), 0.1) for size, way in zip(scene.draw_angles(random), far, strict=True)]
    return {"scale_urad_per_rad": _lists(sizes, RAD_PER_URAD)}


def _soft(random: Random, scene: ArmScene) -> dict[str, Any]:
    """Joints that yield under the payload, and under links that the drawing weighs.

    Where it weighs none the controller has taken the sag under the links out already: they count for nothing.
    """
    return {"compliance_nrad_per_nmm": _yields(random, scene, scene.torques())}


def _weight(random: Random, scene: ArmScene) -> dict[str, Any]:
    """Joints that yield under links that weigh what no drawing says."""
    if any(link.mass_kg is not None for link in scene.spec.joint):
        return _soft(random, scene)
    masses = np.round(draw_masses(scene.spec, random), 3)
    return {
        "compliance_nrad_per_nmm": _yields(random, scene, scene.torques(masses)),
        "mass_kg": masses[:, 0].tolist(),
        "com_mm": masses[:, 1:].tolist(),
    }


def _yields(random: Random, scene: ArmScene, torque: np.ndarray) -> list[float]:
    """(k,) nrad per N mm: a joint that bears little is as soft as the others."""
    usual = np.maximum(torque, 0.1 * torque.max(initial=1.0))
    sizes = [scene.draw_angle(random, joint) if joint in scene.visible_joints else 0.0 for joint in range(scene.joints)]
    return _lists([size / float(load) for size, load in zip(sizes, usual, strict=True)], RAD_PER_NRAD)


def _growth(random: Random, scene: ArmScene) -> dict[str, Any]:
    """All lengths alike, or the offsets of another material."""
    size = np.clip(scene.draw_shift(random) / (max(scene.warming_size_k, 0.1) * scene.reach) / PPM, *GROWTHS)
    other = float(size * random.uniform(0.3, 2.0))
    return {"growth_um_per_m_k": float(size)} | ({"offset_growth_um_per_m_k": other} if random.random() < 0.4 else {})


def _drift(random: Random, scene: ArmScene) -> dict[str, Any]:
    way = random.normal(size=3)
    speed = 2.0 * scene.draw_shift(random) / (scene.seconds / 3600.0) / MM_PER_UM
    return {"drift_um_per_h": (speed * way / np.linalg.norm(way)).tolist()}


def _knock(random: Random, scene: ArmScene) -> dict[str, Any]:
    way, turn = random.normal(size=(2, 3))
    shift, angle = 1.5 * scene.draw_shift(random) / MM_PER_UM, scene.draw_shift(random) / scene.reach / RAD_PER_MRAD
    return {
        "knock_um": (shift * way / np.linalg.norm(way)).tolist(),
        "knock_mrad": (angle * turn / np.linalg.norm(turn)).tolist(),
        "knock_share": float(random.uniform(0.25, 0.75)),
    }


ARM_KNOWN: tuple[Fault, ...] = (
    Fault("dh-offsets", "arm", STATIC, _links, exclusive="link angles"),
    Fault(
        "homing-offset",
        "arm",
        STATIC,
        lambda r, s: {"link_theta_mrad": _lists(s.draw_angles(r), RAD_PER_MRAD)},
        exclusive="link angles",
    ),
    Fault("homing-slip", "arm", STATIC, _slip),
    Fault("lead-scale", "arm", STATIC, _scale),
    Fault("once-per-rev", "arm", STATIC, _turns, exclusive="rings"),
    Fault("joint-error-map", "arm", STATIC, _ring, exclusive="rings"),
    Fault("backlash", "arm", STATIC, _play),
    Fault("over-compensation", "arm", STATIC, _over_compensation, effect="backlash"),
    Fault("windup", "arm", STATIC, _windup),
    Fault("axis-compliance", "arm", ("payload",), _soft, exclusive="springs"),
    Fault("self-weight", "arm", ("still load",), _weight, exclusive="springs"),
    Fault("frame-growth", "arm", ("warmup",), _growth),
    Fault("tracker-scale", "tracker", STATIC, wrong_scale),
    Fault("tracker-drift", "tracker", STATIC, _drift),
    Fault("setup-jump", "tracker", STATIC, _knock),
)
