"""Faults of virtual arms one by one: each moves the tool as its formula says, worked out here by other means."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from test_rig_arm import CRANE, MEASURED, NAMES, crane, poses, reading

from ptt.errors import InputError
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.arm_odd_schema import ArmLaw

GRAVITY = 9.80665
ZIGZAG = np.array([0.0, 0.1, 0.3, 0.25, 0.1, 0.2, 0.4, 0.05])
WAY = np.array([1, 1, 1, -1, -1, 1, 1, -1])  # of arrival; a run is led in


def swing(values: np.ndarray, **sections: object) -> np.ndarray:
    """By how much joint 1 of the crane is off, told by where its tool is seen: (n,) rad."""
    targets = poses(*((value, 0.0, 0.0) for value in values))
    for key in ("payload_kg",):
        if key in sections:
            targets[key] = sections.pop(key)
    read = reading(crane(**sections), targets)
    return np.arctan2(read[:, 1], read[:, 0]) - values


def lift(values: np.ndarray, payload: object = 0.0, **sections: object) -> np.ndarray:
    """By how much joint 2 of the crane, its links in line, is off: (n,) rad."""
    read = reading(crane(**sections), poses(*((0.0, value, 0.0) for value in values), payload_kg=payload))
    return np.arctan2(read[:, 2] - 500.0, read[:, 0]) - values


def odd(kind: str, joint: int = 1, **values: object) -> dict:
    return {"odd": [{"kind": kind, "joint": joint, **values}]}


# --- what the library has, too -------------------------------------------------------------------------------------


def test_a_controller_that_adds_play_is_ahead_by_half_of_it() -> None:
    off = swing(ZIGZAG, arm={"added_mrad": [2.0, 0.0, 0.0]})
    np.testing.assert_allclose(off, 1e-3 * WAY, atol=1e-12)
    both = swing(ZIGZAG, arm={"added_mrad": [2.0, 0.0, 0.0], "backlash_mrad": [2.0, 0.0, 0.0]})
    np.testing.assert_allclose(both, 0.0, atol=1e-12)


def test_a_wound_up_joint_changes_over_by_an_exponential() -> None:
    off = swing(ZIGZAG, arm={"windup_urad": [50.0, 0.0, 0.0], "windup_length_mrad": [80.0, 1.0, 1.0]})
    late, want = -50e-6, [-50e-6]
    for step in np.diff(ZIGZAG):
        goal = -50e-6 * np.sign(step)
        late = goal + (late - goal) * np.exp(-abs(step) / 0.08)
        want.append(late)
    np.testing.assert_allclose(off, want, atol=1e-9)  # led in over twelve lengths of it


def test_zeros_that_slip_and_joints_that_turn_too_far() -> None:
    slip = swing(ZIGZAG, arm={"slip_mrad": [0.3, 0.0, 0.0], "slip_row": 3})
    np.testing.assert_allclose(slip, 3e-4 * (np.arange(8) >= 3), atol=1e-12)
    np.testing.assert_allclose(swing(ZIGZAG, arm={"scale_urad_per_rad": [200.0, 0.0, 0.0]}), 2e-4 * ZIGZAG, atol=1e-12)


def test_an_uneven_ring_is_a_sum_of_its_harmonics() -> None:
    sizes, phases = [[30.0, 0.0, 12.0], [0.0] * 3, [0.0] * 3], [[0.4, 0.0, 1.1], [0.0] * 3, [0.0] * 3]
    arm = {"ring_urad": sizes, "ring_phase_rad": phases, "turn_urad": [9.0, 0.0, 0.0], "turn_harmonic": 50}
    want = 30.0 * np.cos(ZIGZAG - 0.4) + 12.0 * np.cos(3.0 * ZIGZAG - 1.1) + 9.0 * np.cos(50.0 * ZIGZAG)
    np.testing.assert_allclose(swing(ZIGZAG, arm=arm), 1e-6 * want, atol=1e-12)


def any_chain(machine: dict, beta: list[float], row: np.ndarray) -> np.ndarray:
    """Tool of a drawing of either convention with a turn about y behind each twist, by rotations of one point back."""
    point = np.array(machine.get("tool_mm", [0.0, 0.0, 0.0]))
    for link, lean, value in reversed(list(zip(machine["joint"], beta, row, strict=True))):
        a, alpha, d = (link.get(key, 0.0) for key in ("a_mm", "alpha_deg", "d_mm"))

        def about_z(p: np.ndarray, value: float = value, d: float = d) -> np.ndarray:
            return Rotation.from_euler("z", value).apply(p) + np.array([0.0, 0.0, d])

        def along_x(p: np.ndarray, a: float = a, alpha: float = alpha, lean: float = lean) -> np.ndarray:
            turned = Rotation.from_euler("x", alpha, degrees=True).apply(Rotation.from_euler("y", lean).apply(p))
            return turned + np.array([a, 0.0, 0.0])

        point = about_z(along_x(point)) if machine["convention"] == "standard" else along_x(about_z(point))
    return point


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_axes_that_are_not_parallel_turn_what_comes_behind(convention: str) -> None:
    machine = {**CRANE, "convention": convention, "tool_mm": [20.0, 5.0, 60.0]}
    q = np.random.default_rng(2).uniform(-0.5, 0.5, (6, 3))
    rig = parse_rig({"machine": machine, "arm": {"link_beta_mrad": [0.0, 1.5, 0.0]}})
    want = [any_chain(machine, [0.0, 1.5e-3, 0.0], row) for row in q]
    np.testing.assert_allclose(reading(rig, pd.DataFrame(q, columns=NAMES)), want, atol=1e-9)


def test_offsets_of_another_material_grow_by_their_own() -> None:
    room = {"room": {"start_c": 30.0}}
    arm = {"growth_um_per_m_k": 10.0, "offset_growth_um_per_m_k": 3.0}
    read = reading(crane(arm=arm, conditions=room), poses((0.0, 0.0, 0.0)))[0]
    np.testing.assert_allclose(read, [700.0 * (1.0 + 1e-4), 0.0, 500.0 * (1.0 + 3e-5)], atol=1e-9)


def test_each_run_is_led_in_and_its_mount_is_put_on_anew() -> None:
    arm = {"backlash_mrad": [2.0, 0.0, 0.0]}
    cycles = {"cycles": 2, "run_per_cycle": True}
    rig, targets = crane(arm=arm, conditions=cycles), poses((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.1, 0.0, 0.0))
    read = reading(rig, targets)
    off = np.arctan2(read[:, 1], read[:, 0]) - np.tile([0.0, 0.2, 0.1], 2)
    np.testing.assert_allclose(off, 1e-3 * np.tile([-1, -1, 1], 2), atol=1e-12)
    loose = crane(seed=4, arm={"reflector_scatter_mm": 0.5}, conditions=cycles)
    moved = reading(loose, targets) - reading(crane(conditions=cycles), targets)
    hands = [Rotation.from_euler("ZX", [value, np.pi / 2]) for value in [0.0, 0.2, 0.1] * 2]
    inside = [hand.inv().apply(way.copy()) for hand, way in zip(hands, moved, strict=True)]
    np.testing.assert_allclose(inside[:3], np.tile(inside[0], (3, 1)), atol=1e-9)
    np.testing.assert_allclose(inside[3:], np.tile(inside[3], (3, 1)), atol=1e-9)
    assert np.linalg.norm(inside[0] - inside[3]) > 0.1


# --- what the library has not --------------------------------------------------------------------------------------


def test_a_joint_that_hardens() -> None:
    """Links in line, 700 mm long: gravity turns joint 2 by -m g 700 cos(q) N mm."""
    values = np.array([0.0, 0.4, -0.6, 0.8])
    load = [0.0, 5.0, 0.0, 5.0]
    off = lift(values, load, **odd("hardening-joint", 2, size_urad=300.0, half_nmm=8000.0, hand_kg=2.0))
    torque = -(np.array(load) + 2.0) * GRAVITY * 700.0 * np.cos(values)
    np.testing.assert_allclose(off, 3e-4 * torque / (8000.0 + np.abs(torque)), atol=1e-9)


def test_friction_grows_with_the_load() -> None:
    off = lift(ZIGZAG, 3.0, **odd("loaded-friction", 2, urad_per_nmm=0.004, hand_kg=1.0))
    torque = 4.0 * GRAVITY * 700.0 * np.cos(ZIGZAG)
    np.testing.assert_allclose(off, -4e-9 * torque * WAY, atol=1e-9)


def test_a_damaged_tooth_is_a_bump_once_a_turn() -> None:
    values = np.array([-0.5, 0.1, 0.2, 0.3, 0.9])
    off = swing(values, **odd("damaged-tooth", angle_rad=0.2, width_rad=0.05, size_urad=80.0))
    np.testing.assert_allclose(off, 8e-5 * np.exp(-0.5 * ((values - 0.2) / 0.05) ** 2), atol=1e-11)
    again = swing(values, **odd("damaged-tooth", angle_rad=0.2 + 0.7, width_rad=0.05, size_urad=80.0, turn_rad=0.7))
    near = (values - 0.2 + 0.35) % 0.7 - 0.35
    np.testing.assert_allclose(again, 8e-5 * np.exp(-0.5 * (near / 0.05) ** 2), atol=1e-11)


def test_a_tool_slips_along_its_own_axes() -> None:
    """The hand of the crane, links in line and level: x outwards, y up, z sideways to the right."""
    rig = crane(odd=[{"kind": "slipping-tool", "shift_um": [10.0, 20.0, 30.0], "share": 0.5}])
    read = reading(rig, poses((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.0)))
    sound = reading(crane(), poses((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.0)))
    moved = read - sound
    np.testing.assert_allclose(moved[:2], 0.0, atol=1e-12)
    np.testing.assert_allclose(moved[2:], 1e-3 * np.array([[30.0, 10.0, 20.0], [10.0, -30.0, 20.0]]), atol=1e-9)


@pytest.mark.parametrize("gravity", [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
def test_a_base_rocks_towards_the_load(gravity: list[float]) -> None:
    machine = {**CRANE, "gravity": gravity}
    rig = parse_rig({"machine": machine, "odd": [{"kind": "rocking-base", "nrad_per_nmm": 2.0, "moving_kg": 8.0}]})
    targets = poses((0.3, 0.4, -0.2), (1.2, -0.3, 0.5), payload_kg=[0.0, 4.0])
    sound, read = reading(parse_rig({"machine": machine}), targets), reading(rig, targets)
    for place, here, mass in zip(sound, read, (8.0, 12.0), strict=True):
        moment = np.cross(place, mass * GRAVITY * np.array(gravity))
        np.testing.assert_allclose(here, Rotation.from_rotvec(2e-9 * moment).apply(place.copy()), atol=1e-9)
    if gravity[2]:
        assert read[0, 2] < sound[0, 2]


def test_an_axis_wobbles_some_times_a_turn() -> None:
    values = np.array([0.0, 0.4, 1.0, -0.7])
    rig = crane(**odd("wobbling-axis", size_urad=100.0, times=3, phase_rad=0.5))
    targets = poses(*((value, 0.0, 0.0) for value in values))
    moved = reading(rig, targets) - reading(crane(), targets)
    phase = 3.0 * values - 0.5
    lean = 1e-4 * np.column_stack([np.cos(phase), np.sin(phase), np.zeros(4)])
    place = reading(crane(), targets)
    np.testing.assert_allclose(moved, np.cross(lean, place), atol=1e-5)


def test_cables_drag_against_the_travel() -> None:
    off = swing(ZIGZAG, **odd("dress-pack", low_rad=0.4, high_rad=0.0, size_urad=60.0))
    np.testing.assert_allclose(off, -6e-5 * (0.4 - ZIGZAG) / 0.4 * WAY, atol=1e-11)


def test_belts_and_counts() -> None:
    belt = swing(ZIGZAG, **odd("belt-resonance", size_urad=40.0, period_rad=0.33, phase_rad=1.0))
    np.testing.assert_allclose(belt, 4e-5 * np.cos(2.0 * np.pi * ZIGZAG / 0.33 - 1.0), atol=1e-11)
    values = np.array([0.0, 0.1001, 0.1004, 0.1006, -0.2003])
    off = swing(values, **odd("rounding-controller", step_urad=1000.0))
    np.testing.assert_allclose(values + off, [0.0, 0.1, 0.1, 0.101, -0.2], atol=1e-11)


def test_joints_that_are_warm_or_busy() -> None:
    """Temperature in closed form: the room's own, and behind it by a lag of its own."""
    room = {"start_c": 20.0, "rise_k": 6.0, "time_constant_s": 200.0}
    conditions = {"dwell_s": 10.0, "feed_mm_s": 1e6, "room": room}
    values = 0.2 * (np.arange(60) % 2)
    time = 10.0 * np.arange(1, 61)
    air = 6.0 * -np.expm1(-time / 200.0)
    off = swing(values, **odd("warm-joint", urad_per_k=15.0), conditions=conditions)
    np.testing.assert_allclose(off, 15e-6 * (air - air[0]), atol=1e-8)
    late = swing(values, **odd("warm-joint", urad_per_k=15.0, constant_s=100.0), conditions=conditions)
    start, since = 20.0 + air[0], time - time[0]
    follows = 26.0 - start - (26.0 - start) * (2.0 * np.exp(-since / 200.0) - np.exp(-since / 100.0))
    np.testing.assert_allclose(late, 15e-6 * follows, atol=1e-6)
    busy = swing(values, **odd("busy-joint", urad_s_per_rad=3000.0, constant_s=90.0), conditions=conditions)
    np.testing.assert_allclose(busy, 3e-3 * 0.02 * -np.expm1(-since / 90.0), rtol=1e-3, atol=1e-9)


