"""Faults that no effect of the library describes, as they are hidden in rigs."""

from typing import Any

import numpy as np

from ptt.rig.draw_faults import MOST, STATIC, Fault, Random, Scene, log_uniform
from ptt.rig.nominal import Array


def _height(random: Random, scene: Scene, spread: float = 25.0) -> float:
    """Somewhere in the middle of what a run covers."""
    return float(np.round(scene.drawing.home[0] + scene.scale * random.uniform(-spread, spread), 3))


def _leg(random: Random) -> int:
    return int(random.integers(1, 4))


def _splice(random: Random, scene: Scene) -> dict[str, Any]:
    step = log_uniform(random, 15.0, 60.0) * random.choice([-1.0, 1.0])
    return {"kind": "splice", "leg": _leg(random), "height_mm": _height(random, scene), "step_um": float(step)}


def _damage(random: Random, scene: Scene) -> dict[str, Any]:
    return {
        "kind": "guide-damage",
        "leg": _leg(random),
        "height_mm": _height(random, scene, 15.0),
        "size_um": log_uniform(random, 30.0, 100.0),
        "width_mm": 10.0 * scene.scale,
    }


def _roller(random: Random, scene: Scene) -> dict[str, Any]:
    """A period well away from the lead, its half and its double."""
    lead = scene.spec.screw_lead_mm or 5.0
    period = lead * float(
        random.choice([random.uniform(0.6, 0.85), random.uniform(1.25, 1.75), random.uniform(2.3, 3.4)])
    )
    phase = float(random.uniform(0.0, 2.0 * np.pi))
    return {
        "kind": "periodic",
        "leg": _leg(random),
        "size_um": log_uniform(random, 6, 20),
        "period_mm": period,
        "phase_rad": phase,
    }


def _hose(random: Random, scene: Scene) -> dict[str, Any]:
    """Slack over about half of the volume, taut on the far side."""
    angle = random.uniform(0.0, 2.0 * np.pi)
    away, high = 1.75 * scene.drawing.base_radius, scene.drawing.link / 300.0
    anchor: Array = np.array([away * np.cos(angle), away * np.sin(angle), high * random.uniform(100.0, 300.0)])
    free = float(np.linalg.norm(anchor) - scene.scale * random.uniform(0.0, 15.0))
    return {
        "kind": "hose",
        "anchor_mm": np.round(anchor, 2).tolist(),
        "stiffness_n_per_mm": log_uniform(random, 0.5, 2.0),
        "free_length_mm": free,
        "compliance_um_per_n": [0.2, 0.2, 0.2],
    }


def _warm(random: Random, scene: Scene) -> dict[str, Any]:
    opens = float(random.uniform(21.0, 24.0))
    return {
        "kind": "warm-backlash",
        "leg": _leg(random),
        "gap_um_per_k": log_uniform(random, 5, 20),
        "opens_at_c": opens,
    }


UNKNOWN: tuple[Fault, ...] = (
    Fault("scale-splice", "odd", MOST, _splice),
    Fault("guide-damage", "odd", MOST, _damage),
    Fault("roller-period", "odd", MOST, _roller),
    Fault("hose", "odd", STATIC, _hose),
    Fault("warm-backlash", "odd", ("warmup",), _warm),
)
