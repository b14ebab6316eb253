"""Targets in a frame of their own: found from the commands, kept, and undone before anything is sent to the machine."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from command_line import invoke
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ptt.effects import library
from ptt.errors import TableError
from ptt.fitting.solve import fit
from ptt.machine import format_machine, load_machine, parse_machine, save_machine
from ptt.machine_schema import TargetsSpec, TrackerSpec
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.plan.again import plan_again
from ptt.plan.separation import plan_separation
from ptt.rig import parse_rig, simulate, write_run
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import concat_tables, make_table
from ptt.run.target_frame import find_frame, kept_frame

DATA = Path(__file__).resolve().parents[1] / "data"
FILE = replace(load_machine(DATA / "machine.toml"), tracker=TrackerSpec(sigma_mm=0.004), text="")
DRIVE = {"homing_mm": [0.3, -0.25, 0.1], "scale_um_per_m": [80.0, -60.0, 40.0]}
RIG = {"machine": FILE.machine.model_dump(), "seed": 3, "drive": DRIVE}
EFFECTS = ("homing-offset", "lead-scale")
ORIGIN = np.array([30.0, -20.0, 50.0])
TURNS = ((0.0, 0.0, 0.0), (0.0, 0.0, 30.0), (12.0, -25.0, 100.0))
CUBE = np.random.default_rng(8).uniform([-60, -60, -50], [60, 60, 50], (120, 3)).round(4)


def run_of(place: np.ndarray, sliders: np.ndarray | None = None) -> pd.DataFrame:
    """The rig's run, with targets and readings in the base frame."""
    path = pd.DataFrame(place, columns=["x_cmd", "y_cmd", "z_cmd"])
    sent = None if sliders is None else pd.DataFrame(sliders, columns=["b1", "b2", "b3"])
    return simulate(parse_rig(RIG), path, sliders=sent).frame


def moved(frame: pd.DataFrame, turn: tuple[float, ...], origin: np.ndarray = ORIGIN) -> pd.DataFrame:
    """The same as a controller and a tracker say it that count in a workpiece's frame."""
    rotation, out = Rotation.from_rotvec(turn, degrees=True).as_matrix(), frame.copy()
    for kind in ("cmd", "meas"):
        names = [f"{axis}_{kind}" for axis in "xyz"]
        if kind == "cmd" or names[0] in frame:
            out[names] = (frame[names].to_numpy() - origin) @ rotation
    return out


@pytest.fixture(scope="module")
def base() -> pd.DataFrame:
    return run_of(CUBE)


@pytest.fixture(scope="module")
def fitted(base, tmp_path_factory) -> pd.DataFrame:
    """Commands of a model that was fitted on the run in the base frame."""
    place = tmp_path_factory.mktemp("base")
    return predicted(place, base, base[["x_cmd", "y_cmd", "z_cmd"]])[0]


def predicted(place: Path, run: pd.DataFrame, targets: pd.DataFrame):
    """Fit on a run, then ask for commands: sliders.csv, the result of `add`, and that of `predict`."""
    save_machine(FILE, place / "m.toml")
    write_run(run, place / "run.csv")
    write_run(targets, place / "t.csv")
    words = ("add", place / "run.csv", *EFFECTS, "--model", place / "m.toml", "--out", place / "m2.toml", "--json")
    added = invoke(*words)
    assert added.exit_code == 0, added.stderr
    asked = invoke("predict", place / "t.csv", "--model", place / "m2.toml", "--out", place / "s.csv", "--json")
    assert asked.exit_code == 0, asked.stderr
    return pd.read_csv(place / "s.csv"), added, asked


@pytest.mark.parametrize("turn", TURNS)
def test_commands_for_targets_in_a_workpiece_frame_are_those_of_the_base_frame(base, fitted, tmp_path, turn):
    run = moved(base, turn)
    sliders, added, asked = predicted(tmp_path, run, run[["x_cmd", "y_cmd", "z_cmd"]])
    names = ["b1", "b2", "b3"]
    np.testing.assert_allclose(sliders[names], fitted[names], atol=1e-4)
    own = np.abs(sliders[names].to_numpy() - base[["b1_cmd", "b2_cmd", "b3_cmd"]].to_numpy()).max()
    assert 0.1 < own < 0.5  # mm, the size of the faults, not of the frame
    (told,) = json.loads(added.stdout)["target_frame"]
    np.testing.assert_allclose(told["origin_mm"], ORIGIN, atol=1e-3)
    np.testing.assert_allclose(told["turn_deg"], turn, atol=1e-4)
    assert "frame of their own" in added.stderr and "frame of their own" in asked.stderr
    assert json.loads(asked.stdout)["target_frame"][0]["source"] == "stated"


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_compare_and_diagnose_say_it_too(base, tmp_path, verb):
    save_machine(FILE, tmp_path / "m.toml")
    write_run(moved(base, TURNS[1]), tmp_path / "run.csv")
    result = invoke(verb, tmp_path / "run.csv", "--model", tmp_path / "m.toml", "--json")
    data = json.loads(result.stdout)
    np.testing.assert_allclose(data["target_frame"][0]["turn_deg"], TURNS[1], atol=1e-4)
    assert data["frame_taken"][0]["rms_mm"] > 30.0
    assert (
        "targets are stated in a frame" in result.stderr and "frame alignment shifted the readings by" in result.stderr
    )


