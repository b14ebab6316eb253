"""The platform under load: drives and links yield, joint clearances change side, the column bends."""

from dataclasses import replace

import numpy as np

from ptt.rig import odd
from ptt.rig.legs import build_legs, guide_wander
from ptt.rig.nominal import Array, Drawing
from ptt.rig.odd_schema import Hose
from ptt.rig.odd_state import SliderState
from ptt.rig.platform import Pose, link_tension, solve_platform
from ptt.rig.rig import Rig
from ptt.rig.schedule import Schedule
from ptt.rig.schema import Geometry
from ptt.rig.thermal import Temperatures
from ptt.rig.units import GRAVITY, MM_PER_UM, PPM


def nominal_tool(drawing: Drawing, slider: Array) -> Array:
    """Forward kinematics of the ideal machine.

    Args:
        drawing: the ideal machine.
        slider: (n, 3) mm, slider heights.

    Returns:
        (n, 3) mm, tool positions.

    Raises:
        WorkspaceError: the sliders of some rows stand too far apart.
    """
    rows = len(slider)
    still = np.zeros(rows)
    legs = build_legs(
        drawing,
        Geometry(),
        slider,
        wander=np.zeros((rows, 3, 2)),
        bend=np.zeros((rows, 3, 3)),
        growth=(still, still, still),
        stretch=np.zeros((rows, 3)),
    )
    # The start: on the machine's axis, below (or above) the sliders by as much as at p = 0.
    middle = np.column_stack([np.zeros((rows, 2)), (slider - drawing.home).mean(1)])
    return solve_platform(legs, middle).position


def load_platform(
    rig: Rig,
    drawing: Drawing,
    schedule: Schedule,
    temperatures: Temperatures,
    slider: Array,
    tool: Array,
    state: SliderState,
) -> tuple[Pose, Array, Array]:
    """Solve the platform without load, let drives, links and joints yield to the load, and solve it again.

    Source: static balance of the link forces under the weight of payload and platform, gravity along -z, and the pull
    of hoses. A slider yields by its compliance times the force of the weight along its rail, and to a hose by that of
    the hose; a link lengthens by compliance times its tension, and by half its joints' clearance where it is pulled
    (shortens where it is pushed).

    Args:
        rig: faults of geometry and structure.
        drawing: the ideal machine.
        schedule: the rows and their payload.
        temperatures: of room, frame and screws.
        slider: (n, 3) mm, heights without load.
        tool: (n, 3) mm, commanded tool positions to start from.
        state: the run, which faults outside the library depend on.

    Returns:
        The poses, the slider heights under load (n, 3) mm, and the forces of the links on the sliders along the rails,
        (n, 3) N, positive upwards.

    Raises:
        WorkspaceError: the chains of some rows cannot be closed.
    """
    weight = GRAVITY * (schedule.payload + rig.spec.platform_mass_kg)
    down = np.column_stack([np.zeros((schedule.rows, 2)), -weight])
    stretch = np.zeros_like(slider)
    pose = _solve(rig, drawing, schedule, temperatures, slider, stretch, tool, state)
    loaded = slider
    for _ in range(2):  # drives yield by micrometres: forces of a second round change nothing that can be measured
        tension = link_tension(pose, down)
        yielding = np.asarray(rig.drive.compliance_um_per_n) * tension * _cosine(drawing, pose)
        for hose in (item for item in rig.odd if isinstance(item, Hose)):
            pull = link_tension(pose, odd.hose_force(hose, pose.position))
            yielding = yielding + np.asarray(hose.compliance_um_per_n) * pull * _cosine(drawing, pose)
            tension = tension + pull
        compliance, clearance = rig.geometry.link_compliance_um_per_n, rig.geometry.clearance_um
        force = tension * _cosine(drawing, pose)
        if not (yielding.any() or any(compliance) or any(clearance)):
            return pose, slider, force
        loaded = slider + MM_PER_UM * yielding
        side = np.sign(np.round(tension, 9))  # an unloaded joint, but for rounding, is in the middle of its clearance
        stretch = MM_PER_UM * (np.asarray(compliance) * tension + 0.5 * np.asarray(clearance) * side)
        pose = _solve(rig, drawing, schedule, temperatures, loaded, stretch, tool, state)
    return pose, loaded, force


def _solve(
    rig: Rig,
    drawing: Drawing,
    schedule: Schedule,
    temperatures: Temperatures,
    slider: Array,
    stretch: Array,
    start: Array,
    state: SliderState,
) -> Pose:
    spec, thermal = rig.spec, rig.thermal
    shifts = odd.odd_shifts(rig.odd, replace(state, joint=slider))
    height = slider + shifts.slider[..., 0]
    warm = PPM * (temperatures.frame - spec.reference_temp_c)
    legs = build_legs(
        drawing,
        rig.geometry,
        height,
        wander=guide_wander(spec, rig.geometry, height) + shifts.slider[..., 1:],
        bend=_bend(rig, drawing, schedule.payload, height),
        growth=(thermal.frame_um_per_m_k * warm, thermal.platform_um_per_m_k * warm, thermal.link_um_per_m_k * warm),
        stretch=stretch + shifts.link,
    )
    return solve_platform(legs, start, rig.source)


def _bend(rig: Rig, drawing: Drawing, payload: Array, slider: Array) -> Array:
    """Shift of each slider by the bent column, (n, 3, 3) mm.

    Source: a cantilever under an end moment, whose deflection grows with the square of the height above its foot. The
    rig states it at p = 0; without `column_per_slider` all sliders shift alike, by their mean height.
    """
    structure = rig.structure
    above_home = slider - drawing.home
    if not structure.column_per_slider:
        above_home = np.broadcast_to(above_home.mean(1, keepdims=True), slider.shape)
    lever = (1.0 + above_home / structure.column_height_mm) ** 2
    push = MM_PER_UM * payload[:, None] * lever  # shape: (n, leg)
    return push[..., None] * np.array([*structure.column_bend_um_per_kg, 0.0])


def _cosine(drawing: Drawing, pose: Pose) -> Array:
    """Cosine between each link, towards the platform, and its rail, upwards, (n, 3)."""
    return np.einsum("nlx,lx->nl", pose.link, drawing.rail)
