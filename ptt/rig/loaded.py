"""The platform of a real machine under its load: drives give way, joint play takes sides, the column bends."""

from dataclasses import replace

import numpy as np

from ptt.rig import odd
from ptt.rig.legs import build_legs, guide_wander
from ptt.rig.nominal import Array, Drawing
from ptt.rig.odd_schema import Hose
from ptt.rig.odd_state import RunState
from ptt.rig.platform import Pose, link_tension, solve_platform
from ptt.rig.rig import Rig
from ptt.rig.schedule import Schedule
from ptt.rig.schema import Geometry
from ptt.rig.thermal import Temperatures
from ptt.rig.units import GRAVITY, MM_PER_UM, PPM


def nominal_tool(drawing: Drawing, slider: Array) -> Array:
    """Tool positions of slider heights on the ideal machine.

    Args:
        drawing: the ideal machine.
        slider: (n, 3) mm.

    Returns:
        (n, 3) mm.
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
    # A first guess: on the machine's axis, at its usual depth under (or over) the sliders.
    middle = np.column_stack([np.zeros((rows, 2)), (slider - drawing.home).mean(1)])
    return solve_platform(legs, middle).position


def load_platform(
    rig: Rig,
    drawing: Drawing,
    schedule: Schedule,
    temperatures: Temperatures,
    slider: Array,
    tool: Array,
    state: RunState,
) -> tuple[Pose, Array, Array]:
    """Solve the platform, load it, let drives, links and joints give way, and solve it again.

    Source: static balance of the link forces; a slider yields by compliance times the force along its rail, a link
    grows by compliance times its tension.

    Args:
        rig: faults of geometry and structure.
        drawing: the ideal machine.
        schedule: the rows and their payload.
        temperatures: of room, frame and screws.
        slider: (n, 3) mm, heights without load.
        tool: (n, 3) mm, commanded tool positions to start from.
        state: what faults outside the library depend on.

    Returns:
        The pose, the loaded slider heights (n, 3) mm, the forces along the rails (n, 3) N.
    """
    weight = GRAVITY * (schedule.payload + rig.spec.platform_mass_kg)
    down = np.column_stack([np.zeros((schedule.rows, 2)), -weight])
    stretch = np.zeros_like(slider)
    pose = _solve(rig, drawing, schedule, temperatures, slider, stretch, tool, state)
    given = slider
    for _ in range(2):  # the give is micrometres: a second look at the forces changes nothing that can be measured
        pull = link_tension(pose, down)
        along = pull * _cosine(drawing, pose)
        give = np.asarray(rig.drive.compliance_um_per_n) * along
        total = pull
        for hose in (item for item in rig.odd if isinstance(item, Hose)):
            tug = link_tension(pose, odd.hose_force(hose, pose.position))
            give = give + np.asarray(hose.compliance_um_per_n) * tug * _cosine(drawing, pose)
            total = total + tug
        soft, loose = np.asarray(rig.geometry.link_compliance_um_per_n), np.asarray(rig.geometry.clearance_um)
        force = total * _cosine(drawing, pose)
        if not (give.any() or soft.any() or loose.any()):
            return pose, slider, force
        given = slider + MM_PER_UM * give
        stretch = MM_PER_UM * (soft * total + 0.5 * loose * np.sign(np.round(total, 9)))
        pose = _solve(rig, drawing, schedule, temperatures, given, stretch, tool, state)
    return pose, given, force


def _solve(
    rig: Rig,
    drawing: Drawing,
    schedule: Schedule,
    temperatures: Temperatures,
    slider: Array,
    stretch: Array,
    start: Array,
    state: RunState,
) -> Pose:
    spec, thermal = rig.spec, rig.thermal
    shifts = odd.odd_shifts(rig.odd, replace(state, slider=slider))
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
    """Shift of each slider by its bent column, (n, 3, 3) mm.

    Source: a cantilever under an end moment, deflection proportional to the square of the height above its foot.
    """
    structure = rig.structure
    above_home = slider - drawing.home
    if not structure.column_per_slider:
        above_home = np.broadcast_to(above_home.mean(1, keepdims=True), slider.shape)
    lever = (1.0 + above_home / structure.column_height_mm) ** 2
    push = MM_PER_UM * payload[:, None] * lever  # shape: (n, leg)
    return push[..., None] * np.array([*structure.column_bend_um_per_kg, 0.0])


def _cosine(drawing: Drawing, pose: Pose) -> Array:
    return np.einsum("nlx,lx->nl", pose.link, drawing.rail)