@pytest.mark.parametrize("turn", TURNS[:2])
def test_a_corrected_run_is_not_taken_for_another_frame(base, fitted, tmp_path, turn):
    after = run_of(CUBE, fitted[["b1", "b2", "b3"]].to_numpy())
    write_run(after, tmp_path / "plain.csv")
    table = read_table(tmp_path / "plain.csv")
    assert np.abs(table.command - base[["b1_cmd", "b2_cmd", "b3_cmd"]].to_numpy()).max() > 0.1
    (frame,) = build_problem(FILE, table).stated_in
    assert frame.source == "base" and frame.doubt == 0.0
    write_run(moved(after, turn), tmp_path / "after.csv")
    stated = replace(FILE, targets=TargetsSpec(origin_mm=tuple(ORIGIN), turn_deg=turn))
    (kept,) = build_problem(stated, read_table(tmp_path / "after.csv")).stated_in
    assert kept.source == "stated" and 0.05 < kept.left < 1.5
    (found,) = build_problem(FILE, read_table(tmp_path / "after.csv")).stated_in
    np.testing.assert_allclose(found.origin, ORIGIN, atol=1.5)  # as near as the corrections let it be


@settings(max_examples=60, deadline=None)
@example(turn=[0.0, 0.0, 0.5], origin=[0.0, 0.5, 0.0], seed=0)
@given(
    turn=st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=3),
    origin=st.lists(st.floats(-300.0, 300.0), min_size=3, max_size=3),
    seed=st.integers(0, 1000),
)
def test_any_rigid_motion_is_found_and_undone(turn, origin, seed):
    rotation = Rotation.from_rotvec(turn, degrees=True).as_matrix()
    target = (CUBE - origin) @ rotation
    frame = find_frame(target, CUBE, TargetsSpec())
    apart = np.linalg.norm(frame.into_base(target) - CUBE, axis=1)  # small and even, it may as well be a correction
    assert np.median(apart) <= 1.0 if frame.source == "base" else apart.max() < 1e-6
    np.testing.assert_allclose(frame.as_stated(frame.into_base(target)), target, atol=1e-9)
    disturbed = CUBE + np.random.default_rng(seed).normal(0.0, 0.3, CUBE.shape)
    near = find_frame(target, disturbed, TargetsSpec())
    assert np.median(np.linalg.norm(near.into_base(target) - CUBE, axis=1)) < (5.5 if near.source == "base" else 0.5)


def test_what_no_rigid_motion_explains_is_refused():
    flat = CUBE * [1.0, 1.0, 0.0] + [0.0, 0.0, 20.0]
    for place, bad in (
        (CUBE, CUBE[:, [1, 0, 2]]),
        (CUBE, CUBE * [1, 1, -1]),
        (CUBE, 1.5 * CUBE),
        (flat, flat[:, [1, 0, 2]]),
    ):
        assert find_frame(bad, place, TargetsSpec()).source == "contrary"
    turned = flat @ Rotation.from_rotvec([0, 0, 150], degrees=True).as_matrix()
    assert find_frame(turned, flat, TargetsSpec()).source == "commands"  # in its plane, so nothing is mirrored


def test_a_small_rigid_motion_is_said_and_left_to_the_person():
    frame = find_frame(CUBE - [0.4, 0.0, 0.1], CUBE, TargetsSpec())
    assert frame.source == "base" and frame.doubt == pytest.approx(np.hypot(0.4, 0.1))
    told = find_frame(CUBE - [0.4, 0.0, 0.1], CUBE, TargetsSpec(origin_mm=(0.4, 0.0, 0.1)))
    assert told.source == "stated" and told.left < 1e-9
    slight = find_frame(CUBE @ Rotation.from_rotvec([0, 0, 2], degrees=True).as_matrix(), CUBE, TargetsSpec())
    assert slight.source == "commands"  # no correction turns the path by two degrees


def test_targets_without_commands_are_taken_as_the_model_keeps_them(base, tmp_path):
    write_run(moved(base, TURNS[2]).drop(columns=["b1_cmd", "b2_cmd", "b3_cmd"]), tmp_path / "run.csv")
    table = read_table(tmp_path / "run.csv")
    problem = build_problem(replace(FILE, targets=TargetsSpec(origin_mm=tuple(ORIGIN), turn_deg=TURNS[2])), table)
    np.testing.assert_allclose(problem.target, CUBE, atol=1e-9)
    np.testing.assert_allclose(problem.stated, table.target, atol=1e-9)
    np.testing.assert_allclose(problem.view.q, base[["b1_cmd", "b2_cmd", "b3_cmd"]], atol=1e-9)


