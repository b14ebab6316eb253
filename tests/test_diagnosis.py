"""The diagnosis on rigs that share nothing with the effects: right when something is there, silent when nothing is."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from scipy.ndimage import gaussian_filter1d
from typer.testing import CliRunner

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.truth import table_of
from ptt.commands.main import app
from ptt.diagnosis.evidence import noise_level as noise
from ptt.diagnosis.noise.wander import Clock, Wander, innovations
from ptt.diagnosis.search.rest import Rest, with_objections
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.enough import enough
from ptt.diagnosis.telling.explanation import Candidate
from ptt.diagnosis.telling.floor import noise_floor
from ptt.diagnosis.telling.verdict import diagnose
from ptt.door.diagnosing import format_diagnosis
from ptt.effects import library
from ptt.errors import TableError
from ptt.fitting.projected import gain, project
from ptt.machine import format_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig import parse_rig
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate, write_run
from ptt.run.noise import VISITED, Noise
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table, take_rows

MACHINE = bench_machine()


def run(folder, level: str, seed: int, *, rows: int = 300, fault: str | None = None, **tracker: float):
    drawn = draw_rig(level, seed, MACHINE, rows=rows, fault=fault)
    rig = drawn.rig
    if tracker:
        rig = replace(rig, tracker=rig.tracker.model_copy(update=tracker))
    path = folder / f"{level}{seed}.csv"
    write_run(simulate(rig, drawn.targets).frame, path)
    return drawn, path


def learn(folder, *arguments, **options) -> tuple[dict, Diagnosis]:
    drawn, path = run(folder, *arguments, **options)
    return drawn.truth, diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))


@pytest.mark.parametrize(
    ("fault", "seed"),
    [
        ("homing-offset", 11),
        ("screw-error-map", 12),
        ("once-per-rev", 13),
        ("backlash", 14),
        ("windup", 15),
        ("following-error", 16),
        pytest.param("axis-compliance", 17, marks=pytest.mark.long),
        ("tower-position", 18),
        pytest.param("link-length", 19, marks=pytest.mark.long),
        ("guide-straightness", 20),
        pytest.param("joint-clearance", 21, marks=pytest.mark.long),
        ("platform-twist", 22),
        pytest.param("column-bend", 23, marks=pytest.mark.long),
        ("tracker-drift", 24),
        ("setup-jump", 25),
    ],
)
def test_one_hidden_effect_is_named_first(tmp_path, fault, seed):
    truth, found = learn(tmp_path, "single", seed, fault=fault)
    assert list(truth) == [fault]
    assert found.verdict == "missing"
    assert found.suggested[0][0] == fault
    assert len(found.suggested[0]) <= 4
    assert found.rms_um["after"]["total"] < 1.25 * found.noise.total * 1e3


def rough_screw(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Heights, and what a screw is off by there, mm: it drifts along its length and is wavy over a few millimetres."""
    random, height = np.random.default_rng(seed), np.arange(180.0, 380.0, 0.25)
    drift = gaussian_filter1d(random.normal(size=len(height)).cumsum(), 40)
    drift -= np.polyval(np.polyfit(height, drift, 1), height)
    waves = gaussian_filter1d(random.normal(size=len(height)), 10)
    return height, 0.01 * drift / drift.std() + 0.004 * waves / waves.std()


@pytest.mark.parametrize("lasts", [2, 3])
def test_scatter_that_a_few_rows_share_is_no_noise_of_a_tracker(lasts):
    """A reflector that is seated anew every few rows, four times as far off as the noise that is stated."""
    random, mechanism = np.random.default_rng(lasts), build_mechanism(MACHINE.machine)
    targets = random.uniform(-60.0, 60.0, (120, 3))
    command = mechanism.inverse(torch.as_tensor(targets)).numpy()
    seat = np.repeat(random.normal(0.0, 0.016, (120 // lasts, 3)), lasts, axis=0)
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"sigma_mm": 0.004}))
    measured = targets + seat + random.normal(0.0, 0.004, targets.shape)
    table = make_table(targets, command, measured=measured, time_s=5.0 * np.arange(120))
    assert diagnose(Model(file), build_problem(file, table)).verdict == "unknown"


