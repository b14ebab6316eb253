"""The diagnosis on rigs that share nothing with the effects: right when something is there, silent when nothing is."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.hide import FAULTS, hide_faults
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence import saturated
from ptt.diagnosis.search.excess import Objections
from ptt.diagnosis.search.rest import Rest
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.enough import require_enough
from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects import library
from ptt.errors import TableError
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


def run(folder, seed: int, *faults: str, rows: int = 200, **tracker: float):
    protocol = FAULTS[faults[0]].protocols[-1] if faults else "volume"
    drawn = hide_faults(draw_rig(seed, MACHINE, protocol, rows=rows), faults, seed)
    rig = drawn.rig
    if tracker:
        rig = replace(rig, tracker=rig.tracker.model_copy(update=tracker))
    path = folder / f"{seed}.csv"
    write_run(simulate(rig, drawn.targets).frame, path)
    return drawn, path


def learn(folder, *arguments, **options) -> tuple[dict, Diagnosis]:
    drawn, path = run(folder, *arguments, **options)
    return drawn.truth, diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))


@pytest.mark.parametrize(
    ("fault", "seed"),  # an effect that a file of its own asks for by name is asked for here with the long ones
    [
        pytest.param("homing-offset", 11, marks=pytest.mark.long),
        pytest.param("screw-error-map", 12, marks=pytest.mark.long),
        ("once-per-rev", 13),
        pytest.param("backlash", 14, marks=pytest.mark.long),
        ("windup", 15),
        pytest.param("following-error", 16, marks=pytest.mark.long),
        pytest.param("axis-compliance", 17, marks=pytest.mark.long),
        ("tower-position", 18),
        pytest.param("link-length", 19, marks=pytest.mark.long),
        ("guide-straightness", 20),
        pytest.param("joint-clearance", 21, marks=pytest.mark.long),
        ("platform-twist", 22),
        pytest.param("column-bend", 23, marks=pytest.mark.long),
        pytest.param("tracker-drift", 24, marks=pytest.mark.long),
        pytest.param("setup-jump", 25, marks=pytest.mark.long),
    ],
)
def test_one_hidden_effect_is_named_first(tmp_path, fault, seed):
    truth, found = learn(tmp_path, seed, fault)
    assert list(truth) == [fault]
    assert found.verdict == "missing"
    assert found.suggested[0][0] == fault
    assert len(found.suggested[0]) <= 4
    assert found.rms_um["after"]["total"] < 1.25 * found.noise.total * 1e3


@pytest.mark.parametrize(("machines", "silent"), [(3, 3), pytest.param(12, 11, marks=pytest.mark.long)])
def test_silent_where_nothing_is_hidden(tmp_path, machines, silent):
    verdicts = [learn(tmp_path, seed)[1].verdict for seed in range(40, 40 + machines)]
    assert verdicts.count("nothing-missing") >= silent


@pytest.mark.parametrize("understated", [1.0, 3.0])
def test_noise_that_is_stated_too_small_follows_nothing_and_it_is_said(tmp_path, understated):
    """More than twice a stated noise is never nothing; but no variable is blamed that says less than chance."""
    _, path = run(tmp_path, 11, rows=120)
    table = read_table(path)
    scatter = diagnose(Model(MACHINE), build_problem(MACHINE, table)).rms_um["after"]
    sigma = [1e-3 * scatter[axis] / understated for axis in "xyz"]
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table.replace(std=np.tile(sigma, (table.rows, 1)))))
    assert found.suggested == () and found.depends_on == ()
    assert found.verdict == ("nothing-missing" if understated < 2.0 else "unknown")
    assert ("times the noise (from the std columns)" in found.words) == (understated > 2.0)


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
        even = [found.verdict_probability[name] for name in (verdict, "unknown")]
        assert even == pytest.approx([0.5, 0.5], abs=0.01)  # or something that no column records
        assert found.noise.total == pytest.approx(np.hypot(0.008, 0.003) * np.sqrt(3.0), rel=0.1)
        assert found.noise.source == ("repeats" if readings == 1 else VISITED)
        assert ("revisit some poses" in found.words) == (readings > 1)
    if readings > 1:  # what a tracker states of a held pose says nothing of visits either
        stated = make_table(place, measured=read, std=np.full(place.shape, 0.0035))
        found = diagnose(Model(MACHINE), build_problem(MACHINE, stated))
        assert (found.verdict, found.noise.source) == ("nothing-missing", "std columns")


def test_what_speaks_against_an_explanation_is_said_whichever_it_is():
    left, stated = (Noise(np.eye(3) * size**2, "std columns") for size in (0.03, 0.01))
    sound = Rest((), ())
    assert sound.objected(Objections(), left, None) == sound == sound.objected(Objections(), stated, stated)
    reasons = sound.objected(Objections(faithful=False, unproven=("backlash", "windup")), left, stated).reasons
    assert reasons[0].startswith("backlash and windup fit these readings but do not improve predictions")
    assert reasons[1].startswith("the remaining error is 3.0 times the noise (from the std columns)")
    (astray,) = sound.objected(Objections(faithful=False), stated, stated).reasons
    assert astray.startswith("held-out readings are predicted far worse")
    wrong = Objections(idle=("windup",), backward=("axis-compliance",), set_aside="lie next to each other in space")
    idle, backward, aside = sound.objected(replace(wrong, unexplained_error="never said"), stated, stated).reasons
    assert idle == "the fitted values of windup have no visible effect" and "wrong sign" in backward
    assert aside.endswith("lie next to each other in space, unlike real gross errors")
    assert sound.objected(Objections(unexplained_error="said"), stated, stated).reasons == ("said",)


def test_readings_that_their_frames_take_are_too_few(tmp_path):
    """Thirteen readings of three set-ups leave 21 numbers; in one frame they leave 33, as many as twelve need."""
    _, path = run(tmp_path, 11, rows=60)
    table = take_rows(table := read_table(path), np.flatnonzero(table.observed & (table.role == "pose"))[:13])
    set_ups = table.replace(run=np.arange(13) // 5, run_label=("a", "b", "c"))
    own = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "fitted-per-run"}))
    require_enough(build_problem(MACHINE, set_ups))
    with pytest.raises(TableError, match="13 readings in 3 frames are too few"):
        require_enough(build_problem(own, set_ups))
    blank = np.where(np.arange(13)[:, None] < 12, table.measured, np.nan)
    with pytest.raises(TableError, match="12 readings in 2 frames are too few"):  # the third set-up has none
        require_enough(build_problem(own, set_ups.replace(measured=blank, run=np.arange(13) // 6)))
    require_enough(build_problem(own, table.replace(run=np.arange(13) // 12, run_label=("a", "b"))))


@pytest.mark.parametrize(("machines", "silent"), [(2, 2), pytest.param(6, 5, marks=pytest.mark.long)])
def test_silent_on_few_rows_and_among_gross_errors(tmp_path, machines, silent):
    few = [learn(tmp_path, 60 + number, rows=60)[1] for number in range(machines)]
    assert [item.verdict for item in few].count("nothing-missing") >= silent
    spoiled = [learn(tmp_path, 70 + number, outlier_share=0.05)[1] for number in range(machines)]
    assert [item.verdict for item in spoiled].count("nothing-missing") >= silent
    assert all(item.outliers.sum() >= 5 for item in spoiled)


@pytest.mark.long
def test_slow_wander_is_no_machine_error(tmp_path):
    machine = {name for name, cls in library().items() if cls.stage != "metrology"}
    for seed in range(80, 84):
        _, found = learn(tmp_path, seed, wander_um=5.0, wander_s=900.0)
        assert not {step[0].partition("[")[0] for step in found.suggested} & machine


def test_a_wave_in_the_readings_of_one_axis_is_no_wander(tmp_path):
    """A beam that bends lifts far readings slowly up and down by three times their scatter, and moves nothing else."""
    _, path = run(tmp_path, 86)
    frame = pd.read_csv(path)
    wave = 0.03 * np.sin(2.0 * np.pi * frame["time_s"] / (0.4 * np.ptp(frame["time_s"])) + 1.0)
    frame["z_meas"] += wave * (1.0 + 0.002 * frame["x_meas"])
    frame.to_csv(path, index=False)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))
    assert found.verdict == "unknown" and found.verdict_probability["unknown"] > 0.9
    assert (found.depends_on[0].residual, found.depends_on[0].on) == ("z", "time")


@pytest.mark.parametrize("seed", [pytest.param(87, marks=pytest.mark.long), 88])
def test_a_slip_between_the_moments_that_a_search_tries_is_dated_to_the_row(tmp_path, seed):
    """One row on the wrong side of a jump is as far off as the jump: nothing may be named to make good for it."""
    forward, row = build_mechanism(MACHINE.machine).forward, 102
    _, path = run(tmp_path, seed, rows=190, heavy_dof=3.0)
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
    truth, found = learn(tmp_path, 122, "guide-damage")
    assert "guide-damage" in truth
    assert found.verdict == "unknown"
    slider = found.depends_on[0].on
    assert slider.startswith("b")
    low, high = found.depends_on[0].place
    assert high - low < 40.0


def test_a_floor_that_can_be_told_no_finer_is_the_last_that_could(tmp_path, monkeypatch):
    """Under readings of half a micrometre a saturated model sees every curve it has, and keeps no row to scatter."""
    _, path = run(tmp_path, 90, rows=60)
    problem = replace(build_problem(MACHINE, read_table(path)), noise=None)
    rounds = [Noise(np.eye(3) * 1e-6, "saturated model", 30.0), Noise(np.eye(3) * 1e-7, "saturated model", 5.0)]
    monkeypatch.setattr(saturated, "_saturated", lambda *given: (left.pop(0), {}))
    left = rounds.copy()
    assert saturated.saturated_floor(Model(MACHINE), problem, library()) is rounds[0]
    left = rounds[::-1]
    with pytest.raises(TableError, match="do not tell the noise"):
        saturated.saturated_floor(Model(MACHINE), problem, library())


def test_thirty_six_readings_that_are_diagnosed_tell_what_they_scatter_by_too():
    """Everything at once leaves so few readings no freedom; what was found in them does, so that it can be added."""
    drawn, truth = draw(plan("single", 1, 960029, noise="white", bench=None, rows=36, visible=True)[0])
    frame = simulate(drawn.rig, drawn.targets).frame
    problem = replace(build_problem(drawn.rig.machine, table_of(frame, drawn.absent)), noise=None)
    with pytest.raises(TableError, match="do not tell the noise"):
        saturated.saturated_floor(Model(drawn.rig.machine), problem, library())
    assert noise_floor(Model(drawn.rig.machine), problem, library()).total == pytest.approx(truth.noise.total, rel=0.2)
    sparse = problem.masked(np.arange(problem.table.rows) >= 10)
    with pytest.raises(TableError, match="do not tell the noise"):
        noise_floor(Model(drawn.rig.machine), sparse, library())


@pytest.mark.long
def test_two_effects_are_both_found(tmp_path):
    truth, found = learn(tmp_path, 2013, "backlash", "tower-position", "homing-offset")
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


def test_a_sum_that_mimics_the_tracker_s_unit_of_length_is_said(tmp_path):
    drawn = draw_rig(90, MACHINE, "volume")
    tracker = drawn.rig.tracker.model_copy(update={"scale_ppm": 150.0})
    path = tmp_path / "stretched.csv"
    write_run(simulate(replace(drawn.rig, tracker=tracker), drawn.targets).frame, path)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)))
    assert [step[0] for step in found.suggested] == ["tracker-scale"]
    assert set(found.candidates[0].sum_of) == {"lead-scale", "tower-position", "link-length"}
    assert "together would do the same" in found.words


def test_no_sum_mimics_what_nothing_else_looks_like(tmp_path):
    _, found = learn(tmp_path, 14, "backlash")
    assert found.candidates[0].sum_of == ()


@pytest.mark.long
def test_a_hose_that_pulls_from_one_side_is_not_told_as_many_effects(tmp_path):
    truth, found = learn(tmp_path, 303, "hose", "platform-twist")
    assert "hose" in truth
    assert found.verdict == "unknown"
    assert found.depends_on[0].on in ("x", "y", "z")
    assert len(found.suggested) <= len(truth)


@pytest.mark.long
def test_a_path_cut_short_says_that_more_is_missing(tmp_path):
    drawn, path = run(tmp_path, 2013, "backlash", "tower-position", "homing-offset")
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)), steps=1)
    assert found.verdict == "unknown"
    assert len(found.suggested) < 2 and {step[0] for step in found.suggested} <= set(drawn.truth)
