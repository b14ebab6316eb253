"""When two values are one: no grid of cells, one tolerance for holding out, noise and matching."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from ptt.judge.compare.lack_of_fit import lack_of_fit_of
from ptt.judge.evaluate import evaluate_pair
from ptt.judge.match import match_rows
from ptt.machine import load_machine
from ptt.run.copies import pasted_rows
from ptt.run.holdout import pose_groups, sharing_groups, visit_groups
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.repeats import NEAR_IN_TIME, SAME_WARMTH, noise_from_repeats, repeat_groups
from ptt.run.same_pose import SAME_POSE, count_places, number_alike, same_places
from ptt.run.table import make_table
from ptt.run.written import write_table

UP = np.ones((1, 3))


def alike(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two numberings part the rows in the same way."""
    pairs = len(np.unique(np.column_stack([first, second]), axis=0))
    return pairs == len(np.unique(first)) == len(np.unique(second))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 40), st.integers(1, 4))
def test_poses_are_what_a_search_of_all_pairs_finds(seed: int, poses: int, joints: int) -> None:
    random = np.random.default_rng(seed)
    visit = random.integers(0, poses, 3 * poses)
    place = random.uniform(-50.0, 50.0, (poses, joints))[visit] + random.uniform(-3e-4, 3e-4, (len(visit), joints))
    near = cdist(place, place, "chebyshev") <= SAME_POSE
    assert alike(same_places(place), connected_components(near)[1])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(-1e3, 1e3), st.floats(1e-13, 9e-4))
def test_where_the_origin_lies_makes_no_difference(seed: int, origin: float, apart: float) -> None:
    random = np.random.default_rng(seed)
    place = np.round(random.uniform(-50.0, 50.0, (25, 3)), 2) + origin
    both = np.concatenate([place, place + apart * random.choice([-1.0, 1.0], (25, 3))])
    number = same_places(both)
    np.testing.assert_array_equal(number[:25], number[25:])
    assert count_places(both) == len(np.unique(place, axis=0))


def test_a_dense_path_is_not_one_pose_and_parts_are_no_wider_than_the_tolerance() -> None:
    place = np.arange(4000)[:, None] * np.array([2e-4, 0.0, 0.0])
    number = same_places(place)
    assert 790 <= number.max() + 1 <= 810
    assert max(np.ptp(place[number == each, 0]) for each in range(number.max() + 1)) <= SAME_POSE * (1 + 1e-9)


def test_what_is_missing_is_like_what_is_missing_only() -> None:
    np.testing.assert_array_equal(number_alike(np.array([np.nan, 0.0, np.nan, 0.0]), 1.0), [0, 1, 0, 1])
    np.testing.assert_array_equal(number_alike(np.zeros(4), 1.0, within=np.array([5, 3, 5, 3])), [0, 1, 0, 1])
    assert number_alike(np.zeros((0, 3)), 1.0).shape == (0,)


def test_targets_of_a_hair_apart_are_one_pose_wherever_they_lie() -> None:
    edge = 0.5005  # a boundary between cells of a micrometre
    place = np.array([[edge - 5e-11, 1.0, 2.0], [9.0, 9.0, 9.0], [edge + 5e-11, 1.0, 2.0]])
    np.testing.assert_array_equal(pose_groups(make_table(place)), [0, 1, 0])


def test_rows_without_a_target_are_told_apart_by_their_commands() -> None:
    target = np.array([[1.0, 2.0, 3.0], [np.nan] * 3, [np.nan] * 3, [1.0, 2.0, 3.0]])
    command = np.array([[10.0, 10, 10], [11, 11, 11], [12, 12, 12], [10, 10, 10]])
    np.testing.assert_array_equal(pose_groups(make_table(target, command)), [0, 1, 2, 0])