def told_of_screws(off) -> Diagnosis:
    """What is said of 240 poses of a machine whose screws are off by a function of their heights (n, 3), mm."""
    random, mechanism = np.random.default_rng(4), build_mechanism(MACHINE.machine)
    targets = random.uniform(-60.0, 60.0, (240, 3))
    command = mechanism.inverse(torch.as_tensor(targets)).numpy()
    reached = mechanism.forward(torch.as_tensor(command + off(command))).numpy()
    measured = reached + random.normal(0.0, 0.003, (240, 3))
    return diagnose(Model(MACHINE), build_problem(MACHINE, make_table(targets, command, measured=measured)))


def test_a_rough_screw_is_a_screw_and_nothing_else():
    found = told_of_screws(lambda q: np.stack([np.interp(q[:, i], *rough_screw(i)) for i in range(3)], axis=1))
    assert found.verdict == "missing" and found.suggested == (("screw-error-map",),)


@pytest.mark.parametrize(
    ("damage", "shape"),
    [(lambda q: 0.02 * (q > 290.0), "step"), (lambda q: 0.04 * np.exp(-np.square((q - 300.0) / 3.0)), "bump")],
)
def test_a_splice_or_a_spot_of_one_screw_is_no_rough_screw(damage, shape):
    found = told_of_screws(lambda q: damage(q) * [1.0, 0.0, 0.0])
    assert found.verdict == "unknown" and found.suggested == ()
    first = found.depends_on[0]
    assert (first.residual, first.on, first.shape) == ("slider 1", "b1", shape)


def test_a_period_that_is_no_turn_of_the_screw_is_no_rough_screw():
    found = told_of_screws(lambda q: 0.012 * np.sin(2.0 * np.pi * q / 7.0) * [1.0, 0.0, 0.0])
    assert found.verdict == "unknown" and found.suggested == ()
    assert found.depends_on[0].residual == "slider 1" and found.depends_on[0].period_mm == pytest.approx(7.0, abs=0.1)


def test_silent_where_nothing_is_hidden(tmp_path):
    verdicts = [learn(tmp_path, "none", seed)[1].verdict for seed in range(40, 52)]
    assert verdicts.count("nothing-missing") >= 11


@pytest.mark.parametrize("understated", [1.0, 3.0])
def test_noise_that_is_stated_too_small_follows_nothing_and_it_is_said(tmp_path, understated):
    """More than twice a stated noise is never nothing; but no variable is blamed that says less than chance."""
    _, path = run(tmp_path, "none", 11, rows=120)
    table = read_table(path)
    scatter = diagnose(Model(MACHINE), build_problem(MACHINE, table)).rms_um["after"]
    sigma = [1e-3 * scatter[axis] / understated for axis in "xyz"]
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table.replace(std=np.tile(sigma, (table.rows, 1)))))
    assert found.suggested == () and found.depends_on == ()
    assert found.verdict == ("nothing-missing" if understated < 2.0 else "unknown")
    assert ("understates the scatter" in found.words) == (understated > 2.0)


@pytest.mark.parametrize(
    ("readings", "comes_back", "verdict"),
    [(3, False, "nothing-missing"), (1, False, "nothing-missing"), (1, True, "unknown")],
)
def test_scatter_from_visit_to_visit_is_no_fault_unless_it_comes_back(readings, comes_back, verdict):
    """Sixty poses, each read three times at one visit, or once at each of three; 8 um of a visit over a noise of 3."""
    random = np.random.default_rng(5)
    place = np.round(random.uniform([-50.0, -50.0, 0.0], [50.0, 50.0, 60.0], (60, 3)), 3)
    place = np.repeat(place, readings, axis=0) if readings > 1 else np.tile(place, (3, 1))
    visits = len(place) // readings
    error = random.normal(0.0, 0.008, (visits, 3))
    error = np.tile(error[:60], (3, 1)) if comes_back else np.repeat(error, readings, axis=0)
    read = place + error + random.normal(0.0, 0.003, place.shape)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, make_table(place, measured=read)))
    assert (found.verdict, found.suggested) == (verdict, ())
    if not comes_back:
        assert found.noise.total == pytest.approx(np.hypot(0.008, 0.003) * np.sqrt(3.0), rel=0.1)
        assert found.noise.source == ("repeats" if readings == 1 else VISITED)
        assert ("come back to some poses" in found.words) == (readings > 1)
    if readings > 1:  # what a tracker states of a held pose says nothing of visits either
        stated = make_table(place, measured=read, std=np.full(place.shape, 0.0035))
        found = diagnose(Model(MACHINE), build_problem(MACHINE, stated))
        assert (found.verdict, found.noise.source) == ("nothing-missing", "std columns")


