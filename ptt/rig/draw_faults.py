"""Which faults can be hidden, on which protocols they can be seen, and how large they usually are."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.rig.nominal import Array, Drawing
from ptt.rig.targets import volume_span

Random = np.random.Generator
Draw = Callable[[Random, Drawing, ThreePttSpec], dict[str, Any]]
STATIC = ("volume",)
MOST = ("path", "volume")


@dataclass(frozen=True)
class Fault:
    """A fault that can be hidden.

    Attributes:
        name: the effect's name in the library, or the odd fault's.
        section: of the rig file.
        protocols: those that show it.
        draw: keys and values of the section.
    """

    name: str
    section: str
    protocols: tuple[Any, ...]
    draw: Draw


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _legs(random: Random, low: float, high: float, *, signed: bool = True, alone: bool = True) -> list[float]:
    """Log-uniform sizes on one leg or on all."""
    size = np.exp(random.uniform(np.log(low), np.log(high), 3))
    if signed:
        size = size * random.choice([-1.0, 1.0], 3)
    if alone and random.random() < 0.5:
        size = np.where(np.arange(3) == random.integers(3), size, 0.0)
    return [float(value) for value in np.round(size, 6)]


def _both_ways(random: Random, key: str, unit: str, low: float, high: float) -> dict[str, Any]:
    """A radial and a tangential fault on the same legs."""
    one = random.random() < 0.5
    keep = np.arange(3) == random.integers(3) if one else np.ones(3, dtype=bool)
    values = {}
    for way in ("radial", "tangential"):
        size = np.array(_legs(random, low, high, alone=False))
        values[f"{key}_{way}_{unit}"] = [float(value) for value in np.where(keep, size, 0.0)]
    return values


def _curve(random: Random, drawing: Drawing) -> dict[str, Any]:
    sizes = {"curve_parabola_um": _legs(random, 5, 20), "curve_cubic_um": _legs(random, 5, 20)}
    return {**sizes, "curve_span_mm": list(volume_span(drawing))}


def _turn(random: Random) -> dict[str, Any]:
    phase = np.round(random.uniform(0.0, 2.0 * np.pi, 3), 6)
    return {"turn_um": _legs(random, 3, 8, signed=False), "turn_phase_rad": phase.tolist()}


def _windup(random: Random) -> dict[str, Any]:
    return {
        "windup_um": _legs(random, 2, 10, signed=False),
        "windup_length_mm": [_log(random, 1, 4)] * 3,
    }


def _guide(random: Random, drawing: Drawing) -> dict[str, Any]:
    return {
        "straightness_um": _legs(random, 5, 20, signed=False),
        "straightness_seed": int(random.integers(10**6)),
        "straightness_span_mm": list(volume_span(drawing)),
    }


def _twist(random: Random) -> dict[str, Any]:
    return {
        "platform_axis_radial_mrad": _legs(random, 0.1, 0.7),
        "platform_axis_vertical_mrad": _legs(random, 0.1, 0.7),
    }


def _bend(random: Random) -> dict[str, Any]:
    angle, size = random.uniform(0.0, 2.0 * np.pi), _log(random, 1.0, 6.0)
    return {"column_bend_um_per_kg": [size * float(np.cos(angle)), size * float(np.sin(angle))]}


def _screw_growth(random: Random, spec: ThreePttSpec) -> dict[str, Any]:
    end = spec.slider_travel_mm[int(random.integers(2))]
    return {"growth_um_per_m_k": [_log(random, 11.0, 12.0)] * 3, "fixed_end_mm": [end] * 3}


def _frame_growth(random: Random) -> dict[str, Any]:
    return {
        "frame_um_per_m_k": _log(random, 10.0, 24.0),
        "link_um_per_m_k": _log(random, 1.0, 6.0),
        "sensor": "frame",
    }


def _drift(random: Random) -> dict[str, Any]:
    way = random.normal(size=3)
    return {"drift_um_per_h": (_log(random, 15.0, 50.0) * way / np.linalg.norm(way)).tolist()}


def _knock(random: Random) -> dict[str, Any]:
    way, turn = random.normal(size=(2, 3))
    return {
        "knock_um": (_log(random, 20.0, 200.0) * way / np.linalg.norm(way)).tolist(),
        "knock_mrad": (_log(random, 0.02, 0.2) * turn / np.linalg.norm(turn)).tolist(),
        "knock_share": float(random.uniform(0.25, 0.75)),
    }


KNOWN: tuple[Fault, ...] = (
    Fault("homing-offset", "drive", MOST, lambda r, d, s: {"homing_mm": _legs(r, 0.05, 1.0)}),
    Fault("lead-scale", "drive", STATIC, lambda r, d, s: {"scale_um_per_m": _legs(r, 30.0, 150.0)}),
    Fault("screw-error-map", "drive", STATIC, lambda r, d, s: _curve(r, d)),
    Fault("once-per-rev", "drive", MOST, lambda r, d, s: _turn(r)),
    Fault("backlash", "drive", MOST, lambda r, d, s: {"backlash_mm": _legs(r, 0.008, 0.2, signed=False)}),
    Fault("windup", "drive", ("path",), lambda r, d, s: _windup(r)),
    Fault(
        "following-error", "drive", ("speed",), lambda r, d, s: {"following_s": _legs(r, 0.005, 0.033, signed=False)}
    ),
    Fault("screw-growth", "thermal", ("warmup",), lambda r, d, s: _screw_growth(r, s)),
    Fault(
        "axis-compliance",
        "drive",
        ("payload",),
        lambda r, d, s: {"compliance_um_per_n": _legs(r, 0.03, 0.5, signed=False, alone=False)},
    ),
    Fault("tower-position", "geometry", STATIC, lambda r, d, s: _both_ways(r, "tower", "mm", 0.1, 0.5)),
    Fault("tower-tilt", "geometry", STATIC, lambda r, d, s: _both_ways(r, "lean", "mrad", 0.2, 2.0)),
    Fault("link-length", "geometry", STATIC, lambda r, d, s: {"link_mm": _legs(r, 0.02, 0.2)}),
    Fault("guide-straightness", "geometry", STATIC, lambda r, d, s: _guide(r, d)),
    Fault(
        "joint-clearance",
        "geometry",
        ("payload",),
        lambda r, d, s: {"clearance_um": _legs(r, 8, 50, signed=False, alone=False)},
    ),
    Fault("platform-twist", "geometry", STATIC, lambda r, d, s: _twist(r)),
    Fault("column-bend", "structure", ("payload",), lambda r, d, s: _bend(r)),
    Fault("frame-growth", "thermal", ("warmup",), lambda r, d, s: _frame_growth(r)),
    Fault("tracker-drift", "tracker", STATIC, lambda r, d, s: _drift(r)),
    Fault("setup-jump", "tracker", MOST, lambda r, d, s: _knock(r)),
)


def _height(random: Random, drawing: Drawing, spread: float = 25.0) -> float:
    """Somewhere in the middle of what a run covers."""
    return float(np.round(drawing.home[0] + random.uniform(-spread, spread), 3))


def _leg(random: Random) -> int:
    return int(random.integers(1, 4))


def _splice(random: Random, drawing: Drawing, spec: ThreePttSpec) -> dict[str, Any]:
    step = _log(random, 15.0, 60.0) * random.choice([-1.0, 1.0])
    return {"kind": "splice", "leg": _leg(random), "height_mm": _height(random, drawing), "step_um": float(step)}


def _damage(random: Random, drawing: Drawing, spec: ThreePttSpec) -> dict[str, Any]:
    return {
        "kind": "guide-damage",
        "leg": _leg(random),
        "height_mm": _height(random, drawing, 15.0),
        "size_um": _log(random, 30.0, 100.0),
        "width_mm": 10.0,
    }


def _roller(random: Random, drawing: Drawing, spec: ThreePttSpec) -> dict[str, Any]:
    """A period well away from the lead, its half and its double."""
    lead = spec.screw_lead_mm or 5.0
    period = lead * float(
        random.choice([random.uniform(0.6, 0.85), random.uniform(1.25, 1.75), random.uniform(2.3, 3.4)])
    )
    phase = float(random.uniform(0.0, 2.0 * np.pi))
    return {
        "kind": "periodic",
        "leg": _leg(random),
        "size_um": _log(random, 6, 20),
        "period_mm": period,
        "phase_rad": phase,
    }


def _hose(random: Random, drawing: Drawing, spec: ThreePttSpec) -> dict[str, Any]:
    """Slack over about half of the volume, taut on the far side."""
    angle = random.uniform(0.0, 2.0 * np.pi)
    anchor: Array = np.array([350.0 * np.cos(angle), 350.0 * np.sin(angle), random.uniform(100.0, 300.0)])
    free = float(np.linalg.norm(anchor) - random.uniform(0.0, 15.0))
    return {
        "kind": "hose",
        "anchor_mm": np.round(anchor, 2).tolist(),
        "stiffness_n_per_mm": _log(random, 0.5, 2.0),
        "free_length_mm": free,
        "compliance_um_per_n": [0.2, 0.2, 0.2],
    }


def _warm(random: Random, drawing: Drawing, spec: ThreePttSpec) -> dict[str, Any]:
    opens = float(random.uniform(21.0, 24.0))
    return {"kind": "warm-backlash", "leg": _leg(random), "gap_um_per_k": _log(random, 5, 20), "opens_at_c": opens}


UNKNOWN: tuple[Fault, ...] = (
    Fault("scale-splice", "odd", MOST, _splice),
    Fault("guide-damage", "odd", MOST, _damage),
    Fault("roller-period", "odd", MOST, _roller),
    Fault("hose", "odd", STATIC, _hose),
    Fault("warm-backlash", "odd", ("warmup",), _warm),
)