@pytest.mark.parametrize("joints", [2, 3, 6])
def test_two_postures_at_one_place_are_two_poses_of_an_arm(joints: int) -> None:
    place, command = np.zeros((4, 3)), np.zeros((4, joints))
    command[1::2, -2:] = [1.1, -1.3]  # the elbow on the other side
    np.testing.assert_array_equal(pose_groups(make_table(place, command, joint_prefix="q")), [0, 1, 0, 1])


@pytest.mark.parametrize("begin", [0.0, 0.5 * NEAR_IN_TIME - 5.0, NEAR_IN_TIME - 5.0, 12345.0])
def test_repeats_ten_seconds_apart_are_repeats_whenever_the_clock_was_set(begin: float) -> None:
    time = begin + np.array([0.0, 10.0, 10.0 + 1.5 * NEAR_IN_TIME])
    table = make_table(np.ones((3, 3)), measured=np.zeros((3, 3)), time_s=time)
    np.testing.assert_array_equal(repeat_groups(table, np.repeat(UP, 3, axis=0)), [0, 0, 1])


@pytest.mark.parametrize("base", [19.74, 19.76, 20.0, 20.25])
def test_a_twentieth_of_a_kelvin_is_the_same_warmth_and_a_slow_warming_is_not(base: float) -> None:
    warm = np.concatenate([base + np.array([0.0, 0.05]), base + 5.0 + 0.1 * np.arange(60)])
    table = make_table(np.ones((62, 3)), measured=np.zeros((62, 3)), temp_c=warm)
    group = repeat_groups(table, np.repeat(UP, 62, axis=0))
    assert group[0] == group[1] and group[2] not in group[:2]
    assert max(np.ptp(warm[group == each]) for each in np.unique(group)) <= SAME_WARMTH * (1 + 1e-9)


def test_the_noise_does_not_fall_with_copied_rows() -> None:
    """Each row of a run pasted a second time: the readings scatter as before."""
    random = np.random.default_rng(4)
    place = np.repeat(random.uniform(-50, 50, (60, 3)), 3, axis=0)
    reading = place + 0.005 * random.standard_normal(place.shape)
    once, twice = (
        make_table(place, measured=reading),
        make_table(np.tile(place, (2, 1)), measured=np.tile(reading, (2, 1))),
    )
    found = noise_from_repeats(once, once.measured, np.repeat(UP, 180, axis=0))
    again = noise_from_repeats(twice, twice.measured, np.repeat(UP, 360, axis=0))
    assert found is not None and again is not None and found.total == pytest.approx(0.005 * np.sqrt(3), rel=0.15)
    np.testing.assert_allclose(again.covariance, found.covariance, rtol=1e-9)
    assert again.freedom == found.freedom


def test_copied_rows_do_not_make_a_good_model_look_bad(bench) -> None:
    """Copies would halve the pure error, and noise would pass for a lack of fit."""
    random = np.random.default_rng(4)
    place = np.tile(random.uniform(-40, 40, (60, 3)), (3, 1))
    reading = place + 0.005 * random.standard_normal(place.shape)
    problem = build_problem(bench, make_table(np.tile(place, (2, 1)), measured=np.tile(reading, (2, 1))))
    test = lack_of_fit_of(problem, problem.measured - problem.target, 6)
    assert test.p_value is not None and test.p_value > 0.01
    bare = lack_of_fit_of(problem, problem.measured - problem.target)
    assert bare.freedom[0] - test.freedom[0] == 2.0  # six fitted numbers take two of each axis


