"""Screws and frames that follow the thermometer late: found, told, kept in the file, and followed by commands."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from made_legs import drawing
from test_report_chinese import SAY

import ptt
from ptt.commands.main import run
from ptt.correct import blocks
from ptt.correct.compensate import compensate
from ptt.correct.doubt import beginning_doubt
from ptt.correct.terms import split_terms
from ptt.diagnosis.diagnose import Diagnosis, diagnose
from ptt.diagnosis.telling.mimic import kept_warm
from ptt.door import streaming
from ptt.effects.late import START, STARTS, Growth, is_late, late_warmth
from ptt.effects.metrology import TrackerScale
from ptt.effects.screw import LeadScale, ScrewGrowth
from ptt.effects.structure import FrameGrowth
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import predict
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, Term
from ptt.model.of_run import for_runs
from ptt.run.behind import LAGS_S, lags_behind
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view
from ptt.run.written import write_table

HOURS, SIGMA, STEEL = 6.0, 0.003, 11.5e-6  # mm of noise, and steel's expansion in 1/K
LATE_S = 1900.0  # s, between two of the times that are tried
AT_REST = [0.0] * START.count
FILE = MachineFile(machine=drawing())
TRUSTED = replace(FILE, tracker=FILE.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": "trusted"}))


def followed(time: np.ndarray, warm: np.ndarray, constant: float, start: float = 0.0) -> np.ndarray:
    """Temperature of a body, (n,): two hundred small steps from row to row."""
    state = warm[0] + start
    body = [state]
    for row in range(1, len(time)):
        for share in (np.arange(200) + 0.5) / 200.0:
            cause = warm[row - 1] + share * (warm[row] - warm[row - 1])
            state = cause + (state - cause) * np.exp(-(time[row] - time[row - 1]) / 200.0 / constant)
        body.append(state)
    return np.array(body)


def room(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Clock and temperature of a day: the sun comes, and an air conditioner swings."""
    time = np.linspace(0.0, 3600.0 * HOURS, count)
    return time, 21.0 + 3.0 * np.sin(2.0 * np.pi * time / 16000.0) + 0.8 * np.sin(2.0 * np.pi * time / 5100.0)


def warmed(
    constant: float, count: int = 200, runs: int = 1, seed: int = 1, start: float = 0.0
) -> tuple[Problem, Table]:
    """A machine whose screws grow from their upper ends, by the temperature of a body that follows the room's late."""
    random, robot = np.random.default_rng(seed), ThreePtt.from_spec(FILE.machine)
    time, warm = room(count)
    body = followed(time, warm, constant, start) if constant else warm
    sent = random.uniform(250.0, 380.0, (count, 3))
    grown = sent + STEEL * (body - 20.0)[:, None] * (sent - 420.0) * 3.0
    reached = robot.forward(torch.as_tensor(grown)).numpy()
    table = make_table(
        None, sent, reached + random.normal(0.0, SIGMA, reached.shape), time_s=time, temp_c=warm,
        run=np.arange(count) * runs // count,
    )  # fmt: skip
    return build_problem(TRUSTED, table), table


@pytest.fixture(scope="module")
def found() -> tuple[Problem, Diagnosis]:
    problem, _ = warmed(LATE_S, runs=3)
    return problem, diagnose(Model(TRUSTED), problem)


def test_a_body_follows_as_small_steps_from_row_to_row_do():
    time, warm = room(60)
    behind = lags_behind(warm, time, np.zeros(60, dtype=bool))
    for column, constant in zip(behind.T, LAGS_S, strict=True):
        np.testing.assert_allclose(warm + column, followed(time, warm, constant), atol=2e-5)
    anew = np.arange(60) == 30  # another day: nobody knows where bodies were
    apart = lags_behind(warm, time, anew)
    np.testing.assert_array_equal(apart[:30], behind[:30])
    assert not apart[30].any()


