"""Drawings of random 3-PTT machines, each with a workspace well away from its singularities."""

import itertools
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ptt.machine import MachineFile, ThreePttSpec
from ptt.machine_schema import BasePoint, TrackerSpec
from ptt.rig.nominal import Array, Drawing, ideal_machine, nominal_sliders

Frame = Literal["fitted", "trusted", "fitted-per-run", "measured"]
LEAST_SLOPE = 0.35  # least cosine between link and rail: 20 degrees from the inverse singularity
MOST_GAIN = 4.5  # greatest singular value of dp/db; the bench has 2.3, the direct singularity infinity
LEAST_TURN = 0.2  # least singular value of the rotational constraints; the bench has 0.41, their singularity 0
SHRINK = 0.9  # factor on a workspace that comes too near to a singularity
LEAST_HALF_WIDTH = 0.06  # half width of a workspace per link length: a machine that moves less is drawn anew
SPARE = 0.08  # share of the sliders' range, left as travel at both ends for corrections
LEADS_MM = (2.0, 4.0, 5.0, 6.0, 10.0, 16.0, 20.0)
GRID = np.array(list(itertools.product(np.linspace(-1.0, 1.0, 5), repeat=3)))


@dataclass(frozen=True)
class Foreign:
    """A random drawing.

    Attributes:
        file: the machine, its tracker frame and what is known of the noise (`sigma_mm` is left to who draws the noise).
        half_size: (3,) mm, half size of the workspace about p = 0.
    """

    file: MachineFile
    half_size: Array


def draw_machine_file(seed: int, *, steep: bool = False) -> Foreign:
    """Draw a machine: links of 150 to 900 mm, sliders above or below, rails uneven or leaning.

    Args:
        seed: of everything.
        steep: rails lean by 15 to 75 degrees, or lie flat as a star, instead of by 12 degrees at the most.

    Returns:
        The drawing and its workspace.
    """
    random, leaning = np.random.default_rng([seed, 71]), np.random.default_rng([seed, 73])
    for _ in range(1000):
        values = _draw_lengths(random) | (_draw_leans(leaning) if steep else {})
        spec = ThreePttSpec(kind="three-ptt", slider_travel_mm=(0.0, 1e5), **values)
        half_size = _draw_half_size(random, spec.link_length_mm)
        half_size = _shrink(ideal_machine(spec), half_size)
        if half_size[0] >= LEAST_HALF_WIDTH * spec.link_length_mm:
            break
    else:
        raise AssertionError("no drawing has a workspace")
    travel = _travel(ideal_machine(spec), half_size)
    spec = spec.model_copy(update={"slider_travel_mm": travel})
    return Foreign(MachineFile(spec, tracker=_draw_tracker(random, spec), source=f"foreign {seed}"), half_size)


def singularity_margins(drawing: Drawing, tool: Array) -> dict[str, Array]:
    """Distances of poses from the singularities of a machine.

    Source: inverse singularity, a link perpendicular to its rail; direct singularity, J without inverse (db = J dp,
    rows s_i / s_i . d_i); constraint singularity, linearly dependent components s_i - (s_i . e_i) e_i of the links
    perpendicular to their joint axes.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm.

    Returns:
        (n,) each: `slope`, the least cosine between link and rail, 0 out of reach; `gain`, the greatest singular value
        of dp/db; `turn`, the least singular value of those components.
    """
    height = nominal_sliders(drawing, tool)
    reached = np.isfinite(height).all(axis=1)
    height = np.where(reached[:, None], height, drawing.home)
    joint = drawing.pivot + (height - drawing.home)[..., None] * drawing.rail
    link = tool[:, None] + drawing.platform_radius * drawing.outward - joint
    unit = link / np.linalg.norm(link, axis=-1, keepdims=True)
    cosine = (unit * drawing.rail).sum(-1)
    reached &= (np.abs(cosine) > 1e-6).all(axis=1)
    jacobian = unit / np.where(reached[:, None], cosine, 1.0)[..., None]
    parts = unit - (unit * drawing.sideways).sum(-1, keepdims=True) * drawing.sideways
    least = np.linalg.svd(np.stack([jacobian, parts]), compute_uv=False)[..., -1]
    return {
        "slope": np.where(reached, np.abs(cosine).min(axis=1), 0.0),
        "gain": np.where(reached, 1.0 / np.maximum(least[0], 1e-12), np.inf),
        "turn": np.where(reached, least[1], 0.0),
    }


