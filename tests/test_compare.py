"""A run held against a model: figures, frames, noise, lack of fit, gross errors, dependences, text, JSON, pictures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ptt.effects.registry import library, make_effect
from ptt.judge.compare.comparison import AXES, compare_run, figures
from ptt.judge.compare.text import format_comparison
from ptt.machine import parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.show.plots.periods import joint_periods

DATA = Path(__file__).resolve().parents[1] / "data"
NOISE = 0.004  # mm
BENCH = """
[machine]
kind = "three-ptt"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
screw_lead_mm = 5
platform_mass_kg = 1
"""


def machine(frame="trusted", sigma=None, more=""):
    sigma_line = "" if sigma is None else f"sigma_mm = {sigma}\n"
    return parse_machine(f'{BENCH}\n[tracker]\nframe = "{frame}"\n{sigma_line}{more}', "bench.toml")


def places(n, seed=0):
    return np.random.default_rng(seed).uniform([-60, -60, -50], [60, 60, 50], (n, 3))


def turned(points, vector=(0.1, -0.2, 0.3), shift=(500.0, -200.0, 80.0)):
    angle = np.linalg.norm(vector)
    x, y, z = np.array(vector) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return points @ matrix.T + shift


def held(file, table, **more):
    return compare_run(Model(file), build_problem(file, table), **more)


def moved_sliders(file, target, change, **columns):
    """A run whose sliders stand off by change(q, direction), and its problem's view of direction."""
    problem = build_problem(file, make_table(target, measured=target, **columns))
    q, direction = problem.view.q.numpy(), problem.view.direction.numpy()
    real = build_mechanism(file.machine).forward(torch.as_tensor(q + change(q, direction))).numpy()
    return make_table(target, measured=real, **columns)


def with_noise(table, seed=1, sigma=NOISE):
    scatter = np.random.default_rng(seed).normal(0.0, sigma, table.measured.shape)
    return table.replace(measured=table.measured + scatter)


def test_known_errors_give_known_figures():
    target = places(80)
    error = np.column_stack([np.full(80, 0.01), np.where(np.arange(80) % 2, 0.03, -0.01), np.zeros(80)])
    error[[3, 30, 31, 62], 2] = 0.02
    result = held(machine(sigma=0.002), make_table(target, measured=target + error))
    data = result.to_dict()
    assert result.rows == data["rows"] == 80
    np.testing.assert_allclose(
        [data["rms_um"][axis] for axis in AXES], [10.0, np.sqrt(500.0), np.sqrt(20.0)], rtol=1e-6
    )
    np.testing.assert_allclose([data["mean_um"][axis] for axis in AXES], [10.0, 20.0, 1.0], rtol=1e-6)
    np.testing.assert_allclose([data["bias_um"][axis] for axis in AXES], [10.0, 10.0, 1.0], rtol=1e-6)
    np.testing.assert_allclose([data["max_um"][axis] for axis in AXES], [10.0, 30.0, 20.0], rtol=1e-6)
    assert data["p95_um"]["y"] == pytest.approx(30.0)
    assert data["rms_um"]["total"] == pytest.approx(np.sqrt(100.0 + 500.0 + 20.0))
    assert data["length_um"]["max_um"] == pytest.approx(1e3 * np.linalg.norm(error, axis=1).max())
    assert data["frame_removed_um"]["total"] == pytest.approx(0.0, abs=1e-6)
    assert data["raw_um"]["rms_um"] == pytest.approx(data["rms_um"], rel=1e-6)
    assert data["noise_um"]["total"] == pytest.approx(2.0 * np.sqrt(3.0))
    assert data["noise_um"]["source"] == "machine file"
    assert data["explainable_share"] == pytest.approx(1.0 - 12.0 / 620.0)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 3), min_size=1, max_size=30))
def test_figures_are_ordered_and_totals_add_up(rows):
    found = figures(np.array(rows))
    for axis in AXES:
        assert abs(found["bias_um"][axis]) <= found["mean_um"][axis] + 1e-9
        assert found["mean_um"][axis] <= found["rms_um"][axis] + 1e-9
        assert found["rms_um"][axis] <= found["max_um"][axis] + 1e-9
        assert found["p95_um"][axis] <= found["max_um"][axis] + 1e-9
    for values in found.values():
        assert values["total"] == pytest.approx(np.sqrt(sum(values[axis] ** 2 for axis in AXES)))