def test_what_speaks_against_an_explanation_is_said_whichever_it_is():
    left, stated = (Noise(np.eye(3) * size**2, "std columns") for size in (0.03, 0.01))
    sound = Rest((), ())
    assert with_objections(sound, True, (), left, None) == sound == with_objections(sound, True, (), stated, stated)
    reasons = with_objections(sound, False, ("backlash", "windup"), left, stated).reasons
    assert reasons[0].startswith("the readings ask for backlash and windup") and reasons[1].startswith(
        "3.0 x the noise"
    )
    assert (
        with_objections(sound, False, (), stated, stated)
        .reasons[0]
        .startswith("hidden readings are foretold far worse")
    )


def test_readings_that_their_frames_take_are_too_few(tmp_path):
    """Thirteen readings of three set-ups leave 21 numbers; in one frame they leave 33, as many as twelve need."""
    _, path = run(tmp_path, "none", 11, rows=60)
    table = take_rows(table := read_table(path), np.flatnonzero(table.observed & (table.role == "pose"))[:13])
    set_ups = table.replace(run=np.arange(13) // 5, run_label=("a", "b", "c"))
    own = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "fitted-per-run"}))
    enough(build_problem(MACHINE, set_ups))
    with pytest.raises(TableError, match="13 readings in 3 frames are too few"):
        enough(build_problem(own, set_ups))
    enough(build_problem(own, table.replace(run=np.arange(13) // 12, run_label=("a", "b"))))


def test_silent_on_few_rows_and_among_gross_errors(tmp_path):
    few = [learn(tmp_path, "none", seed, rows=60)[1] for seed in range(60, 66)]
    assert [item.verdict for item in few].count("nothing-missing") >= 5
    spoiled = [learn(tmp_path, "none", seed, outlier_share=0.05)[1] for seed in range(70, 76)]
    assert [item.verdict for item in spoiled].count("nothing-missing") >= 5
    assert all(item.outliers.sum() >= 5 for item in spoiled)


@pytest.mark.long
def test_slow_wander_is_no_machine_error(tmp_path):
    machine = {name for name, cls in library().items() if cls.stage != "metrology"}
    for seed in range(80, 84):
        _, found = learn(tmp_path, "none", seed, wander_um=5.0, wander_s=900.0)
        assert not {step[0].partition("[")[0] for step in found.suggested} & machine


def test_a_wave_in_the_readings_of_one_axis_is_no_wander(tmp_path):
    """A beam that bends lifts far readings slowly up and down by three times their scatter, and moves nothing else."""
    _, path = run(tmp_path, "none", 86)
    frame = pd.read_csv(path)
    wave = 0.03 * np.sin(2.0 * np.pi * frame["time_s"] / (0.4 * np.ptp(frame["time_s"])) + 1.0)
    frame["z_meas"] += wave * (1.0 + 0.002 * frame["x_meas"])
    frame.to_csv(path, index=False)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))
    assert found.verdict == "unknown" and found.verdict_probability["unknown"] > 0.9
    assert (found.depends_on[0].residual, found.depends_on[0].on) == ("z", "time")


def test_a_slip_between_the_moments_that_a_search_tries_is_dated_to_the_row(tmp_path):
    """One row on the wrong side of a jump is as far off as the jump: nothing may be named to make good for it."""
    forward, row = build_mechanism(MACHINE.machine).forward, 102
    for seed in (87, 88):
        _, path = run(tmp_path, "none", seed, rows=190, heavy_dof=3.0)
        frame = pd.read_csv(path)
        heights = torch.tensor(frame[["b1_cmd", "b2_cmd", "b3_cmd"]].to_numpy())
        slip = torch.tensor([0.0, 0.08, 0.0]) * torch.tensor(np.arange(len(frame)) > row)[:, None]
        frame[["x_meas", "y_meas", "z_meas"]] += (forward(heights + slip) - forward(heights)).numpy()
        frame.to_csv(path, index=False)
        problem = build_problem(MACHINE, read_table(path))
        found = diagnose(Model(MACHINE), problem)
        assert (found.verdict, found.suggested) == ("missing", (("homing-slip",),))
        assert float(found.model.terms[0].theta[-1]) == pytest.approx(float(problem.view.time[row]))


def test_unknown_fault_is_not_forced_into_the_library(tmp_path):
    truth, found = learn(tmp_path, "unknown", 122, fault="guide-damage")
    assert "guide-damage" in truth
    assert found.verdict == "unknown"
    slider = found.depends_on[0].on
    assert slider.startswith("b")
    low, high = found.depends_on[0].place
    assert high - low < 40.0


def test_a_floor_that_can_be_told_no_finer_is_the_last_that_could(tmp_path, monkeypatch):
    """Under readings of half a micrometre a saturated model sees every curve it has, and keeps no row to scatter."""
    _, path = run(tmp_path, "none", 90, rows=60)
    problem = replace(build_problem(MACHINE, read_table(path)), noise=None)
    rounds = [Noise(np.eye(3) * 1e-6, "saturated model", 30.0), Noise(np.eye(3) * 1e-7, "saturated model", 5.0)]
    monkeypatch.setattr(noise, "_saturated", lambda *given: (left.pop(0), {}))
    left = rounds.copy()
    assert noise.saturated_floor(Model(MACHINE), problem, library()) is rounds[0]
    left = rounds[::-1]
    with pytest.raises(TableError, match="do not tell the noise"):
        noise.saturated_floor(Model(MACHINE), problem, library())


def test_thirty_six_readings_that_are_diagnosed_tell_what_they_scatter_by_too():
    """Everything at once leaves so few readings no freedom; what was found in them does, so that it can be added."""
    drawn, truth = draw(plan("single", 1, 960029, noise="white", bench=None, rows=36, visible=True)[0])
    frame = simulate(drawn.rig, drawn.targets).frame
    problem = replace(build_problem(drawn.rig.machine, table_of(frame, drawn.absent)), noise=None)
    with pytest.raises(TableError, match="do not tell the noise"):
        noise.saturated_floor(Model(drawn.rig.machine), problem, library())
    assert noise_floor(Model(drawn.rig.machine), problem, library()).total == pytest.approx(truth.noise.total, rel=0.2)
    sparse = problem.masked(np.arange(problem.table.rows) >= 10)
    with pytest.raises(TableError, match="do not tell the noise"):
        noise_floor(Model(drawn.rig.machine), sparse, library())


def test_two_effects_are_both_found(tmp_path):
    truth, found = learn(tmp_path, "multi", 2013)
    picks = [set(step) for step in found.suggested]
    assert all(any(name in step for step in picks) for name in truth)
    assert len(found.suggested) == len(truth)


def test_play_is_named_on_a_path_that_takes_it_up_over_many_rows(tmp_path):
    """Near its turns a slider on a fine circle moves by less than the gap from row to row."""
    angle = np.linspace(0.0, 8.0 * np.pi, 400)
    circle = np.column_stack([10.0 * np.cos(angle), 10.0 * np.sin(angle), np.linspace(-8.0, 8.0, 400)]).round(3)
    drive = {"backlash_mm": [0.09, 0.06, 0.012], "homing_mm": [0.3, -0.2, 0.05]}
    rig = parse_rig({"machine": MACHINE.machine.model_dump(), "seed": 3, "drive": drive})
    frame = simulate(rig, pd.DataFrame(circle, columns=["x_cmd", "y_cmd", "z_cmd"]), noise=False).frame
    frame[["x_meas", "y_meas", "z_meas"]] += np.random.default_rng(5).normal(0.0, 0.005, circle.shape)
    write_run(frame, tmp_path / "circle.csv")
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(tmp_path / "circle.csv")))
    assert found.verdict == "missing" and {step[0] for step in found.suggested} == {"backlash", "homing-offset"}
    gaps = [value for name, _, value, _ in found.candidates[0].parameters if name.startswith("gap")]
    assert gaps == pytest.approx(drive["backlash_mm"], abs=0.003)


