"""Error reduction: matching, frames, z datum, and the figures of eq. 21."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.door.evaluating import measured
from ptt.errors import TableError
from ptt.judge.before_after import compare_pair
from ptt.judge.evaluate import evaluate_pair
from ptt.judge.evaluation import Evaluation, compare_errors
from ptt.judge.match import match_rows
from ptt.judge.run_errors import errors_of
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.run.noise import Noise
from ptt.run.table import make_table, take_rows
from ptt.run.written import write_table

DATA = Path(__file__).resolve().parents[1] / "data"
RANDOM = np.random.default_rng(5)
PLACES = np.column_stack([60 * np.cos(np.arange(40)), 60 * np.sin(np.arange(40)), np.arange(40.0)])
NAMES = np.array([f"p{number}" for number in range(40)])


def run(error, places=PLACES, **columns):
    return make_table(places, measured=places + error, **columns)


def turned(table, angle=0.02, shift=(5.0, -3.0, 2.0)):
    """The same readings in a tracker's frame."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    return table.replace(measured=table.measured @ turn.T + np.array(shift))


def test_the_figures_are_those_of_equation_21():
    before = np.tile([[0.2, -0.1, 0.05], [-0.4, 0.3, 0.15]], (3, 1))
    data = compare_errors(before, before * [0.05, 0.10, 0.21])
    x, y, z = data["axes"].values()
    assert x["before_um"] == pytest.approx(300.0) and x["after_um"] == pytest.approx(15.0)
    assert [axis["reduction_percent"] for axis in (x, y, z)] == pytest.approx([95.0, 90.0, 79.0])
    assert [axis["goal_percent"] for axis in (x, y, z)] == [90.0, 90.0, 80.0]
    assert [x["goal_met"], z["goal_met"]] == [True, False]
    assert data["total"]["before_um"] == pytest.approx(np.hypot(np.hypot(300, 200), 100))
    lengths = 1e3 * np.linalg.norm(before, axis=1)
    assert data["length"]["before_um"] == pytest.approx(lengths.mean())
    assert data["length"]["after_um"] == pytest.approx(1e3 * np.linalg.norm(before * [0.05, 0.10, 0.21], axis=1).mean())


def test_no_error_before_has_no_reduction():
    figures = compare_errors(np.zeros((4, 3)), np.ones((4, 3)))["axes"]["x"]
    assert figures["reduction_percent"] is None and not figures["goal_met"]


def test_rows_are_matched_by_name_in_any_order_and_the_rest_is_listed():
    order = RANDOM.permutation(40)[:35]
    before, after = run(0.1, name=NAMES), run(0.0, PLACES[order], name=NAMES[order])
    first, second, unmatched = match_rows(before, after, np.ones(40, dtype=bool), np.ones(35, dtype=bool))
    np.testing.assert_array_equal(order[second], first)
    assert len(unmatched["before"]) == 5 and unmatched["after"] == []
    assert all(name in " ".join(unmatched["before"]) for name in set(NAMES) - set(NAMES[order]))


def test_repeats_are_matched_by_their_order_and_poses_without_names_by_target():
    twice = np.concatenate([PLACES, PLACES])
    first, second, unmatched = match_rows(run(0.0, twice), run(0.0, twice[:50]), np.full(80, True), np.full(50, True))
    np.testing.assert_array_equal(first, second)
    assert len(first) == 50 and len(unmatched["before"]) == 30


def test_the_same_name_at_another_target_is_no_match():
    other = PLACES.copy()
    other[7] += 1.0
    usable = np.full(40, True)
    _, _, unmatched = match_rows(run(0.0, name=NAMES), run(0.0, other, name=NAMES), usable, usable)
    assert [text.split()[-1] for text in unmatched["before"] + unmatched["after"]] == ["p7", "p7"]


def test_a_noise_that_the_machine_file_states_tells_where_nothing_but_noise_is_left():
    file = load_machine(DATA / "machine.toml")
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.004, "frame": "trusted"}))
    random = np.random.default_rng(8)
    before, after = run(0.1 + random.normal(0.0, 0.004, (40, 3))), run(random.normal(0.0, 0.004, (40, 3)))
    assert evaluate_pair(before, after, file).to_dict()["rest_is_noise"] == {"x": True, "y": True, "z": True}
    assert evaluate_pair(before, before, file).to_dict()["rest_is_noise"] == {"x": False, "y": False, "z": False}