def test_between_two_times_a_body_is_between_them_and_as_good_as_right():
    problem, _ = warmed(0.0)
    time, warm = room(200)
    for constant, most in ((150.0, 0.05), (420.0, 0.03), (1700.0, 0.03), (3500.0, 0.03), (9000.0, 0.02)):
        own = (
            late_warmth(
                problem.view, torch.zeros(1, dtype=torch.float64), torch.tensor([constant], dtype=torch.float64)
            ).numpy()
            + 20.0
        )
        assert np.abs(own - followed(time, warm, constant)).max() < most * np.ptp(warm)
    assert late_warmth(problem.view, torch.zeros(1, dtype=torch.float64), torch.zeros(1)) is problem.view.warmth


def test_screws_that_follow_late_are_named_with_how_late(found):
    said = found[1]
    assert (said.verdict, [names[0] for names in said.suggested]) == ("missing", ["screw-growth"])
    values = {value.name: value.value for value in said.candidates[0].parameters}
    assert values["late_s"] == pytest.approx(LATE_S, rel=0.1)
    assert values["growth_per_k 1"] == pytest.approx(3.0 * STEEL, rel=0.03)
    assert "min behind the temperature" in said.words
    assert "min behind" not in SAY(said.words) and "滞后" in SAY(said.words)


@pytest.mark.parametrize("start", [-2.5, 3.0])
def test_screws_that_were_not_at_rest_as_the_run_began_are_named_alone(start):
    said = diagnose(Model(TRUSTED), warmed(LATE_S, start=start)[0])
    assert (said.verdict, said.suggested) == ("missing", (("screw-growth",),))
    values = {value.name: value for value in said.candidates[0].parameters}
    assert values["late_s"].value == pytest.approx(LATE_S, abs=4.0 * values["late_s"].std)
    assert values["start_k 1"].value == pytest.approx(start, abs=4.0 * values["start_k 1"].std)
    assert values["start_k 1"].std < 0.5
    assert f"K {'cooler' if start < 0.0 else 'warmer'} than the recorded temperature" in said.words
    assert "起" not in SAY(said.words) and "所记录的温度" in SAY(said.words)


@pytest.mark.parametrize("frame", ["trusted", "fitted-per-run"])
def test_each_time_that_the_clock_begins_anew_a_body_begins_anew(frame):
    """Cold, at rest, and warmed by earlier work: three mornings."""
    starts, count, random, robot = (-3.0, 0.0, 2.0), 80, np.random.default_rng(3), ThreePtt.from_spec(FILE.machine)
    time, warm = np.tile(np.linspace(0.0, 9000.0, count), 3), room(3 * count)[1]
    days = range(0, 3 * count, count)
    body = np.concatenate([
        followed(time[day : day + count], warm[day : day + count], LATE_S, start)
        for day, start in zip(days, starts, strict=True)
    ])  # fmt: skip
    sent = random.uniform(250.0, 380.0, (3 * count, 3))
    grown = sent + STEEL * np.array([3.0, 9.0, 6.0]) * (body - 20.0)[:, None] * (sent - 420.0)
    reached = robot.forward(torch.as_tensor(grown)).numpy() + random.normal(0.0, SIGMA, (3 * count, 3))
    table = make_table(None, sent, reached, time_s=time, temp_c=warm, run=np.repeat([0, 1, 2], count))
    file = replace(TRUSTED, tracker=TRUSTED.tracker.model_copy(update={"frame": frame}))
    said = diagnose(Model(file), build_problem(file, table))
    assert (said.verdict, said.suggested) == ("missing", (("screw-growth",),))
    values = {value.name: value for value in said.candidates[0].parameters}
    for day, start in enumerate(starts, 1):
        assert values[f"start_k {day}"].value == pytest.approx(start, abs=4.0 * values[f"start_k {day}"].std + 0.1)
    assert "start_k 4" not in values


def test_a_long_pause_is_a_beginning():
    time = np.concatenate([np.arange(0.0, 600.0, 60.0), 20000.0 + np.arange(0.0, 600.0, 60.0)])
    table = make_table(np.zeros((20, 3)), time_s=time, temp_c=20.0 + np.arange(20.0))
    assert build_view(TRUSTED, table).beginnings == (0.0, 20000.0)


