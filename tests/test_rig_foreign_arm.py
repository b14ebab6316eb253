"""Arms that nobody here built: drawings, runs, noise and hidden faults drawn by seed; sound means as drawn."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import serial_sweep
import torch
from serial_fresh import fresh_poses

from ptt.challenge.cases import VISIBLE, Case, draw, names_of, plan, protocols_of
from ptt.challenge.hide import ARM_FAULTS, clear_faults, hide_faults
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import mount_columns, without_set_up
from ptt.effects import library
from ptt.machine import format_machine, parse_machine
from ptt.mechanisms.serial import Serial
from ptt.model.model import Model
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.arm_odd_schema import SlippingTool
from ptt.rig.draw import DrawnRig
from ptt.rig.draw_arm_machine import FAMILIES, draw_arm_file, inverse_condition
from ptt.rig.draw_arm_odd import ARM_ODD, describable
from ptt.rig.draw_arm_paths import INSET, PATHS, draw_arm_plan, inverse
from ptt.rig.draw_foreign_arm import ARM_PROTOCOLS, ROWS, draw_foreign_arm
from ptt.rig.draw_noise import NOISES
from ptt.rig.motion import travel_direction
from ptt.rig.schedule import TARGET

MEASURED = ["x_meas", "y_meas", "z_meas"]
ARMS = [draw_arm_file(seed) for seed in range(40)]


def tool(spec, q: np.ndarray) -> np.ndarray:
    """Tool of a drawing by the library's own chain, which knows nothing of the rig's."""
    return Serial.from_spec(spec).forward(torch.tensor(q)).numpy()


# --- drawings ------------------------------------------------------------------------------------------------------


def test_drawings_are_of_all_kinds_and_can_be_written() -> None:
    specs = [arm.file.machine for arm in ARMS]
    assert {arm.family for arm in ARMS} == set(FAMILIES) and {spec.joints for spec in specs} == {4, 5, 6, 7}
    assert {spec.convention for spec in specs} == {"standard", "modified"}
    assert {arm.file.tracker.frame for arm in ARMS} == {"fitted", "trusted", "fitted-per-run", "measured"}
    assert {arm.file.tracker.tool for arm in ARMS} >= {"fitted", "trusted"}
    assert {spec.joint[0].mass_kg is None for spec in specs} == {True, False}
    assert {spec.gear_period_rad is None for spec in specs} == {True, False}
    ways = {tuple(spec.gravity) for spec in specs}
    assert {(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)} < ways and len(ways) > 4
    assert min(arm.reach_mm for arm in ARMS) < 600.0 and max(arm.reach_mm for arm in ARMS) > 2000.0
    assert all(parse_machine(format_machine(arm.file)) == arm.file for arm in ARMS)
    assert draw_arm_file(3).file == ARMS[3].file
    assert draw_arm_file(3, weighed=True).file.machine.joint[0].mass_kg is not None


@pytest.mark.parametrize("seed", range(0, 40, 4))
def test_runs_begin_from_postures_that_are_not_singular(seed: int) -> None:
    arm = ARMS[seed]
    assert (arm.low < arm.high).all() and inverse_condition(arm.file.machine, 0.5 * (arm.low + arm.high)[None])[
        0
    ] > 0.02


# --- runs ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PATHS)
def test_runs_have_about_the_rows_asked_for_and_stay_within_limits(path: str) -> None:
    for seed in range(2):
        drawn = draw_foreign_arm(seed, path=path, rows=150)
        frame = simulate(drawn.rig, drawn.targets, noise=False).frame  # refuses what is out of limits
        read = frame[frame["role"] == "pose"]["x_meas"].notna().sum()
        assert 60 <= read <= 210, (seed, read)


def commands(seed: int, path: str, rows: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Joints and places of a path."""
    table = draw_arm_plan(seed, ARMS[seed], rows, path).targets
    q = table[[f"q{joint + 1}_cmd_rad" for joint in range(ARMS[seed].file.machine.joints)]].to_numpy()
    return q, tool(ARMS[seed].file.machine, q)