def test_text_gives_the_length_of_error_vectors_not_the_sum_of_axes_that_peak_in_different_rows():
    target = places(40)
    error = np.zeros((40, 3))
    error[::2, 0], error[1::2, 1] = 0.03, -0.04
    text = format_comparison(held(machine(sigma=0.002), make_table(target, measured=target + error)))
    ends = {name: text.split(name, 1)[1].splitlines()[0].split()[-1] for name in ("largest", "mean |error|")}
    assert ends == {"largest": "40.0", "mean |error|": "35.0"}
    assert next(line for line in text.splitlines() if line.rstrip().endswith("length"))


def test_slider_errors_are_those_that_were_made():
    file, made = machine(), np.array([0.02, -0.03, 0.05])
    table = moved_sliders(file, places(60), lambda q, direction: made)
    data = held(file, table).to_dict()["slider_um"]
    for index, value in enumerate(1e3 * made):
        assert data[f"slider {index + 1}"]["bias_um"] == pytest.approx(value, abs=0.05)


def test_fitted_frame_takes_a_rigid_motion_and_nothing_else():
    target = places(200)
    error = np.random.default_rng(2).normal(0.0, NOISE, target.shape)
    result = held(machine("fitted", NOISE), make_table(target, measured=turned(target + error)))
    data = result.to_dict()
    assert "most of the error is the tracker's own position" in format_comparison(
        result
    )  # what the large figures before alignment are
    assert data["rms_um"]["total"] == pytest.approx(1e3 * NOISE * np.sqrt(3.0), rel=0.1)
    motion = turned(target) - target
    np.testing.assert_allclose(
        [data["frame_removed_um"][axis] for axis in AXES], 1e3 * np.sqrt(np.square(motion).mean(axis=0)), rtol=1e-3
    )
    assert data["raw_um"]["rms_um"]["total"] > 4e5
    assert data["unaligned_um"]["rms_um"] == pytest.approx(data["raw_um"]["rms_um"], rel=1e-9)
    trusted = held(machine("trusted", NOISE), make_table(target, measured=turned(target + error))).to_dict()
    assert trusted["rms_um"] == pytest.approx(data["raw_um"]["rms_um"], rel=1e-6)


def test_each_run_has_its_frame_only_where_the_file_says_so():
    target, run = places(120), np.repeat([0, 1], 60)
    measured = np.where((run == 0)[:, None], target, turned(target, (0.0, 0.0, 1e-3), (0.3, 0.0, 0.0)))
    table = with_noise(make_table(target, measured=measured, run=run))
    assert held(machine("fitted-per-run", NOISE), table).to_dict()["rms_um"]["total"] < 10.0
    assert held(machine("fitted", NOISE), table).to_dict()["rms_um"]["total"] > 50.0


def test_measured_frame_keeps_an_offset_that_a_fitted_one_swallows():
    drawn = np.array([[380.0, 140, -220], [-390, 180, -210], [-120, -410, -230], [260, 330, 420]])
    points = "".join(
        f'[[tracker.base_point]]\nname = "base {i + 1}"\nxyz_mm = {list(place)}\nsigma_mm = 0.0001\n'
        for i, place in enumerate(drawn.tolist())
    )
    target, blank = places(12), np.full((4, 3), np.nan)
    table = make_table(
        np.concatenate([blank, target]),
        measured=turned(np.concatenate([drawn, target + np.array([0.0, 0.0, 0.05])])),
        role=np.array(["base"] * 4 + ["pose"] * 12),
        name=np.array([f"base {i + 1}" for i in range(4)] + [""] * 12),
    )
    measured = held(machine("measured", NOISE, points), table).to_dict()
    assert measured["rows"] == 12
    assert measured["base_frame_um"]["bias_um"]["z"] == pytest.approx(50.0, abs=0.1)
    assert measured["bias_um"]["z"] > 5.0
    fitted = held(machine("fitted", NOISE), table).to_dict()
    assert fitted["rms_um"]["total"] < 1.0
    assert fitted["raw_um"] == measured["raw_um"]
    assert fitted["base_frame_um"] is None