def began_by(start: float) -> Model:
    """A machine whose screws were away from the room's temperature as its run began."""
    values = torch.tensor([3e-5, 2e-5, 4e-5, 0.0, 0.0, 0.0, start, *AT_REST[1:], LATE_S], dtype=torch.float64)
    return Model(TRUSTED) + Term(ScrewGrowth(), values)


@pytest.mark.parametrize(("start", "others", "said"), [
    (-4.0, (LeadScale(),), True), (4.0, (LeadScale(),), False), (-4.0, (), False), (-4.0, (TrackerScale(),), False),
    (0.0, (LeadScale(),), False),
])  # fmt: skip
def test_what_motors_keep_warm_looks_like_an_error_of_the_drawing_beside_a_cold_start(start, others, said):
    beside = [Term(effect, torch.ones(3, dtype=torch.float64)) for effect in others]
    words = " ".join(kept_warm(began_by(start).terms[0], beside))
    assert ("with lead-scale: measure again after hours of rest" in words) is said
    assert not words or "电机" in SAY(words)


def test_how_warm_a_body_began_is_of_its_run_alone():
    """Commands and other runs have the growth without it, the run itself with it."""
    problem = build_problem(TRUSTED, warmed(LATE_S)[1].replace(run_sha256=("own",)))
    own = write_model(began_by(-4.0), runs=("own",))
    assert own.effect[0].runs == ("own",)
    began, rest = read_model(parse_machine(format_machine(own))), model_of(LATE_S)
    assert torch.equal(began.terms[0].theta, began_by(-4.0).terms[0].theta)
    time, warm = room(60)
    targets = make_table(np.random.default_rng(2).uniform(-40.0, 40.0, (60, 3)), time_s=time, temp_c=warm)
    sent = [compensate(model, targets, reversal="none") for model in (began, rest)]
    np.testing.assert_allclose(sent[0].q, sent[1].q, atol=1e-12)
    for files, applies in ((("own",), True), (("other",), False)):
        model, lines = for_runs(replace(began, terms=(replace(began.terms[0], runs=files),)), problem)
        shifts = [predict([(term.effect, term.theta)], problem.view).reading for term in (*model.terms, *rest.terms)]
        assert bool(lines) is not applies
        assert (float((shifts[0] - shifts[1]).abs().max()) > 1e-3) is applies


def test_commands_say_that_nobody_knows_how_warm_a_body_begins(tmp_path: Path):
    """Their standard deviation is the error of a list that begins as the measured run did, dying away."""
    time, warm = room(120)
    place, robot = np.tile([[20.0, -30.0, 10.0]], (120, 1)), ThreePtt.from_spec(FILE.machine)
    view = build_view(TRUSTED, make_table(place, time_s=time, temp_c=warm))
    q = view.q.numpy()
    grown = q + np.array([3e-5, 2e-5, 4e-5]) * -4.0 * np.exp(-time / LATE_S)[:, None] * (q - robot.home().numpy())
    off = (robot.forward(torch.as_tensor(grown)) - view.p).norm(dim=1).numpy()
    np.testing.assert_allclose(beginning_doubt(split_terms(began_by(-4.0))[0], view), off, rtol=0.02)
    assert not beginning_doubt(split_terms(model_of(LATE_S))[0], view).any()
    said = dict[str, str]()
    write_table(make_table(place, time_s=time, temp_c=warm), tmp_path / "t.csv")
    for name, model in (("began", began_by(-4.0)), ("rest", model_of(LATE_S))):
        (tmp_path / name).write_text(format_machine(write_model(model, runs=("own",))))
        notes = list[str]()
        ptt.predict(ptt.load(tmp_path / name), tmp_path / "t.csv", note=notes.append)
        said[name] = " ".join(notes)
    assert "4.0 K cooler as the measured run began" in said["began"] and "cooler" not in said["rest"]