@pytest.mark.parametrize("seed", range(3))
def test_the_poses_of_iso_9283_are_those_of_its_cube(seed: int) -> None:
    """P1 in the middle; P2 to P5 a rectangle of 1 to the root of 2, on a diagonal plane of a cube along the base."""
    for five in commands(seed, "iso-cube", 200)[1].reshape(-1, 5, 3):
        corners = five[1:] - five[0]
        np.testing.assert_allclose(corners.sum(axis=0), 0.0, atol=0.05)
        sides = np.linalg.norm(np.diff(corners[[0, 1, 2, 3, 0]], axis=0), axis=1)
        np.testing.assert_allclose(np.sort(sides)[2:] / np.sort(sides)[:2], np.sqrt(2.0), rtol=1e-3)
        np.testing.assert_allclose(np.abs(corners), np.abs(corners).mean(), atol=0.05)
        assert 0.0 < INSET < 0.5


@pytest.mark.parametrize("seed", range(3))
def test_lines_are_straight_and_rasters_flat(seed: int) -> None:
    _, raster = commands(seed, "raster", 100)
    flat = np.linalg.svd(raster - raster.mean(axis=0), compute_uv=False)
    assert flat[1] > 1.0 and np.unique(np.round(np.diff(raster, axis=0), 1), axis=0).shape[0] < 60
    _, places = commands(seed, "lines", 100)
    step = np.diff(places, axis=0)
    turn = np.linalg.norm(np.cross(step[1:], step[:-1]), axis=1)
    along = np.linalg.norm(step[1:], axis=1) * np.linalg.norm(step[:-1], axis=1)
    assert (turn < 2e-3 * along + 0.1).mean() > 0.75  # but where one line ends and another begins


def test_sweeps_move_one_joint_and_arrivals_come_from_the_sides_they_say() -> None:
    q, _ = commands(2, "one-joint", 120)
    assert ((np.abs(np.diff(q, axis=0)) > 0.0).sum(axis=1) <= 1).mean() > 0.8
    for path, sides in (("one-way", {1.0}), ("both-ways", {1.0, -1.0})):
        drawn = draw_foreign_arm(5, path=path, rows=60)
        sent = drawn.targets[drawn.rig.commanded].to_numpy()
        read = drawn.targets["read"].to_numpy() == 1
        ways = travel_direction(sent)[read]
        assert {way for row in ways for way in row} == sides
        assert (np.abs(ways.sum(axis=1)) == drawn.rig.serial.joints).all()


def test_an_inverse_is_found_or_said_not_to_be() -> None:
    spec = ARMS[0].file.machine
    home = 0.5 * (ARMS[0].low + ARMS[0].high)
    goal = tool(spec, (home + 0.05)[None])
    found = inverse(spec, home[None], goal)
    np.testing.assert_allclose(tool(spec, found), goal, atol=1e-5)
    assert np.isnan(inverse(spec, home[None], goal + 1e5)).all()


# --- sound arms ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", ARM_PROTOCOLS)
def test_a_sound_arm_is_as_drawn(protocol: str) -> None:
    for seed in range(2):
        drawn = draw_foreign_arm(seed, protocol, rows=60)
        result = simulate(drawn.rig, drawn.targets, noise=False)
        pose = (result.frame["role"] != "base").to_numpy()
        sent = result.frame[drawn.rig.commanded].to_numpy(float)[pose]
        np.testing.assert_allclose(result.truth[pose], tool(drawn.rig.serial, sent), atol=1e-8)
        np.testing.assert_allclose(result.frame[TARGET].to_numpy(float)[pose], result.truth[pose], atol=1e-8)
        assert parse_rig(format_rig(drawn.rig)) == drawn.rig and drawn.truth == {}
        varies = {name: result.frame[name].nunique() > 1 for name in ("payload_kg", "temp_c")}
        wanted = {"payload": "payload_kg", "warmup": "temp_c"}.get(protocol)
        assert varies == {name: name == wanted for name in varies}