def test_errors_of_a_compensated_run_are_judged_against_both_target_and_model():
    file, target = machine(), places(40)
    command = build_mechanism(file.machine).inverse(torch.as_tensor(target + np.array([0.1, 0.0, 0.0]))).numpy()
    data = held(file, make_table(target, command, target)).to_dict()
    assert data["raw_um"]["rms_um"]["x"] == pytest.approx(0.0, abs=1e-9)
    assert data["bias_um"]["x"] == pytest.approx(-100.0, abs=1e-3)


def test_model_with_its_effect_leaves_less():
    file, gap = machine("fitted", NOISE), 0.06
    table = with_noise(moved_sliders(file, places(150), lambda q, direction: -gap / 2 * direction))
    problem = build_problem(file, table)
    play = torch.tensor([gap, gap, gap, 1.0], dtype=torch.float64)
    model = Model(file) + Term(make_effect(library(), "backlash"), play)
    bare, fitted = compare_run(Model(file), problem), compare_run(model, problem)
    assert bare.to_dict()["rms_um"]["total"] > 4.0 * fitted.to_dict()["rms_um"]["total"]
    assert fitted.effects == ("backlash",)
    waiting = compare_run(Model(file) + make_effect(library(), "backlash"), problem)
    assert waiting.without_values == ("backlash",)
    np.testing.assert_allclose(waiting.residual, bare.residual, atol=1e-9)


def test_lack_of_fit_sees_a_miss_and_is_silent_about_noise():
    target = np.tile(places(30), (5, 1))
    chances = [
        held(machine(), with_noise(make_table(target, measured=target), seed)).lack_of_fit.p_value for seed in range(12)
    ]
    assert min(chances) > 1e-3
    assert np.mean(np.array(chances) < 0.2) < 0.7  # chances are spread, not all small
    missed = held(machine(), with_noise(make_table(target, measured=target + 0.004 * np.sin(target / 20)), 0))
    assert missed.lack_of_fit.p_value < 1e-6
    assert missed.noise.source == "repeats"
    assert missed.lack_of_fit.freedom[0] >= 30 and missed.lack_of_fit.freedom[1] >= 30


def test_without_repeats_lack_of_fit_and_noise_say_that_they_do_not_know():
    target = places(50)
    result = held(machine(), with_noise(make_table(target, measured=target)))
    data = result.to_dict()
    assert data["lack_of_fit"]["p_value"] is None
    assert "30 are needed" in data["lack_of_fit"]["untested_because"]
    assert data["noise_um"] == {"x": None, "y": None, "z": None, "total": None, "source": "unknown"}
    assert data["explainable_share"] is None
    assert "unknown" in format_comparison(result)
    told = held(machine(), with_noise(make_table(target, measured=target)), noise=Noise(np.eye(3) * NOISE**2, "told"))
    assert told.to_dict()["noise_um"]["source"] == "told"
    assert told.explainable_share < 0.3


def test_lone_far_reading_is_left_out_and_a_place_that_fails_each_time_is_not():
    target = np.tile(places(40), (4, 1))
    table = with_noise(make_table(target, measured=target))
    wrong = table.measured.copy()
    wrong[17] += [1.0, -2.0, 0.5]  # a broken beam
    wrong[[7, 47, 87, 127]] += [0.15, 0.0, 0.0]  # all visits of pose 7
    result = held(machine("fitted", NOISE), table.replace(measured=wrong))
    assert [row.line for row in result.outliers] == [19]
    assert result.outliers[0].size == pytest.approx(np.linalg.norm([1.0, -2.0, 0.5]), abs=0.02)
    assert result.rows == 159
    assert 100.0 < result.to_dict()["max_um"]["x"] < 200.0
    assert {row.line for row in result.where.rows[:4]} == {9, 49, 89, 129}
    assert "1 more left out as gross errors" in format_comparison(result)