def test_wrists_that_run_on_one_another() -> None:
    targets = poses((0.1, 0.0, 0.2), (0.1, 0.0, -0.4), (0.3, 0.0, 0.5))
    rig = crane(**odd("coupled-joints", other=3, angle_rad=0.1, span_rad=0.5, size_urad=70.0))
    read = reading(rig, targets)
    off = np.arctan2(read[:, 1], read[:, 0]) - [0.1, 0.1, 0.3]
    np.testing.assert_allclose(off, -7e-5 * ((np.array([0.2, -0.4, 0.5]) - 0.1) / 0.5) ** 2, atol=1e-11)


def test_play_that_a_load_opens_and_a_coupling_that_loses() -> None:
    fault = odd("loaded-play", urad_per_kg=100.0, opens_at_kg=1.0)
    np.testing.assert_allclose(swing(ZIGZAG, **fault, payload_kg=5.0), -2e-4 * WAY, atol=1e-12)
    np.testing.assert_allclose(swing(ZIGZAG, **fault, payload_kg=1.0), 0.0, atol=1e-12)
    loss = swing(ZIGZAG, **odd("loss-at-reversal", urad_per_reversal=5.0))
    np.testing.assert_allclose(loss, -5e-6 * np.array([0, 0, 0, 1, 1, 2, 2, 3]), atol=1e-12)


