"""From slider heights to the ends of the three chains: rails, guides, joints and links with their faults."""

import numpy as np
from scipy.interpolate import CubicSpline

from ptt.machine import ThreePttSpec
from ptt.rig.nominal import Array, Drawing
from ptt.rig.platform import Legs, rotation_matrix
from ptt.rig.schema import Geometry
from ptt.rig.units import MM_PER_UM, RAD_PER_MRAD

UP = np.array([0.0, 0.0, 1.0])


def build_legs(
    drawing: Drawing,
    faults: Geometry,
    slider: Array,
    *,
    wander: Array,
    bend: Array,
    growth: tuple[Array, Array, Array],
    stretch: Array,
) -> Legs:
    """Ends and lengths of the chains of every row.

    Args:
        drawing: the ideal machine.
        faults: of rails, joints, links.
        slider: (n, 3) mm, actual slider heights.
        wander: (n, 3, 2) mm, sideways shift of each slider by its guide, radial and tangential.
        bend: (n, 3, 3) mm, shift of each slider by its column.
        growth: relative growth of base radius, platform radius and links, (n,) each.
        stretch: (n, 3) mm, what load, joint clearance and odd faults add to each link.

    Returns:
        The chains.
    """
    rail, turn = _lean(drawing, faults)
    base, platform, links = growth
    out, aside = (np.asarray(size)[:, None] for size in (faults.tower_radial_mm, faults.tower_tangential_mm))
    foot = drawing.pivot + out * drawing.foot_direction + aside * drawing.sideways
    along = (slider - drawing.home)[..., None] * rail
    joint = foot + along + (base * drawing.base_radius)[:, None, None] * drawing.outward + bend
    joint = joint + wander[..., :1] * drawing.across + wander[..., 1:] * drawing.sideways
    # An axis displaced along the rail, towards the platform, cannot be told from a slider that sits lower.
    joint = joint - drawing.side * np.asarray(faults.joint_offset_rail_mm)[:, None] * rail
    end = drawing.platform_radius * drawing.outward
    end = end + _sideways(drawing, faults.platform_joint_radial_mm, faults.platform_joint_tangential_mm)
    ends = end + (platform * drawing.platform_radius)[:, None, None] * drawing.outward
    slider_axis = _axes(drawing, faults.slider_axis_radial_mrad, faults.slider_axis_vertical_mrad)
    if faults.lean_turns_joint_axis:
        slider_axis = np.einsum("lij,lj->li", turn, slider_axis)
    return Legs(
        slider=joint,
        slider_axis=np.broadcast_to(slider_axis, joint.shape),
        platform=ends,
        platform_axis=_axes(drawing, faults.platform_axis_radial_mrad, faults.platform_axis_vertical_mrad),
        length=(drawing.link + np.asarray(faults.link_mm)) * (1.0 + links[:, None]) + stretch,
        slider_offset=np.asarray(faults.joint_offset_slider_mm),
        platform_offset=np.asarray(faults.joint_offset_platform_mm),
    )


def guide_wander(spec: ThreePttSpec, faults: Geometry, slider: Array) -> Array:
    """Sideways shift of each slider where its guide is not straight.

    A given table is interpolated by a cubic spline, which stays as it is at its ends beyond them. A random guide is a
    short Fourier series of the given rms over the span (the travel, if none is given), less its best straight line
    there, which is the rail's position and lean.

    Args:
        spec: the drawing, for the travel.
        faults: straightness of the guides.
        slider: (n, 3) mm.

    Returns:
        (n, 3, 2) mm, across the rail outward and tangential.
    """
    shift = np.zeros((*slider.shape, 2))
    tables = (faults.straightness_radial_um, faults.straightness_tangential_um)
    for direction, table in enumerate(tables):
        for leg, values in enumerate(table):
            spline = CubicSpline(faults.straightness_height_mm, values)
            within = np.clip(slider[:, leg], faults.straightness_height_mm[0], faults.straightness_height_mm[-1])
            shift[:, leg, direction] += MM_PER_UM * spline(within)
    if any(faults.straightness_um):
        shift += _random_guides(spec, faults, slider)
    return shift


def _random_guides(spec: ThreePttSpec, faults: Geometry, slider: Array) -> Array:
    random = np.random.default_rng([faults.straightness_seed, 101])
    low, high = faults.straightness_span_mm or spec.whole_travel
    order = np.arange(1, faults.straightness_waves + 1)
    weight = random.normal(size=(3, 2, len(order), 2)) / order[:, None]
    fine = (np.arange(400) + 0.5) / 400
    shift = np.zeros((*slider.shape, 2))
    for leg in range(3):
        for direction in range(2):
            reference = _series(fine, weight[leg, direction])
            line = np.polyfit(fine, reference, 1)
            size = np.std(reference - np.polyval(line, fine))
            at = (slider[:, leg] - low) / (high - low)
            value = (_series(at, weight[leg, direction]) - np.polyval(line, at)) / size
            shift[:, leg, direction] = MM_PER_UM * faults.straightness_um[leg] * value
    return shift


def _series(part: Array, weight: Array) -> Array:
    """Half waves over a span, (n,): weights (w, 2) of cosine and sine at shares (n,) of it."""
    angle = np.pi * np.outer(part, np.arange(1, len(weight) + 1))
    return np.cos(angle) @ weight[:, 0] + np.sin(angle) @ weight[:, 1]


def _sideways(drawing: Drawing, radial: tuple[float, ...], tangential: tuple[float, ...]) -> Array:
    return np.asarray(radial)[:, None] * drawing.outward + np.asarray(tangential)[:, None] * drawing.sideways


def _lean(drawing: Drawing, faults: Geometry) -> tuple[Array, Array]:
    """Directions of the leaning rails, (3, 3), and the rotations that make them, (3, 3, 3).

    Positive radial leans the upper end outward, positive tangential counter-clockwise seen from above. Both rotation
    axes are perpendicular to the rail; a rotation about the rail itself moves no slider.
    """
    outward = RAD_PER_MRAD * np.asarray(faults.lean_radial_mrad)[:, None] * drawing.sideways
    aside = -RAD_PER_MRAD * np.asarray(faults.lean_tangential_mrad)[:, None] * drawing.across
    turn = rotation_matrix(outward + aside)
    return np.einsum("lij,lj->li", turn, drawing.rail), turn


def _axes(drawing: Drawing, radial: tuple[float, ...], vertical: tuple[float, ...]) -> Array:
    """Joint axes, horizontal and tangential on the drawing, tipped towards outward and up."""
    axis = drawing.sideways + RAD_PER_MRAD * np.asarray(radial)[:, None] * drawing.outward
    axis = axis + RAD_PER_MRAD * np.asarray(vertical)[:, None] * UP
    return axis / np.linalg.norm(axis, axis=1, keepdims=True)
