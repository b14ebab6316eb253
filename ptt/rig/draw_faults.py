"""Faults of a 3-PTT that effects of the library describe: their sizes, and the protocols that show them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.rig.nominal import Array, Drawing
from ptt.rig.targets import HALF_SIZE, volume_span

Random = np.random.Generator


@dataclass(frozen=True)
class Scene:
    """The machine and the run that faults are drawn for.

    Attributes:
        drawing: the ideal machine.
        spec: its [machine] section.
        half_size: (3,) mm, half size of the workspace.
        protocol: how the run is measured.
    """

    drawing: Drawing
    spec: ThreePttSpec
    half_size: Array
    protocol: str = "volume"

    @property
    def span(self) -> list[float]:
        """Lowest and highest slider height in the workspace, mm."""
        return list(volume_span(self.drawing, self.half_size))

    @property
    def scale(self) -> float:
        """Size of the workspace relative to the bench's."""
        return float((self.half_size / HALF_SIZE).min())


Draw = Callable[[Random, Any], dict[str, Any]]  # of a scene, or of an arm's
STATIC = ("volume",)
PATH_OR_VOLUME = ("path", "volume")


@dataclass(frozen=True)
class Fault:
    """A fault that can be hidden.

    Attributes:
        name: the effect's name in the library, or the odd fault's.
        section: of the rig file.
        protocols: those that show it.
        draw: draws keys and values of the section.
        effect: the effect's name in the library, where it is not the fault's own.
        unseen: held back from the development of the diagnosis, to judge it by.
        exclusive: a name shared by faults of which a rig has only one: two names of one thing, or one spring.
    """

    name: str
    section: str
    protocols: tuple[Any, ...]
    draw: Draw
    effect: str = ""
    unseen: bool = False
    exclusive: str = ""

    @property
    def called(self) -> str:
        """What a diagnosis should call it."""
        return self.effect or self.name