def test_json_holds_what_is_documented(tmp_path):
    _, path = run(tmp_path, "single", 14, fault="backlash")
    model = tmp_path / "machine.toml"
    model.write_text(format_machine(MACHINE))
    outcome = CliRunner().invoke(app, ["diagnose", str(path), "--model", str(model), "--json"])
    assert outcome.exit_code == 0, outcome.output
    data = json.loads(outcome.stdout)
    assert data["verdict"] == "missing"
    assert data["suggested"][0][0] == "backlash"
    first = data["candidates"][0]
    assert first["effect"] == "backlash"
    assert first["heldout_rms_um"]["after"] < first["heldout_rms_um"]["before"]
    assert {"name", "unit", "value", "std"} <= set(first["parameters"][0])
    for key in ("not_testable", "depends_on", "measure_next", "noise_um", "rows"):
        assert key in data
    assert "backlash" in data["words"]


def test_what_the_data_cannot_test_is_listed_with_its_need(tmp_path):
    _, found = learn(tmp_path, "none", 41)
    assert "payload" in found.not_testable["column-bend"]


def test_projected_gain_is_what_a_fit_gains():
    random = np.random.default_rng(2)
    columns, values = random.normal(size=(240, 7)), random.normal(size=240)
    first, second = np.arange(4), np.arange(4, 7)
    took = gain(project(columns.T @ columns, columns.T @ values, float(values @ values), first), second)
    left = [np.linalg.lstsq(columns[:, chosen], values)[1].item() for chosen in (first, np.arange(7))]
    assert took == pytest.approx(left[0] - left[1], rel=1e-9)


