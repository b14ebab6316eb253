"""The noise of a fit and its source, gross errors, and rows that are held out."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from made_runs import empty_run, hidden_backlash, machine
from scipy import stats
from test_fit import fitted

from ptt.fitting.outliers import inside
from ptt.fitting.report import report_fit
from ptt.run.given_noise import given_noise, noise_from_std
from ptt.run.holdout import BLOCKS, blocks, folds, pose_groups
from ptt.run.problem import build_problem
from ptt.run.repeats import noise_from_repeats
from ptt.run.table import Table, make_table


def still(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """One tracker frame along the axes of the base."""
    return np.eye(3)[None], np.zeros(table.rows, dtype=int)


# --- gross errors


def test_gross_errors_are_found_by_line_and_do_not_move_the_fit() -> None:
    problem, _ = hidden_backlash()
    wrong = np.array([7, 60, 111, 150])
    measured = problem.table.measured.copy()
    measured[wrong] += np.array([0.5, -0.4, 0.3])
    table = replace(problem.table, measured=measured)
    result = fitted(["backlash"], build_problem(problem.file, table))
    np.testing.assert_array_equal(np.flatnonzero(result.outliers), wrong)
    report = report_fit(result, build_problem(problem.file, table))
    assert [line for line, _ in report.outliers] == table.line[wrong].tolist()
    clean = fitted(["backlash"], problem)
    torch.testing.assert_close(result.model.terms[0].theta, clean.model.terms[0].theta, atol=1e-3, rtol=0.0)
    blind = fitted(["backlash"], build_problem(problem.file, table), robust=False)
    assert not blind.outliers.any() and blind.chi2 > 10.0 * result.chi2


def test_sound_rows_are_no_outliers() -> None:
    random = np.random.default_rng(0)
    lost = [300 - inside(random.normal(size=(300, 3)), np.ones(300, dtype=bool)).sum() for _ in range(200)]
    assert np.mean(np.array(lost) > 0) < 0.02


@pytest.mark.parametrize(
    ("misses", "far", "kept"), [(1.0, 0.9, True), (1.0, 1.3, False), (3.0, 1.8, True), (3.0, 2.4, False)]
)
def test_what_a_model_misses_has_ends_twice_as_far_out_as_noise(misses: float, far: float, kept: bool) -> None:
    """One row of 300, off by so many times what one of a thousand such tables has of noise of that size."""
    limit = float(np.sqrt(stats.chi2.isf(1e-3 / 300.0, 3)))
    left = misses * np.random.default_rng(0).normal(size=(300, 3))
    left[100] = (0.0, far * limit * misses, 0.0)
    assert inside(left, np.ones(300, dtype=bool))[100] == kept


# --- noise and its source


def repeated(spread: float, groups: int = 40, times: int = 3) -> Table:
    random = np.random.default_rng(4)
    target = np.repeat(random.uniform(-50.0, 50.0, (groups, 3)), times, axis=0)
    return make_table(target, measured=target + random.normal(0.0, spread, target.shape))


def test_noise_comes_from_std_columns_unless_repeats_scatter_by_more() -> None:
    table = repeated(0.006)
    direction = np.ones((table.rows, 3))
    small, large = np.full((table.rows, 3), 0.001), np.full((table.rows, 3), 0.02)
    outdone = given_noise(replace(table, std=small), table.measured, direction, 0.5, *still(table))
    assert outdone.source == "repeats" and outdone.stated == (
        "std columns",
        noise_from_std(replace(table, std=small), *still(table)).total,
    )
    stated = given_noise(replace(table, std=large), table.measured, direction, 0.5, *still(table))
    assert stated.source == "std columns"
    np.testing.assert_allclose(stated.sigma, 0.02, rtol=1e-6)


def test_noise_of_repeats_then_of_the_machine_file_then_none() -> None:
    table, few = repeated(0.006), repeated(0.006, groups=5)
    pooled = given_noise(table, table.measured, np.ones((table.rows, 3)), None, *still(table))
    assert pooled.source == "repeats" and pooled.freedom == 80
    np.testing.assert_allclose(pooled.sigma, 0.006, rtol=0.25)
    named = given_noise(few, few.measured, np.ones((few.rows, 3)), 0.004, *still(few))
    assert named.source == "machine file" and named.sigma[0] == pytest.approx(0.004)
    assert given_noise(few, few.measured, np.ones((few.rows, 3)), None, *still(few)) is None
    assert noise_from_std(few, *still(few)) is None


def test_the_same_pose_reached_the_other_way_or_under_another_load_is_no_repeat() -> None:
    table = repeated(0.006)
    ways = np.ones((table.rows, 3))
    assert noise_from_repeats(table, table.measured, ways) is not None
    alternate = np.tile([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]], (40, 1))
    assert noise_from_repeats(table, table.measured, alternate) is None
    loaded = replace(table, payload_kg=np.tile([0.0, 2.0, 5.0], 40))
    assert noise_from_repeats(loaded, table.measured, ways) is None


def test_a_broken_beam_does_not_make_the_noise_floor() -> None:
    table = repeated(0.006)
    table.measured[17] += 1.0
    pooled = noise_from_repeats(table, table.measured, np.ones((table.rows, 3)))
    np.testing.assert_allclose(pooled.sigma, 0.006, rtol=0.3)


def test_pairs_are_left_out_beyond_the_same_chance_as_groups_of_many() -> None:
    """Each of two readings lies half as far from their mean as from each other: 0.7 sigma, for 1 among many."""
    table = repeated(0.004, groups=200, times=2)
    sound = noise_from_repeats(table, table.measured, np.ones((table.rows, 3)))
    measured = table.measured.copy()
    measured[17, 1] = measured[16, 1] + 0.004 * np.sqrt(2.0) * 5.8  # of 400 readings one is 4.6 sigma off, by chance
    gross = noise_from_repeats(replace(table, measured=measured), measured, np.ones((table.rows, 3)))
    assert sound is not None and gross is not None and gross.freedom == sound.freedom - 1


@pytest.mark.parametrize("way", [[0.0, 0.0, 0.0], [0.03, 0.0, 0.01], [0.01, -0.02, 0.03]])
def test_repeats_that_drift_together_give_the_noise_that_is_new_with_each_reading(way: list[float]) -> None:
    """A machine whose poses are visited in turn moves along one direction and back, which pooled repeats call noise."""
    random = np.random.default_rng(5)
    place = np.tile(random.uniform(-50.0, 50.0, (8, 3)), (12, 1))
    slow = np.outer(np.sin(np.linspace(0.0, 9.0, len(place))), way)
    table = make_table(place, measured=place + slow + random.normal(0.0, 0.003, place.shape))
    noise = noise_from_repeats(table, table.measured, np.ones((len(place), 3)))
    assert noise is not None
    np.testing.assert_allclose(noise.sigma, 0.003, rtol=0.3)
    assert noise.freedom == pytest.approx(88.0 if not any(way) else 88.0 * 2.0 / 3.0)


def test_repeats_of_which_each_round_leaves_one_more_out_give_a_noise() -> None:
    """Each gross reading drags the mean so far that only it stands out, in the last round as in the first."""
    random = np.random.default_rng(1)
    place = np.tile(random.uniform(-50.0, 50.0, 3), (60, 1))
    measured = place + random.normal(0.0, 0.003, place.shape)
    measured[5:40:5, 0] += 10.0 ** np.arange(-1, 6)
    noise = noise_from_repeats(make_table(place, measured=measured), measured, np.ones((60, 3)))
    assert noise is not None and np.isfinite(noise.covariance).all()


def test_whitener_makes_noise_white() -> None:
    pooled = noise_from_repeats(repeated(0.006), repeated(0.006).measured, np.ones((120, 3)))
    np.testing.assert_allclose(pooled.whitener @ pooled.covariance @ pooled.whitener.T, np.eye(3), atol=1e-9)


# --- held-out rows


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 60), st.integers(1, 12))
def test_no_pose_is_split_and_base_rows_are_never_hidden(seed: int, poses: int, count: int) -> None:
    random = np.random.default_rng(seed)
    place = random.uniform(-50.0, 50.0, (poses, 3))
    visit = np.concatenate([np.arange(poses), random.integers(0, poses, 2 * poses)])
    role = np.where(random.random(len(visit)) < 0.2, "base", "pose")
    table = make_table(place[visit], role=role)
    block, group = blocks(table, count), pose_groups(table)
    assert (block[role == "base"] == -1).all() and (block[role != "base"] >= 0).all()
    assert block.max() < count
    for number in np.unique(group[group >= 0]):
        assert len(np.unique(block[group == number])) == 1
    parts = folds(table, 5)
    hidden = np.sum(parts, axis=0)
    np.testing.assert_array_equal(hidden, (role != "base").astype(int))


def test_blocks_are_stretches_of_travel_of_about_equal_length() -> None:
    block = blocks(empty_run(200))
    assert (np.diff(block) >= 0).all() and block.max() == BLOCKS - 1
    assert np.ptp(np.bincount(block)) <= 1


def test_hidden_readings_do_not_touch_the_fit() -> None:
    problem, _ = hidden_backlash()
    part = folds(problem.table, 5)[2]
    spoiled = problem.measured.copy()
    spoiled[part] += 3.0
    first = fitted(["backlash"], problem.masked(part))
    second = fitted(["backlash"], replace(problem, measured=spoiled).masked(part))
    np.testing.assert_array_equal(first.unknowns, second.unknowns)
    assert np.isfinite(first.residual[part]).all()


def test_deviations_along_the_tracker_s_axes_are_turned_into_the_base_frame() -> None:
    """A tracker whose z lies along the base's y, and in a second set-up along its x, is noisy there."""
    draws, rows = np.random.default_rng(1), 400
    std, place = np.array([0.002, 0.002, 0.02]), draws.uniform(-60.0, 60.0, (rows, 3))
    turns = np.array([[[0.0, 0, 1], [1, 0, 0], [0, 1, 0]], [[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]])
    run = np.repeat([0, 1], rows // 2)
    read = np.einsum("nij,nj->ni", turns[run], place) + draws.normal(size=(rows, 3)) * std
    for runs, covariance in ((1, [4e-6, 4e-4, 4e-6]), (2, [2.02e-4, 2.02e-4, 4e-6])):
        kept = run < runs
        table = make_table(place[kept], None, read[kept], run=run[kept], std=np.tile(std, (int(kept.sum()), 1)))
        table = replace(table, run_label=tuple("ab"[:runs]))
        noise = build_problem(machine(frame="fitted-per-run", sigma_mm=None), table).noise
        assert noise is not None and noise.source == "std columns"
        np.testing.assert_allclose(noise.covariance, np.diag(covariance), rtol=0.02, atol=1e-6)
