"""What no stranger's machine may be told: that nothing is missing beside a large error, or a warmth that cannot be."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from stated_bench import NOISE, stated

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.search.excess import NOISE_EXCESS, is_open, too_much_left
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table


def told_of(
    file: MachineFile, target: np.ndarray, error: np.ndarray, q_error: np.ndarray, **columns: object
) -> Diagnosis:
    """A run of a machine whose joints and readings err by so much, (n, 3) mm each."""
    robot = build_mechanism(file.machine)
    joints = robot.inverse(torch.as_tensor(target))
    reached = robot.forward(joints + torch.as_tensor(q_error)).numpy()
    table = replace(make_table(target, joints.numpy(), **columns), measured=reached + error)
    return diagnose(Model(file), build_problem(file, table))


def higher(file: MachineFile, height: float) -> MachineFile:
    """The same machine, the heights of its sliders counted from further below."""
    machine = file.machine
    low, high = machine.slider_travel_mm
    travel = low + height, high + height
    return replace(file, machine=machine.model_copy(update={"slider_travel_mm": travel, "joint_height_mm": height}))


def helix(rows: int) -> np.ndarray:
    turn = np.linspace(0.0, 6.0 * np.pi, rows)
    return np.column_stack([50.0 * np.cos(turn), 50.0 * np.sin(turn), np.linspace(-40.0, 40.0, rows)])


@pytest.mark.parametrize(
    ("row", "seed"),
    [
        (5, 1),
        pytest.param(6, 2, marks=pytest.mark.long),
        (60, 3),
        pytest.param(86, 4, marks=pytest.mark.long),
    ],
)
def test_one_wrong_reading_of_a_smooth_path_is_left_out(row: int, seed: int) -> None:
    """Not its neighbour in its place, and nothing that happened just before it and was undone just after."""
    random, target = np.random.default_rng(seed), helix(90)
    joints = build_mechanism(bench().machine).inverse(torch.as_tensor(target)).numpy()
    long = (joints - joints.mean(axis=0)) * np.array([1.2e-3, -0.8e-3, 0.5e-3])
    error = random.normal(0.0, NOISE, target.shape)
    error[row] += 0.12 * random.choice([-1.0, 1.0], 3)
    found = told_of(stated(), target, error, long, time_s=4.0 * np.arange(90))
    assert np.flatnonzero(found.outliers).tolist() == [row]
    assert found.verdict == "missing"
    assert [names[0] for names in found.suggested] == ["lead-scale"]


def test_poses_that_come_back_far_worse_than_the_noise_are_not_nothing() -> None:
    """Five poses in cycles on a stand that sways ever faster: repeats take the fast part of it for their scatter."""
    random, rows = np.random.default_rng(5), 60
    five = np.array([[0, 0, 0], [40, 40, 20], [-40, 40, -20], [-40, -40, 20], [40, -40, -20]], dtype=float)
    sway = np.sin(2.0 * np.pi * 3.4 * np.linspace(0.0, 1.0, rows) ** 2)[:, None] * np.array([0.05, -0.03, 0.02])
    error = random.normal(0.0, NOISE, (rows, 3)) + sway
    found = told_of(stated(), np.tile(five, (12, 1)), error, np.zeros((rows, 3)), time_s=5.0 * np.arange(rows))
    assert found.verdict == "unknown"
    assert "times the noise (from repeats)" in found.words and "times the value in the machine file" in found.words


def test_an_error_is_held_against_what_is_stated() -> None:
    file = Noise(np.eye(3) * NOISE**2, "machine file")
    repeats = Noise(np.eye(3) * (5.0 * NOISE) ** 2, "repeats", 60.0, stated=("machine file", file.total))
    assert too_much_left(1.5 * file.total, file, wanders=False) is None
    assert too_much_left(1.1 * NOISE_EXCESS * file.total, file, wanders=False) is not None
    assert too_much_left(1.1 * NOISE_EXCESS * file.total, file, wanders=True) is None
    assert "tracker wanders" in str(too_much_left(4.0 * file.total, file, wanders=True))
    assert "poses repeat no better" in str(too_much_left(5.0 * file.total, repeats, wanders=False))
    assert too_much_left(3.0 * file.total, repeats, wanders=False) is None
    assert [is_open(times * file.total, repeats, 0.0) for times in (1.8, 2.2)] == [False, True]
    assert not is_open(file.total, None, 0.0)
    assert too_much_left(5.0 * file.total, None, wanders=False) is None


def test_readings_of_one_visit_that_err_alike_by_twenty_times_the_noise_are_not_nothing() -> None:
    """Forty poses, each read three times at one visit and never again."""
    random = np.random.default_rng(6)
    target = np.repeat(random.uniform(-50.0, 50.0, (40, 3)), 3, axis=0)
    error = np.repeat(random.normal(0.0, 0.1, (40, 3)), 3, axis=0) + random.normal(0.0, NOISE, (120, 3))
    found = told_of(stated(), target, error, np.zeros((120, 3)))
    assert found.verdict == "unknown" and found.suggested == ()


@pytest.mark.parametrize(("count", "seed"), [(6, 1), pytest.param(10, 2, marks=pytest.mark.long)])
def test_a_few_loaded_poses_among_many_are_no_gross_errors(count: int, seed: int) -> None:
    """A column bends under 5 kg, which few of 120 poses carried."""
    random = np.random.default_rng(seed)
    target, load = random.uniform(-50.0, 50.0, (120, 3)), np.zeros(120)
    load[random.choice(np.arange(5, 115, 5), count, replace=False)] = 5.0
    bend = load[:, None] / 5.0 * (np.array([0.06, -0.04, 0.0]) + 8e-4 * target[:, [2]] * np.array([1.0, 0.5, 0.0]))
    error = random.normal(0.0, NOISE, target.shape) + bend
    found = told_of(stated(), target, error, np.zeros((120, 3)), payload_kg=load, time_s=5.0 * np.arange(120))
    assert not found.outliers.any()
    assert [names[0] for names in found.suggested] == ["column-bend"]


@pytest.mark.parametrize(("seed", "height"), [pytest.param(1, 0.0, marks=pytest.mark.long), (2, 0.0), (1, 1500.0)])
def test_a_zero_that_follows_warmth_without_any_growth_is_no_screw(seed: int, height: float) -> None:
    """Slider 3 rises by 60 um/K wherever it stands; a steel screw of half a metre grows by 6."""
    random, target = np.random.default_rng(seed), np.random.default_rng(seed).uniform(-50.0, 50.0, (200, 3))
    warm = 20.0 + 6.0 * (1.0 - np.exp(-np.arange(200) / 60.0))
    rise = np.column_stack([np.zeros((200, 2)), 0.06 * (warm - 20.0)])
    error = random.normal(0.0, NOISE, target.shape)
    found = told_of(higher(stated(), height), target, error, rise, temp_c=warm, time_s=5.0 * np.arange(200))
    assert found.verdict == "unknown"
    assert "screw-growth" not in [name for names in found.suggested for name in names]
    assert found.depends_on[0].on in ("temperature", "time")


@pytest.mark.parametrize("bearing", [-200.0, pytest.param(150.0, marks=pytest.mark.long), 450.0])
def test_a_screw_that_grows_away_from_its_bearing_is_named(bearing: float) -> None:
    random, target = np.random.default_rng(7), np.random.default_rng(8).uniform(-50.0, 50.0, (200, 3))
    warm = 20.0 + 6.0 * (1.0 - np.exp(-np.arange(200) / 60.0))
    joints = build_mechanism(bench().machine).inverse(torch.as_tensor(target)).numpy()
    growth = np.array([1.6e-5, 1.1e-5, 0.7e-5]) * (warm - 20.0)[:, None] * (joints - bearing)
    error = random.normal(0.0, NOISE, target.shape)
    found = told_of(stated(), target, error, growth, temp_c=warm, time_s=5.0 * np.arange(200))
    assert found.verdict == "missing"
    assert [names[0] for names in found.suggested] == ["screw-growth"]


def test_a_screw_that_would_grow_more_than_any_material_is_asked_about_beside_the_unknown() -> None:
    random = np.random.default_rng(7)
    target = random.uniform((-60.0, -60.0, -50.0), (60.0, 60.0, 50.0), (200, 3))
    joints = build_mechanism(stated().machine).inverse(torch.as_tensor(target)).numpy()
    warm = np.linspace(20.0, 25.0, 200) + random.normal(0.0, 0.3, 200)
    growth = np.zeros((200, 3))
    growth[:, 0] = 8e-4 * (warm - 20.0) * (joints[:, 0] - 290.0)  # 70 times as steel
    error = random.normal(0.0, NOISE, (200, 3))
    found = told_of(stated(), target, error, growth, temp_c=warm, time_s=5.0 * np.arange(200))
    assert found.verdict == "unknown" and not found.suggested
    assert found.oversized == ("screw-growth",) and "screw-growth" in found.perhaps
    assert "could be screw-growth, at a size" in found.words
    assert found.candidates[0].effect == "screw-growth"


def test_repeats_that_scatter_are_no_reason_beside_an_unknown_that_was_found() -> None:
    draws = np.random.default_rng(3)
    pose = np.round(draws.uniform(-60.0, 60.0, (60, 3)), 3)
    place = pose[np.concatenate([draws.permutation(60) for _ in range(3)])]
    error = draws.normal(0.0, 1.4 * NOISE, place.shape) + 0.05 * np.sin(place[:, :1] / 25.0) * [0.0, 0.0, 1.0]
    found = told_of(stated(), place, error, np.zeros_like(place))
    assert (found.verdict, found.rest.reasons) == ("unknown", ())


def test_visits_that_err_by_far_more_than_their_readings_are_told_beside_a_name_too() -> None:
    draws = np.random.default_rng(3)
    place = np.repeat(np.round(draws.uniform(-60.0, 60.0, (100, 3)), 3), 3, axis=0)
    joints = build_mechanism(stated().machine).inverse(torch.as_tensor(place)).numpy()
    way = np.sign(np.repeat(np.diff(joints[::3], axis=0, prepend=joints[:1]), 3, axis=0))
    error = np.repeat(draws.normal(0.0, 5.0 * NOISE, (100, 3)), 3, axis=0) + draws.normal(0.0, NOISE, place.shape)
    bare = replace(stated(), tracker=stated().tracker.model_copy(update={"sigma_mm": None}))
    for file in (stated(), bare):
        found = told_of(file, place, error, -0.1 * way)
        assert (found.verdict, [step[0] for step in found.suggested]) == ("unknown", ["backlash"])
        assert any("poses repeat no better" in reason for reason in found.rest.reasons)