# --- random laws ---------------------------------------------------------------------------------------------------


def law(**changes: object) -> ArmLaw:
    usual = {
        "kind": "arm-law", "place": "joint", "joint": 2, "form": "smooth", "variables": ["q1", "direction3"],
        "span": [[-1.0, 1.0], [-1.0, 1.0]], "size": 20.0, "law_seed": 5,
    }  # fmt: skip
    return ArmLaw.model_validate(usual | changes)


# --- files ---------------------------------------------------------------------------------------------------------


def test_rigs_with_faults_of_arms_read_back() -> None:
    rig = crane(
        arm={"ring_urad": [[1.0, 2.0]] * 3, "slip_mrad": [0.1, 0.0, 0.0], "slip_row": 2, "added_mrad": [0.0, 0.2, 0.0]},
        odd=[law().model_dump(exclude_none=True), {"kind": "rocking-base", "nrad_per_nmm": 1.0}],
    )
    assert parse_rig(format_rig(rig)) == rig
    frame = simulate(rig, poses(*np.random.default_rng(0).uniform(-1, 1, (6, 3))), noise=False).frame
    assert np.isfinite(frame[MEASURED].to_numpy()).all()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (
            {"kind": "splice", "leg": 1, "height_mm": 3, "step_um": 5},
            "'splice' is not a fault of a machine of kind 'serial'",
        ),
        ({"kind": "rounding-controller", "joint": 4, "step_urad": 5.0}, "joint 4 of an arm of 3 joints"),
        ({"kind": "coupled-joints", "joint": 1, "other": 5, "angle_rad": 0, "span_rad": 1, "size_urad": 1}, "other 5"),
        (law(variables=["q9"], span=[[0, 1]]).model_dump(exclude_none=True), "no variable 'q9'"),
        (law(variables=["q4"], span=[[0, 1]]).model_dump(exclude_none=True), "no variable 'q4'"),
    ],
)
def test_faults_that_an_arm_cannot_have_are_refused(fault: dict, words: str) -> None:
    with pytest.raises(InputError) as caught:
        crane(odd=[fault])
    assert re.search(re.escape(words), str(caught.value)), str(caught.value)


def test_a_slider_machine_takes_no_fault_of_an_arm() -> None:
    machine = {"kind": "three-ptt", "base_radius_mm": 200.0, "platform_radius_mm": 100.0, "link_length_mm": 300.0}
    machine["slider_travel_mm"] = [150.0, 420.0]
    with pytest.raises(InputError, match="'belt-resonance' is not a fault of a machine of kind 'three-ptt'"):
        parse_rig({"machine": machine, **odd("belt-resonance", size_urad=1.0, period_rad=0.1)})