def test_runs_in_two_frames_leave_the_frame_of_targets_open(base, tmp_path):
    for number, turn in enumerate(TURNS[:2]):
        write_run(moved(base, turn), tmp_path / f"run{number}.csv")
    both = read_table(tmp_path / "run0.csv", also=[tmp_path / "run1.csv"])
    per_run = replace(FILE, tracker=TrackerSpec(frame="fitted-per-run", sigma_mm=0.004))
    problem = build_problem(per_run, both)
    np.testing.assert_allclose(problem.target, np.tile(CUBE, (2, 1)), atol=1e-6)
    kept = kept_frame(FILE.targets, problem.stated_in)
    assert kept.frame == "unknown"
    with pytest.raises(TableError, match="in which frame are these targets stated"):
        build_problem(replace(FILE, targets=kept), make_table(CUBE, None, CUBE))
    alike = build_problem(per_run, concat_tables([read_table(tmp_path / "run0.csv")] * 2))
    assert kept_frame(FILE.targets, alike.stated_in).origin_mm == pytest.approx(tuple(ORIGIN), abs=1e-3)


def test_readings_in_the_frame_of_the_targets_are_no_trusted_ones(base, tmp_path):
    write_run(moved(base, TURNS[1]), tmp_path / "run.csv")
    with pytest.raises(TableError, match=r"trusted.*frame of the targets.*fitted"):
        build_problem(replace(FILE, tracker=TrackerSpec(frame="trusted")), read_table(tmp_path / "run.csv"))


def test_the_frame_is_kept_in_the_file_beside_a_persons_comments():
    text = "# mine\n" + format_machine(FILE) + "# the end\n"
    file = parse_machine(text)
    kept = replace(file, targets=TargetsSpec(origin_mm=(1.0, 2.0, 3.0), turn_deg=(0.0, 0.0, 4.0)))
    again = parse_machine(format_machine(kept))
    assert (
        again == kept
        and "# mine" in again.text
        and parse_machine(format_machine(replace(again, targets=TargetsSpec()))) == file
    )
    bare = replace(kept, text="")
    assert parse_machine(format_machine(bare)) == bare


def test_an_arms_targets_for_another_base_are_brought_back_and_for_another_tool_give_way():
    file = replace(load_machine(DATA / "machines" / "kuka_iiwa.toml"), tracker=TrackerSpec(sigma_mm=0.05))
    arm = build_mechanism(file.machine)
    q = torch.tensor(np.random.default_rng(1).uniform(-0.8, 0.8, (40, arm.joints)) + 0.3, dtype=torch.float64)
    place, turn = (part.numpy() for part in arm.pose(q))
    rotation = Rotation.from_rotvec(TURNS[2], degrees=True).as_matrix()
    base = build_problem(file, make_table((place - ORIGIN) @ rotation, q.numpy(), place, joint_prefix="q"))
    assert base.stated_in[0].source == "commands"
    np.testing.assert_allclose(base.target, place, atol=1e-6)
    tool = build_problem(file, make_table(place + turn @ [0.0, 30.0, 120.0], q.numpy(), place, joint_prefix="q"))
    assert tool.stated_in[0].source == "unknown"
    np.testing.assert_allclose(tool.target, tool.view.p.numpy(), atol=1e-9)


@pytest.mark.parametrize("spec", [{"origin_mm": (30.0, 20.0, 40.0), "turn_deg": (0.0, 0.0, 30.0)}, {}])
def test_a_plan_counts_targets_as_the_machine_file_states_them(tmp_path, spec):
    """What a plan of the bench drives is where the bench can go, in whatever frame its controller counts."""
    for name, file in (("plain", FILE), ("own", replace(FILE, targets=TargetsSpec(**spec)))):
        save_machine(file, tmp_path / f"{name}.toml")
        told = invoke("plan", tmp_path / f"{name}.toml", "--rows", 60, "--out", tmp_path / f"{name}.csv")
        assert ("under [targets]" in told.stdout) == (file.targets != TargetsSpec())
        words = ("--model", tmp_path / f"{name}.toml", "--out", tmp_path / f"{name}_sent.csv")
        assert invoke("predict", tmp_path / f"{name}.csv", *words).exit_code == 0
    plain, own = (pd.read_csv(tmp_path / f"{name}_sent.csv") for name in ("plain", "own"))
    names = ["b1", "b2", "b3", "dir1", "dir2", "dir3"]
    np.testing.assert_allclose(own[names], plain[names], atol=3e-4)


def test_poses_to_measure_next_are_counted_as_the_targets_of_the_run(base, tmp_path):
    """Of a run whose targets lie in a workpiece's frame, by its commands alone."""
    for name, run in (("plain", base), ("own", moved(base, TURNS[1]))):
        write_run(run, tmp_path / f"{name}.csv")
    problems = [build_problem(FILE, read_table(tmp_path / f"{name}.csv")) for name in ("plain", "own")]
    (frame,) = problems[1].stated_in
    assert frame.source == "commands"
    again = [plan_again(Model(FILE), problem) for problem in problems]
    model = Model(FILE) + library()["link-length"]()
    confused = (("link-length", "joint-offset"),)
    told = [plan_separation(fit(model, problem), problem, confused).targets for problem in problems]
    for plain, own in (again, told):
        np.testing.assert_allclose(frame.into_base(own.target), plain.target, atol=0.05)