def test_a_noise_that_few_repeats_tell_is_not_held_against_the_rest():
    """Thirty degrees of freedom tell a scatter to an eighth: as often as not it comes out too small for the rest."""
    random, off = np.random.default_rng(9), 0
    for _ in range(200):
        noise = Noise(np.diag(random.chisquare(30.0, 3) / 30.0) * 1e-6, "repeats", 30.0)
        left = random.normal(0.0, 1e-3, (400, 3))
        told = Evaluation(left, left, {}, noise=noise)
        off += sum(not told.rest_is_noise(axis) for axis in range(3))
    assert off < 600 * 0.02  # three standard deviations, of a root of chi-squared that leans to the small side


def test_runs_without_a_pose_in_common_are_refused():
    with pytest.raises(TableError, match="no pose in common"):
        evaluate_pair(run(0.1), run(0.1, PLACES + 500.0))


def test_a_fitted_frame_takes_four_poses_in_common():
    other = np.concatenate([PLACES[:3], PLACES[3:] + 500.0])
    with pytest.raises(TableError, match=r"only 3 poses in common with .*; run both on the same targets.*4 poses"):
        evaluate_pair(run(0.1), run(0.1, other))
    assert evaluate_pair(run(0.1), run(0.1, other), frame="trusted").protocol["rows"] == 3


@pytest.mark.parametrize("frame", ["fitted", "trusted"])
def test_a_gross_reading_counts_and_is_said(frame):
    """Fifty millimetres are a broken beam; two are a fault of a machine, and so is what its like stand beside."""
    noise = 2e-3 * np.random.default_rng(3).normal(size=PLACES.shape)
    before, wild = run(0.05 * np.sin(PLACES)), noise.copy()
    wild[7, 0] += 50.0
    found = measured(before, run(wild), None, frame=frame)
    clean = measured(before, run(noise), None, frame=frame).to_dict()["axes"]["x"]["reduction_percent"]
    assert found.to_dict()["axes"]["x"]["reduction_percent"] < 0.0 < 50.0 < clean
    assert found.to_dict()["outlier_rows"] == {"after": [7]} and found.to_dict()["protocol"]["rows"] == 40
    assert any("gross readings count: " in one and "row 9; without them the error falls by 9" in one
               for one in found.warnings)  # fmt: skip
    faulty = noise.copy()
    faulty[7, 0] += 1.9
    faulty[20:22, 0] += 5.0
    assert not measured(before, run(faulty), None, frame=frame).to_dict()["outlier_rows"]
    twice = np.concatenate([PLACES, PLACES])
    worn = np.concatenate([noise, noise])
    worn[[7, 47], 2] += 9.0
    assert not measured(run(0.05, twice), run(worn, twice), None, frame=frame).to_dict()["outlier_rows"]


def test_a_run_after_that_is_far_worse_is_asked_about():
    noise = 2e-3 * np.random.default_rng(3).normal(size=PLACES.shape)
    before, after = run(0.05 * np.sin(PLACES)), run(noise)
    (said,) = [one for one in measured(after, before, None).warnings if "interchanged" in one]
    assert said.startswith("AFTER is worse than BEFORE") and said.endswith("are the two interchanged?")
    assert not [one for one in measured(before, after, None).warnings if "interchanged" in one]


def test_a_run_of_gross_readings_alone_is_evaluated_and_said():
    wild = np.zeros_like(PLACES)
    wild[[5, 25], 0] = 40.0
    found = measured(run(wild), run(wild[[5, 25]], PLACES[[5, 25]]), None, frame="trusted")
    assert found.to_dict()["protocol"]["rows"] == 2
    (said,) = [one for one in found.warnings if "gross readings count" in one]
    assert "without them" not in said


def test_a_fitted_frame_is_taken_from_each_run_alike():
    noise = 1e-3 * RANDOM.normal(size=PLACES.shape)
    before, after = turned(run(0.02 * noise * 1e3)), turned(run(noise), 0.05, (1.0, 2.0, 3.0))
    data = evaluate_pair(before, after).to_dict()
    assert data["axes"]["x"]["after_um"] < 2.0 and data["unaligned"]["axes"]["x"]["after_um"] > 500.0
    assert data["protocol"]["frame"].startswith("fitted") and data["protocol"]["measured"] is True