def test_draws_repeat() -> None:
    one, two = draw_foreign_arm(9, "payload"), draw_foreign_arm(9, "payload")
    assert one.rig == two.rig and one.absent == two.absent and one.targets.equals(two.targets)
    assert one.rig != draw_foreign_arm(10, "payload").rig
    assert draw_foreign_arm(9, noise="heavy").rig.serial == one.rig.serial
    lengths = [len(draw_foreign_arm(seed, path="cloud").targets) for seed in range(30)]
    assert min(lengths) < 80 and max(lengths) > 300 and max(lengths) <= ROWS[1]
    for seed in range(12):
        case = plan("multi", 1, seed, arm=True)[0]
        assert case == plan("multi", 1, seed, arm=True)[0]
    first, second = draw(case)[0], draw(case)[0]
    assert first.rig == second.rig and first.truth == second.truth


@pytest.mark.parametrize("kind", NOISES)
def test_trackers_stand_outside_of_the_arm(kind: str) -> None:
    for seed in range(2):
        drawn = draw_foreign_arm(seed, noise=kind, rows=40)
        assert np.linalg.norm(drawn.rig.tracker.station_mm) > drawn.half_size[0] + 600.0
        assert np.isfinite(simulate(drawn.rig, drawn.targets).frame[MEASURED].to_numpy()).all(axis=1).mean() > 0.4


# --- faults --------------------------------------------------------------------------------------------------------


def test_all_that_the_library_has_of_arms_can_be_hidden() -> None:
    called = {ARM_FAULTS[name].called for name in names_of("single", arm=True)}
    ours = {name for name, effect in library().items() if "serial" in effect.mechanisms}
    assert called == ours - {"tracker-frame", "following-error"}  # what is always fitted; an arm is read standing
    assert not {fault.name for fault in ARM_ODD} & set(library())
    unseen = names_of("unknown", "unseen", arm=True)
    assert len(names_of("unknown", "shown", arm=True)) >= 10 and len(unseen) >= 10


@cache
def sound_of(protocol: str) -> tuple[DrawnRig, np.ndarray]:
    """A sound arm and what is read of it without noise."""
    drawn = draw_foreign_arm(3, protocol, path="cloud", rows=60, noise="white")
    return drawn, simulate(drawn.rig, drawn.targets, noise=False).frame[MEASURED].to_numpy()


@pytest.mark.parametrize("name", ARM_FAULTS)
def test_every_fault_moves_the_tool_and_is_taken_out_again(name: str) -> None:
    protocol = protocols_of(name, arm=True)[-1]
    sound, still = sound_of(protocol)
    drawn = hide_faults(sound, [name], 7)
    assert hide_faults(sound, [name], 7).rig == drawn.rig and drawn.rig != sound.rig
    assert clear_faults(drawn.rig, drawn.truth, [name]) == sound.rig
    assert parse_rig(format_rig(drawn.rig)) == drawn.rig
    moved = simulate(drawn.rig, drawn.targets, noise=False).frame[MEASURED].to_numpy()
    assert np.nanmax(np.abs(still - moved)) > 1e-3


def test_faults_are_drawn_until_they_can_be_seen_and_one_spring_is_not_hidden_twice() -> None:
    for level, number in (("single", 6), ("multi", 1), ("unknown", 15)):
        truth = draw(plan(level, 1, number, arm=True, rows=80)[0])[1]
        for fault in truth.faults:
            assert VISIBLE[0] * 0.8 < fault.size / truth.noise.total < VISIBLE[1] * 1.2, fault.name
    for case in plan("multi", 60, 0, arm=True):
        shared = [ARM_FAULTS[name].exclusive or ARM_FAULTS[name].called for name in case.faults]
        assert 2 <= len(shared) == len(set(shared)) <= 4


def test_laws_that_the_library_has_are_not_drawn() -> None:
    assert describable("joint", 2, "smooth", ["q2"]) and describable("joint", 2, "periodic", ["q2"])
    assert describable("joint", 2, "jumpy", ["direction2"]) and describable("sight", None, "smooth", ["time"])
    assert not describable("joint", 2, "jumpy", ["q2"]) and not describable("joint", 2, "smooth", ["q3"])
    assert not describable("lean", 2, "smooth", ["q2"]) and not describable("tool", None, "smooth", ["q2", "time"])