@pytest.mark.parametrize("missed", [0.0, 0.05])
def test_visits_from_either_side_tell_the_scatter_where_no_pose_is_repeated(bench, missed: float) -> None:
    """Strokes up and down one way: no visit repeats another, and two of one place err alike where a place errs."""
    random = np.random.default_rng(7)
    up = np.column_stack([np.zeros((40, 2)), np.linspace(-40.0, 40.0, 40)])
    place = np.concatenate([up, up[::-1]])
    errs = missed * random.standard_normal((40, 3))
    reading = place + np.concatenate([errs, errs[::-1]]) + 0.005 * random.standard_normal(place.shape)
    problem = build_problem(bench, make_table(place, measured=reading))
    test = lack_of_fit_of(problem, problem.measured - problem.target, from_any_side=True)
    assert lack_of_fit_of(problem, problem.measured - problem.target).p_value is None
    assert test.p_value is not None and (test.p_value < 1e-9 if missed else test.p_value > 0.01)


def test_readings_of_one_visit_say_nothing_of_what_differs_between_visits(bench) -> None:
    random = np.random.default_rng(6)
    place = np.repeat(np.tile(random.uniform(-40, 40, (30, 3)), (3, 1)), 3, axis=0)
    visit = np.repeat(random.normal(0.0, 0.010, (90, 3)), 3, axis=0)
    table = make_table(place, measured=place + visit + random.normal(0.0, 0.002, place.shape))
    np.testing.assert_array_equal(visit_groups(table), np.arange(270) // 3)
    group, by_visit = sharing_groups(table, np.ones(270, dtype=bool))
    assert by_visit and alike(group, visit_groups(table))
    noise = noise_from_repeats(table, table.measured, np.repeat(UP, 270, axis=0))
    assert noise is not None and noise.freedom == 60.0
    assert noise.total == pytest.approx(np.hypot(0.010, 0.002) * np.sqrt(3.0), rel=0.15)
    problem = build_problem(bench, table)
    fit = lack_of_fit_of(problem, problem.measured - problem.target)
    assert fit.p_value is not None and fit.p_value > 0.01


def test_a_pose_that_is_left_and_a_run_that_ends_end_a_visit_and_a_base_reflector_does_not() -> None:
    place = np.array([[1.0, 2.0, 3.0]] * 2 + [[4.0, 5.0, 6.0]] + [[1.0, 2.0, 3.0]] * 5)
    role = np.array(["pose"] * 6 + ["base", "pose"])
    table = make_table(place, role=role, run=np.array([0, 0, 0, 0, 1, 1, 1, 1]))
    np.testing.assert_array_equal(visit_groups(table), [0, 0, 1, 2, 3, 3, -1, 3])
    assert not sharing_groups(table, np.arange(8) < 4)[1]  # as many visits of a pose as readings of a visit


def test_identical_rows_are_a_warning(tmp_path) -> None:
    place = np.arange(30.0).reshape(10, 3)
    write_table(make_table(place, measured=place + 0.1), tmp_path / "run.csv")
    lines = (tmp_path / "run.csv").read_text().splitlines()
    (tmp_path / "run.csv").write_text("\n".join([*lines[:5], lines[4], lines[4], *lines[5:]]) + "\n")
    table = read_table(tmp_path / "run.csv")
    assert table.rows == 12
    (warning,) = [line for line in table.understood.lines if line.startswith("warning")]
    assert "row 6 is identical to row 5 in every column, and 1 more" in warning and "repeats" in warning
    assert "once" not in warning


def test_a_run_that_stands_twice_in_its_file_is_said_to_count_once_and_does(tmp_path) -> None:
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml")
    place = np.random.default_rng(1).uniform(-40.0, 40.0, (15, 3))
    write_table(make_table(place, measured=place + 0.1 * place[:, ::-1] / 40.0), tmp_path / "run.csv")
    title, *lines = (tmp_path / "run.csv").read_text().splitlines()
    for name, twice, said in (
        ("behind", [*lines, *lines], "all rows come again, so that they count once"),
        ("beside", [line for line in lines for _ in range(2)], "taken as repeats, but copies say nothing"),
    ):
        (tmp_path / f"{name}.csv").write_text("\n".join([title, *twice]) + "\n")
        table = read_table(tmp_path / f"{name}.csv")
        (warning,) = [line for line in table.understood.lines if line.startswith("warning")]
        assert said in warning and ("once" in warning) == (name == "behind")
        assert build_problem(file, table).used.sum() == (15 if name == "behind" else 30)
    both = read_table(tmp_path / "run.csv", also=[tmp_path / "run.csv"])
    assert any("holds the same rows" in line and "count once" in line for line in both.understood.lines)
    assert build_problem(file, both).used.sum() == 15


def test_a_run_that_stands_twice_in_its_file_counts_once_when_it_was_sorted_by_time(tmp_path) -> None:
    """Copies stand side by side then, where equal readings may be repeats; their lines of the file tell them."""
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml")
    place = np.random.default_rng(1).uniform(-40.0, 40.0, (15, 3))
    clock = np.arange(15) * 10.0
    write_table(make_table(place, measured=place + 0.1 * place[:, ::-1] / 40.0, time_s=clock), tmp_path / "run.csv")
    title, *lines = (tmp_path / "run.csv").read_text().splitlines()
    (tmp_path / "run.csv").write_text("\n".join([title, *lines, *lines]) + "\n")
    for order in ("time", "rows"):
        table = read_table(tmp_path / "run.csv", set_values={"order": order})
        assert any("count once" in line for line in table.understood.lines)
        assert build_problem(file, table).used.sum() == 15


def test_before_and_after_are_matched_across_the_edge_of_a_cell() -> None:
    random = np.random.default_rng(2)
    place = np.round(random.uniform(-50, 50, (40, 3)), 3) + 5e-4  # on edges between cells of a micrometre
    after = place + 1e-10 * random.choice([-1.0, 1.0], place.shape)
    tables = [make_table(each, measured=each + 0.1) for each in (place - 1e-11, after)]
    first, second, left = match_rows(*tables, np.ones(40, dtype=bool), np.ones(40, dtype=bool))
    np.testing.assert_array_equal(first, second)
    assert len(first) == 40 and left == {"before": [], "after": []}
    protocol = evaluate_pair(*tables, frame="trusted").protocol
    assert (protocol["rows"], protocol["poses"]) == (40, 40)


def test_the_poses_of_a_table_are_numbered_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def counted(place: np.ndarray) -> np.ndarray:
        asked.append(len(place))
        return same_places(place)

    monkeypatch.setattr("ptt.run.holdout.same_places", counted)
    table = make_table(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    assert pose_groups(table).tolist() == pose_groups(table).tolist() == [0, 1, 0]
    assert len(asked) == 1
    moved = table.replace(target=table.target[[0, 1, 1]])  # another table has poses of its own
    assert pose_groups(moved).tolist() == [0, 1, 1]
    assert len(asked) == 2
    with pytest.raises(ValueError, match="read-only"):
        pose_groups(table)[0] = 5


@pytest.mark.parametrize("times", [2, 3])
def test_a_file_that_was_pasted_behind_itself_counts_once(times: int) -> None:
    random = np.random.default_rng(4)
    place = np.repeat(random.uniform(-40.0, 40.0, (12, 3)), 2, axis=0)
    measured = place + random.normal(0.0, 0.01, place.shape)
    table = make_table(np.tile(place, (times, 1)), measured=np.tile(measured, (times, 1)), temp_c=20.0)
    np.testing.assert_array_equal(pasted_rows(table), np.arange(24 * times) >= 24)
    assert not pasted_rows(table.replace(repeat=np.arange(24.0 * times))).any()


def test_repeats_that_a_coarse_display_makes_alike_are_repeats() -> None:
    place = np.tile(np.random.default_rng(4).uniform(-40.0, 40.0, (12, 3)), (25, 1))
    coarse = np.round(place + np.random.default_rng(5).normal(0.0, 2e-3, place.shape), 2)
    assert len(np.unique(coarse, axis=0)) < 200 and not pasted_rows(make_table(place, measured=coarse)).any()