def test_no_digit_of_a_large_error_is_cut_off():
    target, far = places(40), np.array([10500.0, 4321.0, 7.5])
    text = format_comparison(held(machine("trusted", NOISE), make_table(target, measured=target + far)))
    row = next(line for line in text.splitlines() if line.startswith("measured minus target"))
    assert row.split()[-4:] == ["10500000.0", "4321000.0", "7500.0", f"{1e3 * np.linalg.norm(far):.1f}"]


def test_what_it_depends_on_names_the_slider_and_the_screw():
    file, lead = machine("fitted", NOISE), 5.0
    wobble = lambda q, direction: np.column_stack([0 * q[:, 0], 0.03 * np.sin(2 * np.pi * q[:, 1] / lead), 0 * q[:, 2]])  # noqa: E731
    table = with_noise(moved_sliders(file, places(300), wobble))
    problem = build_problem(file, table)
    result = compare_run(Model(file), problem)
    first = result.to_dict()["depends_on"][0]
    assert (first["residual"], first["on"]) == ("slider 2", "b2")
    assert first["period_mm"] == pytest.approx(lead, rel=0.01)
    assert first["share"] > 0.7
    assert joint_periods(result, problem, "slider 2").best == pytest.approx(lead, rel=0.01)
    quiet = joint_periods(result, problem, "slider 1")
    assert quiet.share.max() < 0.3
    shares = [item["share"] for item in result.to_dict()["depends_on"][1:]]
    assert shares == sorted(shares, reverse=True)


def test_noise_depends_on_nothing_and_the_text_says_so():
    silent = 0
    for seed in range(12):
        target = places(150, seed)
        result = held(machine("fitted", NOISE), with_noise(make_table(target, measured=target), seed + 100))
        text = format_comparison(result)
        assert "no more than noise" in text
        assert ("depends on no recorded variable" in text) == (not result.depends_on)
        silent += not result.depends_on
    assert silent >= 11  # one false alarm in 200 runs is allowed


def test_text_names_side_payload_and_units():
    file, target = machine("fitted", NOISE), places(160)
    load = np.where(np.arange(160) % 2, 0.0, 3.0)
    table = with_noise(moved_sliders(file, target, lambda q, direction: -0.03 * direction, payload_kg=load))
    text = format_comparison(held(file, table))
    assert "error in um" in text and "mean arriving up" in text and "by payload, rms: 0 kg" in text
    line = next(line for line in text.splitlines() if line.startswith("slider 1"))
    up, down, gap = (float(word) for word in line.split()[-3:])
    assert up < -20.0 and down > 20.0
    assert gap == pytest.approx(up - down, abs=0.11)
    assert max(len(line) for line in text.splitlines()) <= 130
    assert "where the tracker stands" not in text


def test_names_in_brackets_are_printed_as_they_are():
    """'[/4]' ended the command, and 'P[a]' was printed as 'P'."""
    file, target = machine(sigma=NOISE), places(12)
    table = make_table(target, measured=target + 0.1, name=np.array([f"P[a]{i}" for i in range(11)] + ["[/4]"]))
    text = format_comparison(held(file, replace(table, source="run[b].csv")))
    assert "12 readings of run[b].csv" in text and "P[a]8" in text
    table = replace(table, measured=target + np.where(np.arange(12) == 11, 0.2, 0.1)[:, None])
    assert "[/4]" in format_comparison(held(file, table))


def test_serial_arm_speaks_of_joints():
    from ptt.machine import load_machine

    file = load_machine(DATA / "machines" / "ur10.toml")
    mechanism = build_mechanism(file.machine)
    q = torch.as_tensor(mechanism.home()) + torch.as_tensor(np.random.default_rng(3).uniform(-0.5, 0.5, (60, 6)))
    off = torch.tensor([2e-4, 0.0, 0.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    real = mechanism.forward(q + off).numpy()
    problem = build_problem(file, make_table(None, q.numpy(), real, joint_prefix="q"))
    result = compare_run(Model(file), problem)
    assert set(result.to_dict()["joint_urad"]) == {f"joint {i + 1}" for i in range(6)}
    text = format_comparison(result)
    assert "joints, urad" in text and "mean arriving forward" in text