def test_what_a_mount_can_hold_is_no_size_of_a_fault() -> None:
    """A tool that has slipped from the first row on is a mount, whatever the way its tracker is turned."""
    arm = next(each for each in ARMS if each.file.tracker.tool == each.file.tracker.frame == "fitted")
    sound = draw_foreign_arm(4, path="cloud", rows=60, noise="white", arm=arm)
    slip = SlippingTool(kind="slipping-tool", shift_um=(50.0, -30.0, 80.0), share=0.0)
    moved = replace(sound, rig=replace(sound.rig, odd=(slip,)))
    here, there = (simulate(each.rig, each.targets, noise=False).frame[MEASURED].to_numpy() for each in (sound, moved))
    run, shift = np.zeros(len(here)), there - here
    assert np.abs(without_set_up(sound.rig, shift, here, run)).max() > 0.01
    np.testing.assert_allclose(without_set_up(sound.rig, shift, here, run, mount_columns(sound)), 0.0, atol=1e-6)


# --- closing the loop ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["cloud", "both-ways"])
def test_fresh_poses_lie_between_those_of_the_run(path: str) -> None:
    drawn = draw_foreign_arm(6, path=path, rows=50)
    fresh = fresh_poses(drawn, 1)
    one, two = (each.targets[drawn.rig.commanded].to_numpy() for each in (drawn, fresh))
    read = np.asarray(drawn.targets["read"] == 1) if "read" in drawn.targets else np.ones(len(one), dtype=bool)
    assert (two[read].min(axis=0) >= one[read].min(axis=0) - 1e-6).all()
    assert (two[read].max(axis=0) <= one[read].max(axis=0) + 1e-6).all()
    assert (np.abs(two[read] - one[read]).max(axis=1) > 1e-3).all()
    # The same poses are the same again.
    alike = [(each[:, None] == each[None]).all(axis=-1) for each in (one[read], two[read])]
    np.testing.assert_array_equal(*alike)
    assert fresh_poses(drawn, 1).targets.equals(fresh.targets)
    assert not fresh_poses(drawn, 2).targets.equals(fresh.targets)
    simulate(fresh.rig, fresh.targets, noise=False)


def test_a_whole_case() -> None:
    row = serial_sweep.run_arm(Case(1, "single", "volume", ("backlash",), "white", rows=90, arm=True))
    assert "error" not in row, row
    assert row["verdict"] in ("missing", "nothing-missing", "unknown") and set(row["hidden"]) == {"backlash"}
    assert row["named"] and "backlash" in row["named"][0], row["named"]
    tool = row["tool"]
    assert tool["after"] < tool["before"]
    assert 0.0 < tool["unforeseen"] < tool["rosy"]  # commands of a fit that was kept say how sure they are


@pytest.mark.parametrize("policy", ["trusted", "fitted", "measured"])
def test_what_stays_with_the_tool_counts_only_where_the_mount_is_known(policy: str) -> None:
    """A zero of the last joint turns a tool that stands off its axis: with a free mount no reading shows that."""
    drawn = next(one for one in (draw_foreign_arm(seed, path="cloud", rows=60) for seed in range(80))
                 if one.rig.machine.tracker.frame == policy and one.rig.machine.tracker.tool == "fitted")  # fmt: skip
    turned = tuple(np.eye(len(drawn.rig.sent))[-1])
    drawn = replace(drawn, rig=replace(drawn.rig, arm=drawn.rig.arm.model_copy(update={"link_theta_mrad": turned})))
    file = drawn.rig.machine
    known = replace(file, tracker=file.tracker.model_copy(update={"tool": "trusted", "frame": "trusted"}))
    free, held = (
        remeasure(Model(each), replace(drawn, rig=replace(drawn.rig, machine=each))).to_dict()["before"]["total"]
        for each in (file, known)
    )
    assert held > 5.0 and free < 0.05 * held