def log_uniform(random: Random, low: float, high: float) -> float:
    """A log-uniform size between two positive bounds."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def some_legs(random: Random, low: float, high: float, *, signed: bool = True, alone: bool = True) -> list[float]:
    """Log-uniform sizes of three legs; where `alone`, half of the draws have one on a single leg only."""
    size = np.exp(random.uniform(np.log(low), np.log(high), 3))
    if signed:
        size = size * random.choice([-1.0, 1.0], 3)
    if alone and random.random() < 0.5:
        size = np.where(np.arange(3) == random.integers(3), size, 0.0)
    return [float(value) for value in np.round(size, 6)]


def _both_ways(random: Random, key: str, unit: str, low: float, high: float) -> dict[str, Any]:
    """Radial and tangential sizes on the same legs, one or all."""
    one = random.random() < 0.5
    keep = np.arange(3) == random.integers(3) if one else np.ones(3, dtype=bool)
    values = {}
    for way in ("radial", "tangential"):
        size = np.array(some_legs(random, low, high, alone=False))
        values[f"{key}_{way}_{unit}"] = [float(value) for value in np.where(keep, size, 0.0)]
    return values


def _curve(random: Random, scene: Scene) -> dict[str, Any]:
    sizes = {"curve_parabola_um": some_legs(random, 5, 20), "curve_cubic_um": some_legs(random, 5, 20)}
    return {**sizes, "curve_span_mm": scene.span}


def _turn(random: Random) -> dict[str, Any]:
    phase = np.round(random.uniform(0.0, 2.0 * np.pi, 3), 6)
    return {"turn_um": some_legs(random, 3, 8, signed=False), "turn_phase_rad": phase.tolist()}


def _windup(random: Random) -> dict[str, Any]:
    sizes, common = some_legs(random, 2, 10, signed=False), log_uniform(random, 1, 4)
    alike = random.random() < 0.5
    return {
        "windup_um": sizes,
        "windup_length_mm": [common if alike else log_uniform(random, 1, 4) for _ in range(3)],
    }


def _guide(random: Random, scene: Scene) -> dict[str, Any]:
    return {
        "straightness_um": some_legs(random, 5, 20, signed=False),
        "straightness_seed": int(random.integers(10**6)),
        "straightness_span_mm": scene.span,
    }


def _twist(random: Random) -> dict[str, Any]:
    return {
        "platform_axis_radial_mrad": some_legs(random, 0.1, 0.7),
        "platform_axis_vertical_mrad": some_legs(random, 0.1, 0.7),
    }


def _bend(random: Random) -> dict[str, Any]:
    angle, size = random.uniform(0.0, 2.0 * np.pi), log_uniform(random, 1.0, 6.0)
    return {"column_bend_um_per_kg": [size * float(np.cos(angle)), size * float(np.sin(angle))]}


def _screw_growth(random: Random, spec: ThreePttSpec) -> dict[str, Any]:
    end = spec.whole_travel[int(random.integers(2))]
    return {"growth_um_per_m_k": [log_uniform(random, 11.0, 12.0)] * 3, "fixed_end_mm": [end] * 3}


def _frame_growth(random: Random) -> dict[str, Any]:
    return {
        "frame_um_per_m_k": log_uniform(random, 10.0, 24.0),
        "link_um_per_m_k": log_uniform(random, 1.0, 6.0),
        "sensor": "frame",
    }


def _drift(random: Random) -> dict[str, Any]:
    way = random.normal(size=3)
    return {"drift_um_per_h": (log_uniform(random, 15.0, 50.0) * way / np.linalg.norm(way)).tolist()}


def _knock(random: Random) -> dict[str, Any]:
    way, turn = random.normal(size=(2, 3))
    return {
        "knock_um": (log_uniform(random, 20.0, 200.0) * way / np.linalg.norm(way)).tolist(),
        "knock_mrad": (log_uniform(random, 0.02, 0.2) * turn / np.linalg.norm(turn)).tolist(),
        "knock_share": float(random.uniform(0.25, 0.75)),
    }


def _slip(random: Random, scene: Scene) -> dict[str, Any]:
    """The zero of one slider shifts between a fifth and four fifths of the run."""
    leg, size = random.integers(3), log_uniform(random, 0.02, 0.4) * random.choice([-1.0, 1.0])
    slip = [float(size) if other == leg else 0.0 for other in range(3)]
    return {"slip_mm": slip, "slip_share": float(random.uniform(0.2, 0.8))}


def _soft_links(random: Random, scene: Scene) -> dict[str, Any]:
    return {"link_compliance_um_per_n": some_legs(random, 0.03, 0.5, signed=False)}


def _over_compensation(random: Random, scene: Scene) -> dict[str, Any]:
    """A controller that compensates backlash which is not there: a negative gap to the library."""
    return {"backlash_mm": some_legs(random, 0.008, 0.1, signed=False)}


def wrong_scale(random: Random, scene: Any) -> dict[str, Any]:
    """A tracker whose unit of length is off; its key of [tracker]."""
    return {"scale_ppm": log_uniform(random, 20.0, 150.0) * float(random.choice([-1.0, 1.0]))}


def _offsets(random: Random, scene: Scene) -> dict[str, Any]:
    return {
        "joint_offset_rail_mm": some_legs(random, 0.02, 0.15),
        "joint_offset_slider_mm": some_legs(random, 0.02, 0.15),
    }


KNOWN: tuple[Fault, ...] = (
    Fault("homing-offset", "drive", PATH_OR_VOLUME, lambda r, s: {"homing_mm": some_legs(r, 0.05, 1.0)}),
    Fault("lead-scale", "drive", STATIC, lambda r, s: {"scale_um_per_m": some_legs(r, 30.0, 150.0)}),
    Fault("screw-error-map", "drive", STATIC, _curve),
    Fault("once-per-rev", "drive", PATH_OR_VOLUME, lambda r, s: _turn(r)),
    Fault("backlash", "drive", PATH_OR_VOLUME, lambda r, s: {"backlash_mm": some_legs(r, 0.008, 0.2, signed=False)}),
    Fault("windup", "drive", ("path",), lambda r, s: _windup(r)),
    Fault(
        "following-error", "drive", ("speed",), lambda r, s: {"following_s": some_legs(r, 0.005, 0.033, signed=False)}
    ),
    Fault("screw-growth", "thermal", ("warmup",), lambda r, s: _screw_growth(r, s.spec)),
    Fault(
        "axis-compliance",
        "drive",
        ("payload",),
        lambda r, s: {"compliance_um_per_n": some_legs(r, 0.03, 0.5, signed=False, alone=False)},
    ),
    Fault("tower-position", "geometry", STATIC, lambda r, s: _both_ways(r, "tower", "mm", 0.1, 0.5)),
    Fault("tower-tilt", "geometry", STATIC, lambda r, s: _both_ways(r, "lean", "mrad", 0.2, 2.0)),
    Fault("link-length", "geometry", STATIC, lambda r, s: {"link_mm": some_legs(r, 0.02, 0.2)}),
    Fault("guide-straightness", "geometry", STATIC, _guide),
    Fault(
        "joint-clearance",
        "geometry",
        ("payload",),
        lambda r, s: {"clearance_um": some_legs(r, 8, 50, signed=False, alone=False)},
    ),
    Fault("platform-twist", "geometry", STATIC, lambda r, s: _twist(r)),
    Fault("column-bend", "structure", ("payload",), lambda r, s: _bend(r)),
    Fault("frame-growth", "thermal", ("warmup",), lambda r, s: _frame_growth(r)),
    Fault("tracker-drift", "tracker", STATIC, lambda r, s: _drift(r)),
    Fault("setup-jump", "tracker", PATH_OR_VOLUME, lambda r, s: _knock(r)),
    Fault("homing-slip", "drive", PATH_OR_VOLUME, _slip),
    Fault("link-compliance", "geometry", ("payload",), _soft_links),
    Fault("over-compensation", "controller", PATH_OR_VOLUME, _over_compensation, effect="backlash"),
    Fault("tracker-scale", "tracker", STATIC, wrong_scale),
    Fault("joint-offset", "geometry", STATIC, _offsets),
)
