"""What a diagnosis tells beside its name: JSON, what was not tested, errors of steps, gross rows."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from test_diagnosis import learn, run
from typer.testing import CliRunner

from ptt.challenge.challenge import bench as bench_machine
from ptt.commands.main import app
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.explanation import Candidate
from ptt.door.diagnosing import format_diagnosis
from ptt.effects import library
from ptt.machine import format_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.reading import read_table

MACHINE = bench_machine()


def test_json_holds_what_is_documented(tmp_path):
    _, path = run(tmp_path, 14, "backlash")
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
    chances = data["verdict_probability"]
    assert sum(chances.values()) == pytest.approx(1.0) and min(chances.values()) > 0.003
    for other in data["candidates"]:  # none is listed that helps no held-out reading; none is ruled out for certain
        assert other["heldout_rms_um"]["after"] < other["heldout_rms_um"]["before"]
        assert 0.001 < other["probability"] < 0.999


def test_what_the_data_cannot_test_is_listed_with_its_need(tmp_path):
    _, found = learn(tmp_path, 41)
    assert "payload" in found.not_testable["column-bend"]


def test_a_search_that_was_given_too_few_steps_says_so(tmp_path):
    drawn, path = run(tmp_path, 2012, "backlash", "homing-offset", "link-length")
    assert len(drawn.truth) > 1
    found = diagnose(Model(MACHINE), build_problem(MACHINE, read_table(path)), steps=1)
    assert found.verdict == "unknown" and len(found.suggested) == 1
    assert "no more steps were allowed" in found.words


def test_other_candidates_show_no_size_that_the_run_does_not_tell(tmp_path):
    """Joint offsets imitate a lean or a zero only along what hardly shows: a quarter of a metre, told by nothing."""
    usual = {f"{name}/{p.name}": p.usual for name, cls in library().items() for p in cls.parameters}
    shown = 0
    for fault, seed in (("tower-tilt", 1), ("homing-offset", 2), ("joint-clearance", 21)):
        _, found = learn(tmp_path, seed, fault)
        for other in found.candidates[len(found.suggested) :]:
            for name, _, value, std in other.parameters:
                size = usual[f"{other.effect.partition('[')[0]}/{name.partition(' ')[0]}"]
                assert std is not None and std < size
                assert abs(value) < 30.0 * size or std < 0.05 * abs(value), (other.effect, name)
                shown += 1
    assert shown > 30


def test_a_later_step_says_after_which_its_error_is(tmp_path):
    _, found = learn(tmp_path, 1, "backlash", "lead-scale", rows=300)
    steps = found.candidates[: len(found.suggested)]
    assert len(steps) > 1
    assert " after " not in steps[0].words
    for number, step in enumerate(steps[1:], start=1):
        assert f"held-out error after {steps[0].effect}" in step.words
        assert all(before.effect in step.words for before in steps[:number])


@pytest.mark.long
def test_rows_at_a_stop_are_no_gross_errors(tmp_path):
    """A soft stop pushes the platform back beyond one plane of the workspace: few rows, far off, in one place."""
    _, path = run(tmp_path, 91, rows=230)
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
    _, path = run(tmp_path, 92, rows=120, outlier_share=0.05)
    problem = build_problem(MACHINE, read_table(path))
    found = diagnose(Model(MACHINE), problem)
    assert found.opening.sum() == 1 and found.to_dict()["rows_aside"] == np.flatnonzero(found.opening).tolist()
    assert found.rows + found.outliers.sum() + found.opening.sum() == problem.used.sum()
    assert "one row set aside" in format_diagnosis(found)


def test_the_text_says_no_chance_of_zero_and_what_a_shell_takes_as_one_word(tmp_path):
    """Harmonics have brackets and a blank; where the verdict has no room for the steps, they follow the table."""
    _, path = run(tmp_path, 92, rows=120)
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
    # what no machine is built that far off comes first, and no effect is to be added to that
    off = "the readings differ from the commands by 30,647 um: is it the machine file of this run?"
    first = told.with_unexplained(off)
    assert first.words == f"T{off[1:]}\nUnknown." and "next:" not in format_diagnosis(first)
    assert first.to_dict()["unexplained"] == off and first.measure_next == () and told.with_unexplained("") is told
    whole = replace(told, verdict="missing")  # explained down to the noise, whatever it is
    assert whole.with_unexplained(off) is whole and "next: ptt add" in format_diagnosis(whole)