def test_innovations_of_no_columns_are_none_and_lapack_is_not_asked(monkeypatch):
    """Of zero columns LAPACK solves for the first one all the same, in memory that belongs to somebody else."""
    monkeypatch.setattr("ptt.diagnosis.noise.gains.lapack.dgtsv", lambda *args, **options: pytest.fail("asked"))
    clock = Clock(np.arange(40.0), np.arange(40) == 0)
    assert innovations(np.zeros((40, 3, 0)), Wander(0.5, 10.0), clock)[0].shape == (40, 3, 0)


def test_innovations_of_a_wander_are_white_and_cost_its_determinant():
    random = np.random.default_rng(4)
    time = np.cumsum(random.uniform(5.0, 40.0, 400))
    clock = Clock(time, np.arange(400) % 150 == 0)
    wander = Wander(4.0, 900.0)
    run = np.cumsum(clock.starts)
    alike = np.where(run[:, None] == run, 4.0 * np.exp(-np.abs(time[:, None] - time) / 900.0), 0.0)
    covariance = alike + np.eye(400)
    values = np.linalg.cholesky(covariance) @ random.normal(size=(400, 3))
    white, log_noise = innovations(values, wander, clock)
    assert np.square(white).sum() == pytest.approx(np.einsum("ia,ij,ja->", values, np.linalg.inv(covariance), values))
    assert log_noise == pytest.approx(1.5 * np.linalg.slogdet(covariance)[1])
    assert abs(np.mean(white[1:] * white[:-1])) < 0.08


def test_a_sum_that_mimics_the_tracker_s_unit_of_length_is_said(tmp_path):
    drawn = draw_rig("none", 90, MACHINE, "volume")
    tracker = drawn.rig.tracker.model_copy(update={"scale_ppm": 150.0})
    path = tmp_path / "stretched.csv"
    write_run(simulate(replace(drawn.rig, tracker=tracker), drawn.targets).frame, path)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))
    assert [step[0] for step in found.suggested] == ["tracker-scale"]
    assert set(found.candidates[0].sum_of) == {"lead-scale", "tower-position", "link-length"}
    assert "together would do the same" in found.words


def test_no_sum_mimics_what_nothing_else_looks_like(tmp_path):
    _, found = learn(tmp_path, "single", 14, fault="backlash")
    assert found.candidates[0].sum_of == ()


@pytest.mark.long
def test_a_hose_that_pulls_from_one_side_is_not_told_as_many_effects(tmp_path):
    truth, found = learn(tmp_path, "unknown", 301, fault="hose")
    assert "hose" in truth
    assert found.verdict == "unknown"
    assert found.depends_on[0].on in ("x", "y", "z")
    assert len(found.suggested) <= len(truth)


@pytest.mark.long
def test_a_path_cut_short_says_that_more_is_missing(tmp_path):
    drawn, path = run(tmp_path, "multi", 2013)
    assert len(drawn.truth) > 1
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)), steps=1)
    assert found.verdict == "unknown"
    # The tangent asked for a wind-up over less than no travel: no law has that, and one over no travel is no name.
    assert found.suggested == () and found.model.keys == ()
    assert any("the readings ask for windup" in reason for reason in found.rest.reasons)


