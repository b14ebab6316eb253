"""Faults of an arm that no effect of the library describes; random laws are held back to judge the diagnosis by."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from ptt.rig.arm_scene import ArmScene
from ptt.rig.draw_faults import STATIC, Fault, Random, log_uniform
from ptt.rig.draw_unseen import BESIDES, HOW_MANY, SLOW
from ptt.rig.units import MM_PER_UM, RAD_PER_NRAD, RAD_PER_URAD

HAND_KG = (1.0, 8.0)  # mass at the end of an arm besides the payload


def _one(
    kind: str, fill: Callable[[Random, ArmScene, int], dict[str, Any]], *, loaded: bool = False
) -> Callable[[Random, ArmScene], dict[str, Any]]:
    """The draw of a fault of one visible joint; of one that weights load where the fault needs a torque."""

    def draw(random: Random, scene: ArmScene) -> dict[str, Any]:
        joint = int(random.choice(scene.loaded_joints if loaded else scene.visible_joints))
        return {"kind": kind, "joint": joint + 1, **fill(random, scene, joint)}

    return draw


def _urad(random: Random, scene: ArmScene, joint: int, times: float) -> float:
    return times * scene.draw_angle(random, joint) / RAD_PER_URAD


def _signed(random: Random, scene: ArmScene, joint: int, times: float) -> float:
    return _urad(random, scene, joint, times) * float(random.choice([-1.0, 1.0]))


def _hardening(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    hand = log_uniform(random, *HAND_KG)
    usual = max((hand + float(scene.payload.mean())) * scene.weight_lever(joint), 1.0)
    half = usual * log_uniform(random, 0.05, 0.4)
    return {"size_urad": _urad(random, scene, joint, 1.5), "half_nmm": half, "hand_kg": hand}


def _friction(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    hand = log_uniform(random, *HAND_KG)
    usual = max((hand + float(scene.payload.mean())) * scene.weight_lever(joint), 1.0)
    return {"urad_per_nmm": _urad(random, scene, joint, 1.5) / usual, "hand_kg": hand}


def _tooth(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    """In the middle half of the joint's range, as wide as one to three teeth of a large wheel."""
    low, high = (float(end[joint]) for end in scene.span)
    place = random.uniform(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
    width = random.uniform(0.03, 0.12) * (high - low)
    return {"angle_rad": place, "width_rad": width, "size_urad": _signed(random, scene, joint, 2.5)}


def _holder(random: Random, scene: ArmScene) -> dict[str, Any]:
    way = random.normal(size=3)
    shift = 2.0 * scene.draw_shift(random) / MM_PER_UM * way / np.linalg.norm(way)
    return {"kind": "slipping-tool", "shift_um": shift.tolist(), "share": float(random.uniform(0.25, 0.75))}


def _rocking(random: Random, scene: ArmScene) -> dict[str, Any]:
    weight = log_uniform(random, 5.0, 60.0) * 1e-3 * scene.reach
    # Not GRAVITY: the digits are part of what a seed draws.
    moment = 9.81 * (weight + float(scene.payload.mean())) * scene.reach
    return {
        "kind": "rocking-base",
        "moving_kg": weight,
        "nrad_per_nmm": 2.0 * scene.draw_shift(random) / scene.reach / moment / RAD_PER_NRAD,
    }


def _wobble(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    size = scene.draw_shift(random) / (0.5 * scene.reach) / RAD_PER_URAD
    phase = float(random.uniform(0.0, 2.0 * np.pi))
    return {"size_urad": size, "times": int(random.integers(2, 6)), "phase_rad": phase}


def _cables(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    ends = [float(end[joint]) for end in scene.span]
    low, high = ends if random.random() < 0.5 else ends[::-1]
    return {"low_rad": low, "high_rad": high, "size_urad": _urad(random, scene, joint, 2.5)}


def _belt(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    """A period that divides no turn evenly, and longer than two usual steps: a shorter one is aliased."""
    often = min(float(random.integers(3, 40)), np.pi / max(float(scene.step[joint]), 0.05)) // 1.0
    period = 2.0 * np.pi / (max(often, 2.0) + random.uniform(0.25, 0.75))
    phase = float(random.uniform(0.0, 2.0 * np.pi))
    return {"size_urad": _urad(random, scene, joint, 1.4), "period_rad": period, "phase_rad": phase}


def _counts(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    return {"step_urad": _urad(random, scene, joint, 3.5)}


def _warm(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    size = _signed(random, scene, joint, 1.5) / max(scene.warming_size_k, 0.5)
    lag = float(random.choice([0.0, log_uniform(random, 0.02, 0.5) * scene.seconds]))
    return {"urad_per_k": size, "constant_s": lag}


def _busy(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    rows = max(len(scene.q) - 1, 1)
    speed = float(np.abs(np.diff(scene.q[:, joint])).sum()) / rows / (scene.seconds / len(scene.q))
    constant = log_uniform(random, 0.05, 0.5) * scene.seconds
    return {"urad_s_per_rad": _signed(random, scene, joint, 2.0) / max(speed, 1e-6), "constant_s": constant}


def _coupled(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    others = [other for other in scene.visible_joints.tolist() if other != joint] or [(joint + 1) % scene.joints]
    other = int(random.choice(others))
    low, high = (float(end[other]) for end in scene.span)
    return {
        "other": other + 1,
        "angle_rad": float(random.uniform(low, high)),
        "span_rad": max(0.5 * (high - low), 0.05),
        "size_urad": _signed(random, scene, joint, 2.0),
    }


def _loose(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    opens = float(random.uniform(0.0, 0.3)) * float(scene.payload.max(initial=1.0))
    usual = max(float(np.maximum(scene.payload - opens, 0.0).mean()), 0.2)
    return {"urad_per_kg": _urad(random, scene, joint, 2.0) / usual, "opens_at_kg": opens}


def _loss(random: Random, scene: ArmScene, joint: int) -> dict[str, Any]:
    turns = int((np.diff(np.sign(np.diff(scene.q[:, joint]))) != 0).sum())
    return {"urad_per_reversal": _signed(random, scene, joint, 3.0) / max(turns, 1)}


def _law(acts: str, form: str) -> Callable[[Random, ArmScene], dict[str, Any]]:
    """The draw of a random law that acts on a joint, the lean of its axis, the tool or the line of sight."""

    def draw(random: Random, scene: ArmScene) -> dict[str, Any]:
        joint = scene.draw_joint(random) + 1 if acts in ("joint", "lean") else None
        axis = {"joint": "", "lean": f"-{'xy'[random.integers(2)]}"}.get(acts, f"-{'xyz'[random.integers(3)]}")
        moving = [number + 1 for number in scene.visible_joints.tolist()]
        names = [*(f"q{number}" for number in moving), *(f"direction{number}" for number in moving), "x", "y", "z"]
        names += ["time", *BESIDES.get(scene.protocol, ())]
        while True:
            count = min(int(random.choice(HOW_MANY)), len(names))
            chosen = random.choice(names, count, replace=False).tolist()
            if not describable(acts, joint, form, chosen):
                break
        lever = {"joint": float(scene.lever[(joint or 1) - 1]) * RAD_PER_URAD, "lean": 0.5 * scene.reach * RAD_PER_URAD}
        return {
            "kind": "arm-law",
            "place": f"{acts}{axis}",
            **({} if joint is None else {"joint": joint}),
            "form": form,
            "variables": chosen,
            "span": [_span(name, scene) for name in chosen],
            "size": 1.2 * scene.draw_shift(random) / lever.get(acts, MM_PER_UM),
            "law_seed": int(random.integers(10**6)),
        }

    return draw


def describable(acts: str, joint: int | None, form: str, variables: list[str]) -> bool:
    """Whether effects of the library could describe a random law.

    Args:
        acts: where it acts: joint, lean, tool or sight.
        joint: its joint, from 1; None where it acts on tool or sight.
        form: smooth, jumpy or periodic.
        variables: names of its variables.

    Returns:
        True for laws that are not to be hidden as unknown ones.
    """
    if set(variables) <= SLOW:
        return True  # loads, warmth, drift, knocks, slipped zeros
    if acts != "joint" or len(variables) > 1:
        return False
    own = {f"direction{joint}"} | ({f"q{joint}"} if form != "jumpy" else set())  # backlash, uneven rings
    return variables[0] in own


def _span(name: str, scene: ArmScene) -> list[float]:
    """Range of a variable in a run."""
    if name[0] == "q":
        low, high = (float(end[int(name[1:]) - 1]) for end in scene.span)
        return [low, max(high, low + 0.05)]
    if name in "xyz":
        low, high = (float(end["xyz".index(name)]) for end in scene.tool_range)
        return [low, max(high, low + 1.0)]
    fixed = {"payload": [0.0, float(scene.payload.max(initial=1.0)) or 1.0], "time": [0.0, 1.0]}
    ends = sorted([scene.spec.reference_temp_c, scene.spec.reference_temp_c + 1.5 * scene.warming_k])
    fixed |= {key: [ends[0], max(ends[1], ends[0] + 1.0)] for key in ("temperature", "memory")}
    return fixed.get(name, [-1.0, 1.0])


SHOWN: tuple[Fault, ...] = (
    Fault("hardening-joint", "odd", ("volume",), _one("hardening-joint", _hardening, loaded=True)),
    Fault("loaded-friction", "odd", STATIC, _one("loaded-friction", _friction, loaded=True)),
    Fault("damaged-tooth", "odd", STATIC, _one("damaged-tooth", _tooth)),
    Fault("slipping-tool", "odd", STATIC, _holder),
    Fault("rocking-base", "odd", STATIC, _rocking),
    Fault("wobbling-axis", "odd", STATIC, _one("wobbling-axis", _wobble)),
    Fault("dress-pack", "odd", STATIC, _one("dress-pack", _cables)),
    Fault("belt-resonance", "odd", STATIC, _one("belt-resonance", _belt)),
    Fault("rounding-controller", "odd", STATIC, _one("rounding-controller", _counts)),
    Fault("warm-joint", "odd", ("warmup",), _one("warm-joint", _warm)),
    Fault("busy-joint", "odd", STATIC, _one("busy-joint", _busy)),
    Fault("coupled-joints", "odd", STATIC, _one("coupled-joints", _coupled)),
    Fault("loaded-play", "odd", ("payload",), _one("loaded-play", _loose)),
    Fault("loss-at-reversal", "odd", STATIC, _one("loss-at-reversal", _loss)),
)
ACTS, FORMS = ("joint", "lean", "tool", "sight"), ("smooth", "jumpy", "periodic")
ARM_ODD: tuple[Fault, ...] = (
    *SHOWN,
    *(
        Fault(f"random-{acts}-{form}", "odd", STATIC, _law(acts, form), unseen=True)
        for acts, form in itertools.product(ACTS, FORMS)
    ),
)