def test_a_trusted_frame_takes_nothing_away():
    data = evaluate_pair(run(0.2), run(0.01), frame="trusted").to_dict()
    assert data["axes"] == data["unaligned"]["axes"]
    assert data["axes"]["z"]["reduction_percent"] == pytest.approx(95.0)
    assert evaluate_pair(run(0.2), run(0.01)).to_dict()["axes"]["z"]["before_um"] == pytest.approx(0.0, abs=1e-6)


def test_z_from_the_first_point_hides_a_constant_error_in_both_runs():
    data = evaluate_pair(run([0.0, 0.0, 0.3]), run([0.0, 0.0, 0.2]), frame="trusted", z_datum="first").to_dict()
    assert data["axes"]["z"]["before_um"] == pytest.approx(0.0, abs=1e-9)
    assert data["protocol"]["z_datum"] == "first"
    kept = evaluate_pair(run([0.0, 0.0, 0.3]), run([0.0, 0.0, 0.2]), frame="trusted").to_dict()
    assert kept["axes"]["z"]["before_um"] == pytest.approx(300.0)


def test_too_few_poses_cannot_find_a_frame():
    with pytest.raises(TableError, match="too few poses"):
        errors_of(run(0.1, PLACES[:3]), None)


def test_a_measured_frame_comes_from_the_base_reflectors():
    file = load_machine(DATA / "machine.toml")
    points = np.array([point.xyz_mm for point in file.tracker.base_point])
    names = np.array([point.name for point in file.tracker.base_point])
    role = np.array(["base"] * len(points) + ["pose"] * 40)
    table = make_table(
        np.concatenate([np.full((len(points), 3), np.nan), PLACES]),
        measured=np.concatenate([points, PLACES + np.array([0.1, 0.2, 0.3])]),
        name=np.concatenate([names, NAMES]), role=role,
    )  # fmt: skip
    found = errors_of(turned(table), file)
    poses = found.aligned[role == "pose"]
    np.testing.assert_allclose(poses, np.tile([0.1, 0.2, 0.3], (40, 1)), atol=1e-6)
    assert np.isnan(found.aligned[role == "base"]).all()


def test_visits_to_the_base_between_poses_leave_the_noise_as_it_is():
    file = load_machine(DATA / "machine.toml")
    point = file.tracker.base_point[0]
    there = np.concatenate([PLACES, PLACES])  # each pose twice, reached from the same side
    readings = there + 0.003 * RANDOM.normal(size=there.shape)
    alone = make_table(there, measured=readings)
    visits = np.arange(3, 80, 7)
    role, name = np.insert(np.full(80, "pose"), visits, "base"), np.insert(np.full(80, ""), visits, point.name)
    among = make_table(
        np.insert(there, visits, np.nan, axis=0), measured=np.insert(readings, visits, point.xyz_mm, axis=0),
        role=role, name=name.astype(f"<U{len(point.name)}"),
    )  # fmt: skip
    without, beside = (errors_of(table, None, frame="trusted").noise for table in (alone, among))
    assert without.freedom == beside.freedom > 30
    np.testing.assert_allclose(beside.covariance, without.covariance, rtol=1e-9)


def words_of(tmp_path, before, after, *more):
    write_table(before, tmp_path / "b.csv")
    write_table(after, tmp_path / "a.csv")
    done = CliRunner().invoke(app, ["evaluate", str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), *more])
    assert done.exit_code == 0, done.stderr
    return done.stdout