def test_a_search_that_was_given_too_few_steps_says_so(tmp_path):
    drawn, path = run(tmp_path, "multi", 2012)
    assert len(drawn.truth) > 1
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)), steps=1)
    assert found.verdict == "unknown" and len(found.suggested) == 1
    assert "no more steps were allowed" in found.words


def test_other_candidates_show_no_size_that_the_run_does_not_tell(tmp_path):
    """Joint offsets imitate a lean or a zero only along what hardly shows: a quarter of a metre, told by nothing."""
    usual = {f"{name}/{p.name}": p.usual for name, cls in library().items() for p in cls.parameters}
    shown = 0
    for fault, seed in (("tower-tilt", 1), ("homing-offset", 2), ("joint-clearance", 21)):
        _, found = learn(tmp_path, "single", seed, fault=fault)
        for other in found.candidates[len(found.suggested) :]:
            for name, _, value, std in other.parameters:
                size = usual[f"{other.effect.partition('[')[0]}/{name.partition(' ')[0]}"]
                assert std is not None and std < size
                assert abs(value) < 30.0 * size, (other.effect, name)
                shown += 1
    assert shown > 30


def test_a_later_step_says_after_which_its_error_is(tmp_path):
    _, found = learn(tmp_path, "multi", 1)
    steps = found.candidates[: len(found.suggested)]
    assert len(steps) > 1
    assert " after " not in steps[0].words
    for number, step in enumerate(steps[1:], start=1):
        assert f"held-out error after {steps[0].effect}" in step.words
        assert all(before.effect in step.words for before in steps[:number])


@pytest.mark.long
def test_rows_at_a_stop_are_no_gross_errors(tmp_path):
    """A soft stop pushes the platform back beyond one plane of the workspace: few rows, far off, in one place."""
    _, path = run(tmp_path, "none", 91, rows=230)
    frame = pd.read_csv(path)
    edge = float(np.nanquantile(frame["x_meas"], 0.93))
    beyond = (frame["x_meas"] > edge).to_numpy()
    frame["x_meas"] -= 0.08 * np.clip(frame["x_meas"] - edge, 0.0, None)
    frame.to_csv(path, index=False)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))
    assert found.outliers[beyond].sum() < 0.5 * beyond.sum()
    assert found.verdict == "unknown"
    assert found.depends_on[0].on == "x"


def test_every_reading_is_accounted_for(tmp_path):
    """Readings that count, gross ones and those that open a run are all there are; the text says why some are not."""
    _, path = run(tmp_path, "none", 92, rows=120, outlier_share=0.05)
    problem = build_problem(MACHINE, read_table(path))
    found = diagnose(Model(MACHINE), problem)
    assert found.opening.sum() == 1 and found.to_dict()["rows_aside"] == np.flatnonzero(found.opening).tolist()
    assert found.rows + found.outliers.sum() + found.opening.sum() == problem.used.sum()
    assert "one row left aside" in format_diagnosis(found)


def test_the_text_says_no_chance_of_zero_and_what_a_shell_takes_as_one_word(tmp_path):
    """Harmonics have brackets and a blank; where the verdict has no room for the steps, they follow the table."""
    _, path = run(tmp_path, "none", 92, rows=120)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))
    keys = ("backlash", "once-per-rev[harmonic 2]")
    rows = tuple(Candidate(key, 0.9, 0.0, 0.5, 62.0, 9.0, (), (), (), f"What {key} means.") for key in keys)
    told = replace(found, verdict="unknown", suggested=tuple((key,) for key in keys), candidates=rows, words="Unknown.")
    lines = format_diagnosis(told).splitlines()
    assert not [line for line in lines if "0.0e+00" in line]
    table = [line for line in lines if line.startswith("+ ") and "->" in line]
    assert len({line.index("<") for line in table}) == 1 and all("< 1e-12" in line for line in table)
    assert 'next: ptt add RUN.csv backlash "once-per-rev[harmonic 2]" --model' in "\n".join(lines)
    assert [line.strip() for line in lines if line.startswith("  What ")] == [one.words for one in rows]
