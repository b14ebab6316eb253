"""Faults of a 3-PTT that no effect of the library describes, of random sizes."""

from typing import Any

import numpy as np

from ptt.rig.draw_faults import PATH_OR_VOLUME, STATIC, Fault, Random, Scene, log_uniform
from ptt.rig.nominal import Array


def some_height(random: Random, scene: Scene, spread: float = 25.0) -> float:
    """A slider height, mm, within +-spread mm on the bench about that at p = 0."""
    return float(np.round(scene.drawing.home[0] + scene.scale * random.uniform(-spread, spread), 3))


def some_leg(random: Random) -> int:
    """Number of a leg, 1 to 3."""
    return int(random.integers(1, 4))


def log_signed(random: Random, low: float, high: float) -> float:
    """A log-uniform size of random sign."""
    return log_uniform(random, low, high) * float(random.choice([-1.0, 1.0]))


def _splice(random: Random, scene: Scene) -> dict[str, Any]:
    step = log_uniform(random, 15.0, 60.0) * random.choice([-1.0, 1.0])
    return {"kind": "splice", "leg": some_leg(random), "height_mm": some_height(random, scene), "step_um": float(step)}


def _damage(random: Random, scene: Scene) -> dict[str, Any]:
    return {
        "kind": "guide-damage",
        "leg": some_leg(random),
        "height_mm": some_height(random, scene, 15.0),
        "size_um": log_uniform(random, 30.0, 100.0),
        "width_mm": 10.0 * scene.scale,
    }


def _roller(random: Random, scene: Scene) -> dict[str, Any]:
    """A period well away from the screw's lead, its half, double and triple."""
    lead = scene.spec.screw_lead_mm or 5.0
    period = lead * float(
        random.choice([random.uniform(0.6, 0.85), random.uniform(1.25, 1.75), random.uniform(2.3, 3.4)])
    )
    phase = float(random.uniform(0.0, 2.0 * np.pi))
    return {
        "kind": "periodic",
        "leg": some_leg(random),
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
        "leg": some_leg(random),
        "gap_um_per_k": log_uniform(random, 5, 20),
        "opens_at_c": opens,
    }


def _worn(random: Random, scene: Scene) -> dict[str, Any]:
    """Wear of a screw where it works most."""
    return {
        "kind": "bump",
        "leg": some_leg(random),
        "height_mm": some_height(random, scene, 20.0),
        "size_um": -log_uniform(random, 15.0, 60.0),
        "width_mm": scene.scale * float(random.uniform(4.0, 9.0)),
    }


def _coupled(random: Random, scene: Scene) -> dict[str, Any]:
    leg, other = (int(number) + 1 for number in random.permutation(3)[:2])
    low, high = scene.span
    return {
        "kind": "cross-coupling",
        "leg": leg,
        "other": other,
        "height_mm": float(np.round(random.uniform(low, high), 3)),
        "span_mm": float(np.round(0.5 * (high - low), 3)),
        "size_um": log_signed(random, 20.0, 80.0),
    }


def _cable(random: Random, scene: Scene) -> dict[str, Any]:
    """Twice the wanted share, since half of it is plain backlash."""
    ends = scene.span if random.random() < 0.5 else scene.span[::-1]
    size = log_uniform(random, 15.0, 60.0)
    return {"kind": "cable-drag", "leg": some_leg(random), "low_mm": ends[0], "high_mm": ends[1], "size_um": size}


def _loaded_nut(random: Random, scene: Scene) -> dict[str, Any]:
    opens = float(random.uniform(0.0, 1.5))
    size = log_uniform(random, 8.0, 40.0)
    return {"kind": "load-backlash", "leg": some_leg(random), "gap_um_per_kg": size, "opens_at_kg": opens}


def _rattle(random: Random, scene: Scene) -> dict[str, Any]:
    return {"kind": "loose-joint", "leg": some_leg(random), "size_um": log_signed(random, 15.0, 80.0)}


def _table(random: Random, scene: Scene) -> dict[str, Any]:
    """Sized by the shift of the tool at the edge of the workspace, 20 to 150 um under the moving mass."""
    pivot = float(np.round(scene.drawing.link * random.uniform(1.0, 2.5), 1))
    tilt = 1e3 * log_uniform(random, 20.0, 150.0) / (10.0 * float(scene.half_size[0]) * pivot)
    return {"kind": "settling-table", "urad_per_kg_mm": tilt, "moving_kg": 10.0, "pivot_mm": pivot}


SHOWN_FAULTS: tuple[Fault, ...] = (
    Fault("scale-splice", "odd", PATH_OR_VOLUME, _splice),
    Fault("guide-damage", "odd", PATH_OR_VOLUME, _damage),
    Fault("roller-period", "odd", PATH_OR_VOLUME, _roller),
    Fault("hose", "odd", STATIC, _hose),
    Fault("warm-backlash", "odd", ("warmup",), _warm),
    Fault("worn-spot", "odd", PATH_OR_VOLUME, _worn),
    Fault("cross-coupling", "odd", STATIC, _coupled),
    Fault("cable-drag", "odd", PATH_OR_VOLUME, _cable),
    Fault("load-backlash", "odd", ("payload",), _loaded_nut),
    Fault("loose-joint", "odd", STATIC, _rattle),
    Fault("settling-table", "odd", ("volume", "payload"), _table),
)