def _draw_lengths(random: np.random.Generator) -> dict[str, Any]:
    """Lengths, azimuths and leans as a drawing states them: in half millimetres and tenths of a degree."""
    link = _half(np.exp(random.uniform(np.log(150.0), np.log(900.0))))
    platform, difference = _half(link * random.uniform(0.12, 0.5)), _half(link * random.uniform(0.2, 0.6))
    uneven = random.uniform(-15.0, 15.0, 3) if random.random() < 0.5 else np.zeros(3)
    azimuth = random.uniform(0.0, 360.0) * (random.random() < 0.5) + np.array([0.0, 120.0, 240.0]) + uneven
    lean = random.choice(["none", "none", "common", "own"])
    leans = {"none": np.zeros(3), "common": np.full(3, random.uniform(-12.0, 12.0)), "own": random.uniform(-8, 8, 3)}
    offset = random.uniform([-0.2, -0.2, -0.3], [0.2, 0.2, 0.1]) * link * (random.random() < 0.6)
    return {
        "name": "foreign",
        "base_radius_mm": platform + difference,
        "platform_radius_mm": platform,
        "link_length_mm": link,
        "slider_azimuth_deg": tuple(np.round(azimuth, 1).tolist()),
        "slider_lean_deg": tuple(np.round(leans[str(lean)], 1).tolist()),
        "screw_lead_mm": float(random.choice(LEADS_MM)),
        "sliders": str(random.choice(["above", "below"])),
        "joint_height_mm": _half(random.uniform(0.0, 200.0) * (random.random() < 0.5)),
        "moves": str(random.choice(["sliders", "straight"])),
        "reference_temp_c": float(random.choice([18.0, 20.0, 22.0])),
        "reflector_mm": tuple(np.round(offset, 1).tolist()),
        "platform_mass_kg": round(float(random.uniform(0.5, 8.0)), 2) * float(random.random() < 0.6),
    }


def _draw_leans(random: np.random.Generator) -> dict[str, Any]:
    """Rails that lean far, all by one angle or each by its own, or lie flat as a star."""
    common = random.choice([-1.0, 1.0]) * random.uniform(15.0, 75.0)
    leans = {"common": np.full(3, common), "own": common + random.uniform(-8.0, 8.0, 3), "star": np.full(3, 90.0)}
    return {"slider_lean_deg": tuple(np.round(leans[str(random.choice(list(leans)))], 1).tolist())}


def _draw_half_size(random: np.random.Generator, link: float) -> Array:
    wide = random.uniform(0.15, 0.3) * link
    return wide * np.array([1.0, random.uniform(0.7, 1.0), random.uniform(0.4, 1.2)])


def _shrink(drawing: Drawing, half_size: Array) -> Array:
    """Half size of the largest workspace of the same shape that keeps its distance from singularities."""
    while half_size[0] > 0.5 * LEAST_HALF_WIDTH * drawing.link:
        margins = singularity_margins(drawing, GRID * half_size)
        if (
            margins["slope"].min() >= LEAST_SLOPE
            and margins["gain"].max() <= MOST_GAIN
            and margins["turn"].min() >= LEAST_TURN
        ):
            return np.floor(half_size)
        half_size = SHRINK * half_size
    return np.zeros(3)


def _travel(drawing: Drawing, half_size: Array) -> tuple[float, float]:
    """Travel of the sliders for a workspace, whole millimetres, with some to spare at both ends."""
    heights = nominal_sliders(drawing, GRID * half_size)
    low, high = float(heights.min()), float(heights.max())
    spare = SPARE * (high - low) + 5.0
    return float(np.floor(low - spare)), float(np.ceil(high + spare))


def _draw_tracker(random: np.random.Generator, spec: ThreePttSpec) -> TrackerSpec:
    frames: tuple[Frame, ...] = ("fitted", "fitted", "fitted", "trusted", "fitted-per-run", "measured")
    frame = frames[random.integers(len(frames))]
    if frame != "measured":
        return TrackerSpec(frame=frame)
    angle = np.radians(np.array(spec.slider_azimuth_deg) + 60.0)
    around = 1.3 * spec.base_radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])
    height = random.uniform(-100.0, 100.0, 3)
    points = np.round(np.column_stack([around, height]), 2)
    names = ("base 1", "base 2", "base 3", "base 4")
    points = np.vstack([points, np.round(points.mean(0) + np.array([0.0, 0.0, 1.2 * spec.base_radius_mm]), 2)])
    base = tuple(BasePoint(name=name, xyz_mm=tuple(p)) for name, p in zip(names, points.tolist(), strict=True))
    return TrackerSpec(frame="measured", base_point=base)


def _half(value: float) -> float:
    return round(2.0 * float(value)) / 2.0
