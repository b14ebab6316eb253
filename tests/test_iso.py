"""ISO 9283 figures against hand-computed cases and what must not change them."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from iso_command import app as app
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from ptt.errors import TableError
from ptt.judge.iso.figures import align_to_targets, is_axis_file, iso_of_poses, iso_of_problem
from ptt.judge.iso.pose import accuracy_and_repeatability, distance_figures, group_rows, pose_report
from ptt.machine import load_machine, save_machine
from ptt.mechanisms import build_mechanism
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.written import write_table


def test_pose_figures_by_hand():
    measured = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, -2.0, 0.0]]) + np.array(
        [10.0, 0.0, 3.0]
    )
    offset, accuracy, repeatability = accuracy_and_repeatability(np.array([10.0, -4.0, 0.0]), measured)
    np.testing.assert_allclose(offset, [0.0, 4.0, 3.0], atol=1e-12)
    assert accuracy == pytest.approx(5.0)
    assert repeatability == pytest.approx(1.5 + 3.0 * np.sqrt(4 * 0.25 / 3))  # l = 1, 1, 2, 2


@pytest.mark.parametrize("read", [0, 1, 2, 3])
def test_a_run_of_few_readings_leaves_the_figures_of_the_others(read):
    target = np.repeat(np.random.default_rng(0).uniform(-50.0, 50.0, (5, 3)), 3, axis=0)
    measured = target + np.random.default_rng(1).normal(0.0, 1e-3, target.shape)
    few = np.where(np.arange(15)[:, None] < read, measured, np.nan)
    twice, all_rows = np.concatenate([target, target]), np.concatenate([measured, few])
    both = make_table(twice, measured=all_rows, run=np.repeat([0, 1], 15))
    alone = iso_of_poses(make_table(target, measured=measured), per_run=True)
    found = iso_of_poses(both, per_run=True)
    assert len(found.aligned.poses) == len(alone.aligned.poses) == 5
    assert all(np.isfinite(pose.accuracy) for pose in found.aligned.poses)


def test_a_cycle_of_poses_has_all_its_visits_and_distances():
    target = np.tile(np.array([[0.0, 0.0, 0.0], [30.0, 5.0, -8.0], [-20.0, 30.0, 9.0], [11.0, -30.0, -15.0]]), (6, 1))
    measured = target + np.random.default_rng(2).normal(0.0, 2e-3, target.shape)
    found = iso_of_poses(make_table(target, measured=measured))
    assert [len(pose.rows) for pose in found.aligned.poses] == [6, 6, 6, 6]
    either = iso_of_poses(make_table(target, measured=measured), by_direction=False)
    assert found.to_dict()["aligned"]["AD_um"] == either.to_dict()["aligned"]["AD_um"]


def test_a_lost_reading_does_not_part_the_visits_of_a_cycle():
    """Both poses drift alike from cycle to cycle, so that the distance repeats exactly."""
    target = np.tile([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]], (6, 1))
    measured = target + np.repeat(np.arange(6.0), 2)[:, None] * [0.05, 0.0, 0.0]
    measured[4] = np.nan
    (figures,) = pose_report(target, measured).distances
    assert figures.cycles == 5 and figures.repeatability == pytest.approx(0.0, abs=1e-9)
    measured[[1, 3, 7, 9]] = np.nan  # of no more than one cycle both are left
    assert pose_report(target, measured).distances == ()


def test_distance_figures_by_hand():
    first, second = np.zeros((3, 3)), np.array([[0.0, 0.0, 10.1], [0.0, 0.0, 10.2], [0.0, 0.0, 10.3]])
    figures = distance_figures(first, np.vstack([second, [[0.0, 0.0, 99.0]]]), first[0], np.array([6.0, 0.0, 8.0]))
    assert figures.commanded == pytest.approx(10.0)
    assert figures.accuracy == pytest.approx(0.2)
    assert figures.repeatability == pytest.approx(0.3)
    assert figures.cycles == 3


def test_the_worst_of_figures_with_a_sign_is_the_largest_either_way():
    target = np.repeat([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0]], 2, axis=0)
    measured = np.repeat([[0.0, 0.0, 0.0], [9.7, 0.0, 0.0], [19.8, 0.0, 0.0]], 2, axis=0)  # 0.3 short, 0.1 long
    assert pose_report(target, measured).to_dict()["AD_um"] == pytest.approx({"mean": -100.0, "worst": -300.0})


def test_rows_are_grouped_by_target_direction_and_payload():
    target = np.tile([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], (8, 1))
    direction = np.repeat([[1], [-1]], 8, axis=0)
    payload = np.tile(np.repeat([0.0, 2.0], 4), 2)
    measured = target + 0.01 * direction * [0.0, 1.0, 0.0] + payload[:, None] * [0.0, 0.0, 1.0]
    report = pose_report(target, measured, direction, payload)
    assert len(report.poses) == 8
    assert [len(pose.rows) for pose in report.poses] == [2] * 8
    np.testing.assert_array_equal(report.poses[0].rows, [0, 2])
    assert [one.variation for one in report.variations] == pytest.approx([0.02] * 4)
    assert all(pose.repeatability == pytest.approx(0.0, abs=1e-12) for pose in report.poses)
    together = pose_report(target, measured, None, payload)
    assert len(together.poses) == 4
    assert together.variations == ()
    assert together.poses[0].repeatability == pytest.approx(0.01)


def test_groups_come_in_the_order_of_first_visit():
    groups = group_rows(np.array([[5.0], [1.0], [5.0], [3.0], [1.0]]))
    assert [rows.tolist() for rows in groups] == [[0, 2], [1, 4], [3]]


def test_drift_is_the_change_between_groups_of_ten():
    target = np.zeros((30, 3))
    measured = np.zeros((30, 3))
    measured[:, 0] = np.repeat([0.1, 0.4, 0.2], 10)
    drift = pose_report(target, measured).drifts[0]
    assert drift.group == 10
    assert drift.accuracy == pytest.approx(0.3)
    assert drift.repeatability == pytest.approx(0.0, abs=1e-12)
    assert pose_report(target[:8], measured[:8]).drifts[0].group == 4


@pytest.mark.parametrize(("cycles", "name"), [(29, "ISO style, n = 29"), (30, "ISO 9283:1998")])
def test_fewer_than_thirty_cycles_are_iso_style(cycles, name):
    report = pose_report(np.zeros((cycles, 3)), np.random.default_rng(0).normal(size=(cycles, 3)))
    assert report.standard == name
    assert report.to_dict()["standard"] == name


def test_poses_measured_once_are_left_out_and_counted():
    target = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [2, 0, 0]])
    measured = target + np.array([0.0, 0.1, 0.0])
    measured[1] = np.nan
    report = pose_report(target, measured)
    assert (len(report.poses), report.single) == (1, 1)
    with pytest.raises(TableError, match="no pose was measured twice"):
        pose_report(target[1:], measured[1:])


def rigid(random):
    """A rotation (3, 3) and a translation (3,)."""
    q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q)), random.normal(size=3) * 1000.0


@given(st.integers(0, 10_000))
@settings(max_examples=40)
def test_a_rigid_frame_changes_only_ap_and_alignment_undoes_it(seed):
    random = np.random.default_rng(seed)
    target = np.tile(random.uniform(-50.0, 50.0, (4, 3)), (6, 1))
    measured = target + random.normal(0.0, 0.01, (24, 3))
    rotation, shift = rigid(random)
    one, other = pose_report(target, measured), pose_report(target, measured @ rotation.T + shift)
    for a, b in zip(one.poses, other.poses, strict=True):
        assert a.repeatability == pytest.approx(b.repeatability, abs=1e-9)
    for a, b in zip(one.distances, other.distances, strict=True):
        assert a.accuracy == pytest.approx(b.accuracy, abs=1e-9)
    np.testing.assert_allclose(align_to_targets(target @ rotation.T + shift, target), target, atol=1e-9)
    np.testing.assert_allclose(
        align_to_targets(measured @ rotation.T + shift, target), align_to_targets(measured, target), atol=1e-9
    )


def test_alignment_never_mirrors():
    target = np.random.default_rng(3).normal(size=(10, 3))
    mirrored = target * [1.0, 1.0, -1.0]
    assert np.abs(align_to_targets(mirrored, target) - target).max() > 0.1


def test_arrival_comes_from_the_commands_unless_it_is_stated():
    path = np.tile([0.0, 1.0, 2.0, 1.0], 4)
    target = np.column_stack([path, 2.0 * path, np.zeros(16)])
    side = np.where(np.diff(path, prepend=-1.0) > 0, 1.0, -1.0)
    side[0] = 1.0
    measured = target + side[:, None] * [0.0, 0.0, 0.005]
    found = iso_of_poses(make_table(target, measured=measured))
    assert {len(pose.direction) for pose in found.as_measured.poses} == {3}
    assert [v.variation for v in found.as_measured.variations] == pytest.approx([0.01])  # at 1, reached both ways
    by_joint = iso_of_poses(make_table(target, command=path[:, None], measured=measured))
    assert [v.variation for v in by_joint.as_measured.variations] == pytest.approx([0.01])
    stated = iso_of_poses(make_table(target, measured=measured, direction=np.ones((16, 1))))
    assert stated.as_measured.variations == ()
    assert iso_of_poses(make_table(target, measured=measured), by_direction=False).as_measured.variations == ()


def test_stated_directions_of_an_arms_joints_tell_approaches_apart_beside_targets_alone():
    target = np.tile([[0.0, 0.0, 0.0], [30.0, 10.0, 0.0], [60.0, -20.0, 5.0]], (8, 1))
    side = np.tile(np.repeat([1.0, -1.0], 12)[:, None], (1, 6))
    side[:, 3] = np.nan  # a joint that nothing is said of
    measured = target + side[:, :1] * [0.0, 0.0, 0.005]
    found = iso_of_poses(make_table(target, measured=measured, direction=side, joint_prefix="q"))
    assert {pose.direction for pose in found.as_measured.poses} == {(1, 1, 1, 0, 1, 1), (-1, -1, -1, 0, -1, -1)}
    assert [v.variation for v in found.as_measured.variations] == pytest.approx([0.01] * 3)


def test_frames_per_run_are_aligned_run_by_run():
    random = np.random.default_rng(5)
    target = np.tile(random.uniform(-50.0, 50.0, (5, 3)), (4, 1))
    run = np.repeat([0, 1], 10)
    measured = np.where(run[:, None] == 0, target, target + np.array([100.0, 0.0, 0.0]))
    table = make_table(target, measured=measured, run=run)
    assert max(p.repeatability for p in iso_of_poses(table, False, False).aligned.poses) > 1.0
    own = iso_of_poses(table, True, False)
    assert max(p.repeatability for p in own.aligned.poses) < 1e-9
    assert min(p.repeatability for p in own.as_measured.poses) > 1.0


def test_a_run_without_targets_is_refused():
    with pytest.raises(TableError, match="no targets"):
        iso_of_poses(make_table(None, command=np.ones((4, 3)), measured=np.ones((4, 3))))


def test_command_on_a_tracker_run(app, tmp_path):
    random = np.random.default_rng(2)
    target = np.tile(random.uniform(-50.0, 50.0, (4, 3)), (5, 1))
    rows = np.column_stack([target, target + np.array([10.0, 0.0, 0.0]) + random.normal(0.0, 0.003, (20, 3))])
    path = tmp_path / "run.csv"
    lines = [",".join(repr(float(v)) for v in row) for row in rows]
    path.write_text("x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas\n" + "\n".join(lines) + "\n")
    assert not is_axis_file(path)
    outcome = CliRunner().invoke(app, [str(path), "--json", "--any-direction", "--set", "payload_kg=2"])
    assert outcome.exit_code == 0, outcome.output
    answer = json.loads(outcome.stdout)
    assert answer["standard"] == "ISO style, n = 5"
    assert answer["as_measured"]["AP_um"]["mean"] == pytest.approx(10_000.0, rel=1e-3)
    assert answer["aligned"]["AP_um"]["worst"] < 10.0
    assert answer["aligned"]["poses"][0]["payload_kg"] == 2.0
    assert "repeatability RP" in CliRunner().invoke(app, [str(path)]).stdout
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "model.toml").write_text(
        (Path(__file__).resolve().parents[1] / "data" / "machine.toml").read_text()
    )
    refused = CliRunner().invoke(app, [str(path), "--model", str(tmp_path / "half")])
    assert refused.exit_code != 0 and "compensator.json: no such file" in str(refused.exception)


def workpiece(kind):
    """A machine, joint commands of poses in three cycles, readings, and targets as of a workpiece that is turned."""
    random = np.random.default_rng(7)
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / kind / "machine.toml")
    mechanism = build_mechanism(file.machine)
    if file.machine.kind == "serial":
        q = np.tile(random.uniform(-1.0, 1.0, (12, 6)), (3, 1))
        place, turn = (each.numpy() for each in mechanism.pose(torch.as_tensor(q)))
        seat = turn @ [0.0, 30.0, 80.0]
    else:
        place, seat = np.tile(random.uniform(-40.0, 40.0, (12, 3)), (3, 1)), 0.0
        q = mechanism.inverse(torch.as_tensor(place)).numpy()
    reading = place + seat + 0.003 * random.normal(size=place.shape)
    turned = Rotation.from_euler("z", 40.0, degrees=True).as_matrix()
    return file, q, reading, (place - [300.0, 100.0, 50.0]) @ turned


@pytest.mark.parametrize("kind", ["sealed_one", "arm"])
def test_the_frame_that_targets_are_stated_in_changes_no_aligned_figure(app, tmp_path, kind):
    file, q, reading, stated = workpiece(kind)
    alone = make_table(None, q, reading, joint_prefix=file.machine.letter)
    bare = np.arange(len(q))[:, None] % 4 == 0  # rows with commands alone among those with targets
    tables = [alone, alone.replace(target=stated), alone.replace(target=np.where(bare, np.nan, stated))]
    base, whole, some = (iso_of_problem(build_problem(file, table)).aligned.to_dict() for table in tables)
    assert base["AP_um"]["worst"] < 10.0
    for found in (whole, some):
        assert found["AP_um"] == pytest.approx(base["AP_um"], rel=1e-4)
        assert found["RP_um"] == pytest.approx(base["RP_um"], rel=1e-4)
    write_table(tables[2], tmp_path / "run.csv")
    save_machine(file, tmp_path / "m.toml")
    outcome = CliRunner().invoke(app, [str(tmp_path / "run.csv"), "--model", str(tmp_path / "m.toml"), "--json"])
    assert json.loads(outcome.stdout)["aligned"]["AP_um"] == pytest.approx(base["AP_um"], rel=1e-4)


def test_targets_a_hair_apart_are_one_pose_and_loads_too():
    """Computed targets differ in their last digits from cycle to cycle."""
    random = np.random.default_rng(8)
    place = np.tile(np.array([[0.5005, 1.0, 2.0], [30.0, -20.0, 10.0005]]), (30, 1))
    target = place + 1e-10 * random.choice([-1.0, 1.0], place.shape)
    report = pose_report(target, place + 0.003 * random.standard_normal(place.shape), payload=np.full(60, 2.0) + 1e-12)
    assert [len(pose.rows) for pose in report.poses] == [30, 30]


def test_a_gross_reading_counts_as_the_standard_has_it_and_is_named():
    random = np.random.default_rng(4)
    target = np.tile(random.uniform(-80.0, 80.0, (12, 3)), (3, 1))
    sound = target + 0.004 * random.normal(size=target.shape)
    wild = sound.copy()
    wild[17, 2] += 30.0
    clean, found = (iso_of_poses(make_table(target, measured=read), by_direction=False) for read in (sound, wild))
    assert clean.gross == () and clean.without is None
    assert found.gross == ("table row 19 (30 mm off)",) and found.without is not None
    worst = [max(pose.repeatability for pose in each.poses) for each in (clean.aligned, found.aligned, found.without)]
    assert worst[1] > 30.0 > 0.1 > worst[2] == pytest.approx(worst[0], rel=0.5)
    assert found.to_dict()["without_gross"]["RP_um"]["worst"] == pytest.approx(1e3 * worst[2])
