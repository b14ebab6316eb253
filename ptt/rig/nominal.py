"""The ideal machine: directions and lengths of its drawing, and its inverse kinematics in closed form."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ptt.machine import ThreePttSpec

Array = np.ndarray

ROUNDING = 1e-6  # mm: home heights that are nearer to each other are the same


@dataclass(frozen=True)
class Drawing:
    """Directions and lengths of the ideal machine.

    Attributes:
        outward: (3, 3), horizontal unit vector from the centre to each slider.
        sideways: (3, 3), horizontal unit vector across it, counter-clockwise.
        rail: (3, 3), unit vector of each rail, upwards.
        across: (3, 3), unit vector at right angles to rail and sideways: outward where the rail is upright.
        foot_direction: (3, 3), unit vector of a radial shift of the rail: outward, or across where the rail is flatter
            than 45 degrees, along which a shift outward would be one along the rail.
        pivot: (3, 3) mm, joint on each slider when the tool is at p = 0; leaning rails turn about it.
        home: (3,) mm, slider heights at p = 0.
        base_radius: mm, of the joints on the sliders at p = 0.
        platform_radius: mm, of the joints on the platform.
        link: mm, length of the links.
        side: +1 where the sliders are above the platform, -1 where below.
        travel: (2, 3) mm, lowest and highest height of each slider.
    """

    outward: Array
    sideways: Array
    rail: Array
    across: Array
    foot_direction: Array
    pivot: Array
    home: Array
    base_radius: float
    platform_radius: float
    link: float
    side: float
    travel: Array


def ideal_machine(spec: ThreePttSpec) -> Drawing:
    """Directions, lengths and home heights of a drawing.

    Args:
        spec: the [machine] section.

    Returns:
        The ideal machine.
    """
    angle, lean = np.radians(spec.slider_azimuth_deg), np.radians(spec.slider_lean_deg)
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    sideways = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(3)])
    up = np.array([0.0, 0.0, 1.0])
    side = 1.0 if spec.sliders == "above" else -1.0
    rise = side * math.sqrt(spec.link_length_mm**2 - (spec.base_radius_mm - spec.platform_radius_mm) ** 2)
    across = np.cos(lean)[:, None] * outward - np.sin(lean)[:, None] * up
    drawing = Drawing(
        outward=outward,
        sideways=sideways,
        rail=np.sin(lean)[:, None] * outward + np.cos(lean)[:, None] * up,
        across=across,
        foot_direction=np.where((np.abs(np.sin(lean)) > np.abs(np.cos(lean)))[:, None], across, outward),
        pivot=spec.base_radius_mm * outward + rise * up,
        home=np.full(3, spec.joint_height_mm + rise),
        base_radius=spec.base_radius_mm,
        platform_radius=spec.platform_radius_mm,
        link=spec.link_length_mm,
        side=side,
        travel=np.transpose(spec.travel_ends),
    )
    return _anchored(drawing)


def _anchored(drawing: Drawing) -> Drawing:
    """The drawing with home and pivot where its sliders stand at p = 0.

    On a rail that leans so far that its slider would be on the other side of its link there, that is another place than
    on the upright machine.
    """
    apart = nominal_sliders(drawing, np.zeros((1, 3)))[0] - drawing.home
    if not (np.abs(apart) > ROUNDING).any():  # nor where p = 0 is out of reach
        return drawing
    return replace(drawing, home=drawing.home + apart, pivot=drawing.pivot + apart[:, None] * drawing.rail)


def nominal_sliders(drawing: Drawing, tool: Array) -> Array:
    """Inverse kinematics of the ideal machine: slider heights that the controller computes for tool positions.

    Source: Pythagoras, b = height of the foot of the perpendicular from platform joint to rail + side sqrt(L^2 - d^2),
    d the length of that perpendicular.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm.

    Returns:
        (n, 3) mm, NaN where a link is too short to reach its rail.
    """
    joint = tool[:, None, :] + drawing.platform_radius * drawing.outward  # shape: (n, leg, xyz)
    reach = joint - drawing.pivot
    along = np.einsum("nlx,lx->nl", reach, drawing.rail)
    distance = np.linalg.norm(reach - along[..., None] * drawing.rail, axis=-1)
    with np.errstate(invalid="ignore"):
        drop = np.sqrt(drawing.link**2 - distance**2)
    return drawing.home + along + drawing.side * drop


def can_reach(drawing: Drawing, tool: Array) -> Array:
    """Whether tool positions lie within reach of the links and inside the sliders' travel.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm.

    Returns:
        (n,) bool.
    """
    height = nominal_sliders(drawing, tool)
    inside: Array = (height > drawing.travel[0]) & (height < drawing.travel[1])
    return np.asarray(inside.all(axis=1))