def test_an_arm_without_a_machine_file_has_the_noise_of_its_readings(tmp_path):
    """An arm moves through poses a milliradian apart: what its command moves is no scatter of repeats."""
    command = np.repeat(np.linspace(0.0, 0.02, 60), 2)[:, None] * np.ones(6)
    place = 1000.0 * command[:, :3]
    before, after = (
        make_table(place, command, joint_prefix="q", measured=place + error + 0.01 * RANDOM.normal(size=(120, 3)))
        for error in (0.5, 0.02)
    )
    noise = evaluate_pair(before, after, frame="trusted").to_dict()["noise_um"]
    assert noise["x"] == pytest.approx(10.0, rel=0.2)
    for table, name in ((before, "b.csv"), (after, "a.csv")):
        write_table(table, tmp_path / name)
    told = CliRunner().invoke(app, ["evaluate", str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--json"])
    assert told.exit_code == 0 and json.loads(told.stdout)["noise_um"]["x"] < 12.0
    bare = before.replace(target=np.full_like(place, np.nan))
    write_table(bare, tmp_path / "bare.csv")
    refused = CliRunner().invoke(app, ["evaluate", str(tmp_path / "bare.csv"), str(tmp_path / "a.csv")])
    assert refused.exit_code == 2 and "no targets" in refused.output and "--model" in refused.output


def test_poses_that_one_run_visits_more_often_are_said_to_be_so(tmp_path):
    thrice = run(0.1, np.tile(PLACES, (3, 1)))
    text = words_of(tmp_path, run(0.2), thrice)
    assert "WARNING: AFTER measures the same poses 3 times as often as the other run" in text
    assert "as often" not in words_of(tmp_path, thrice, thrice)


def test_a_tracker_set_up_anew_for_each_run_is_recognised_without_a_model(tmp_path):
    runs = {"run": np.repeat([0, 1], 40)}
    tilted = turned(run(0.0), 1e-3, (0.3, 0.0, 0.0)).measured
    both = make_table(np.tile(PLACES, (2, 1)), measured=np.concatenate([PLACES, tilted]), **runs)
    both = both.replace(measured=both.measured + 1e-3 * RANDOM.normal(size=(80, 3)))
    text = words_of(tmp_path, both, both)
    assert "WARNING: one tracker frame for all 2 runs of BEFORE leaves" in text and "--frame fitted-per-run" in text
    assert "WARNING" not in words_of(tmp_path, both, both, "--frame", "fitted-per-run")
    plain = make_table(both.target, measured=both.target + 1e-3 * RANDOM.normal(size=(80, 3)), **runs)
    assert "WARNING" not in words_of(tmp_path, plain, plain)


def seated(file, error, seat=(3.0, -2.0, 5.0)):
    """Poses of an arm read at a reflector beside its tool point, which is off from where it was sent."""
    random = np.random.default_rng(8)
    mechanism = build_mechanism(file.machine)
    low, high = mechanism.limits().numpy()
    q = random.uniform(low, high, (60, mechanism.joints))
    place, turn = (each.numpy() for each in mechanism.pose(torch.as_tensor(q)))
    reading = place + error * random.normal(size=place.shape) + turn @ np.array(seat)
    return turned(make_table(place, q, measured=reading, joint_prefix="q"), angle=0.4)


@pytest.mark.parametrize("frame", ["fitted", "fitted-per-run"])
def test_where_the_reflector_sits_on_an_arm_is_no_error_of_its_tool(frame):
    file = load_machine(DATA / "arm" / "machine.toml")
    assert file.tracker.tool == "fitted"
    before, after = seated(file, 0.5), seated(file, 0.01)
    axes = evaluate_pair(before, after, file, frame=frame).to_dict()["axes"]
    assert all(94.0 < axis["reduction_percent"] < 99.5 for axis in axes.values()), axes
    trusted = replace(file, tracker=file.tracker.model_copy(update={"tool": "trusted"}))
    assert evaluate_pair(before, after, trusted, frame=frame).to_dict()["axes"]["x"]["reduction_percent"] < 50.0
    pair = compare_pair(before, after, file).to_dict()
    assert pair["nearer_share"] == 1.0
    assert any("tool point" in one for one in measured(before, after, None).warnings)


def test_readings_that_are_the_same_are_no_better_and_no_worse_where_one_run_has_fewer():
    """The frame is that of the poses in both: those of one alone would turn it."""
    error = 0.2 * RANDOM.normal(size=PLACES.shape)
    file, whole = load_machine(DATA / "machine.toml"), turned(run(error, name=NAMES))
    part = take_rows(whole, np.arange(25))
    for pair in ((whole, part), (part, whole)):
        axes = evaluate_pair(*pair).to_dict()["axes"]
        assert all(axis["reduction_percent"] == pytest.approx(0.0, abs=1e-9) for axis in axes.values())
    fitted = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted"}))
    lengths = compare_pair(whole, part, fitted).shared
    np.testing.assert_allclose(lengths[:, 0], lengths[:, 1], atol=1e-9)