def test_screws_that_follow_at_once_are_not_said_to_be_late():
    problem, _ = warmed(0.0)
    said = diagnose(Model(TRUSTED), problem)
    assert [names[0] for names in said.suggested] == ["screw-growth"]
    assert "late_s" not in {value.name for value in said.candidates[0].parameters} and "behind" not in said.words


def test_without_a_clock_or_another_temperature_no_lateness_is_tried():
    problem, table = warmed(LATE_S)
    for changed in (table.replace(time_s=None), table.replace(temp_c=np.full(table.rows, 25.0))):
        view = build_view(TRUSTED, changed)
        assert view.behind is None and len(ScrewGrowth().search(view)) == 1
        late = torch.tensor([LATE_S], dtype=torch.float64)
        torch.testing.assert_close(late_warmth(view, torch.zeros(1), late), view.warmth)
    assert len(FrameGrowth().search(problem.view)) == 1 + len(LAGS_S) * (1 + len(STARTS))


def model_of(late: float) -> Model:
    values = torch.tensor([3e-5, 2e-5, 4e-5, 0.0, 0.0, 0.0, *AT_REST, late], dtype=torch.float64)
    return Model(TRUSTED) + Term(ScrewGrowth(), values)


@pytest.mark.parametrize("late", [0.0, LATE_S])
def test_a_machine_file_has_it_where_there_is_one_and_an_older_file_is_at_once(late):
    text = format_machine(write_model(model_of(late)))
    assert ("late_s" in text) is (late > 0.0)
    term = read_model(parse_machine(text)).terms[0]
    assert float(term.theta[-1]) == late and is_late(term.effect, term.theta) is (late > 0.0)
    assert isinstance(term.effect, Growth)


def test_commands_follow_the_body_and_not_the_thermometer_in_blocks_too(monkeypatch):
    """The sent commands, grown by small steps, put the tool where it was asked for."""
    time, warm = room(120)
    place = np.random.default_rng(2).uniform(-40.0, 40.0, (120, 3))
    targets = make_table(place, time_s=time, temp_c=warm)
    sent = compensate(model_of(LAGS_S[2]), targets, reversal="none").q
    body = followed(time, warm, LAGS_S[2])
    robot = ThreePtt.from_spec(FILE.machine)
    grown = sent + (body - 20.0)[:, None] * np.array([3e-5, 2e-5, 4e-5]) * (sent - robot.home().numpy())
    assert np.abs(robot.forward(torch.as_tensor(grown)).numpy() - place).max() < 1e-5
    for name, rows in (("ROWS", 40), ("NEIGHBOUR_ROWS", 10), ("CHUNK", 60)):
        monkeypatch.setattr(blocks, name, rows)
    np.testing.assert_allclose(compensate(model_of(LAGS_S[2]), targets, reversal="none").q, sent, atol=1e-9)


def test_a_long_list_is_corrected_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    time, warm = room(60)
    place = np.random.default_rng(3).uniform(-40.0, 40.0, (60, 3))
    write_table(make_table(place, time_s=time, temp_c=warm), tmp_path / "t.csv")
    (tmp_path / "m.toml").write_text(format_machine(write_model(model_of(LATE_S))))
    for name, long in (("whole.csv", streaming.LONG), ("long.csv", 0)):
        monkeypatch.setattr(streaming, "LONG", long)
        assert run(["predict", str(tmp_path / "t.csv"), "--model", str(tmp_path / "m.toml"), "--out",
                    str(tmp_path / name)]) == 0  # fmt: skip
    assert (tmp_path / "whole.csv").read_text() == (tmp_path / "long.csv").read_text()


@pytest.mark.parametrize(
    ("late", "said"), [(0.0, "screw growth"), (1900.0, "about 32 min behind"), (9600.0, "about 2.7 h behind")]
)
def test_how_late_is_said_in_minutes_or_hours(late, said):
    term = model_of(late).terms[0]
    words = term.effect.cause(term.theta, build_view(TRUSTED, make_table(np.zeros((3, 3)))))
    assert said in words and ("behind" in words) is (late > 0.0)
    assert "behind" not in SAY(f"Slider 1 grows 12 um/m/K with warmth: {words}.")
