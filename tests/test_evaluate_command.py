"""The verb evaluate: its keys, its words, and what it doubts first."""

import json
from pathlib import Path

import numpy as np
from test_evaluate import NAMES, PLACES, run, turned, words_of
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.run.written import write_table

DATA = Path(__file__).resolve().parents[1] / "data"


def test_the_command_prints_the_documented_keys(tmp_path):
    write_table(run(0.2, name=NAMES), tmp_path / "b.csv")
    write_table(run(0.01, PLACES[:30], name=NAMES[:30]), tmp_path / "a.csv")
    args = ["evaluate", str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--frame", "trusted"]
    data = json.loads(CliRunner().invoke(app, [*args, "--json"]).stdout)
    assert set(data["axes"]["x"]) == {"before_um", "after_um", "reduction_percent", "goal_percent", "goal_met"}
    assert {"axes", "total", "protocol", "unaligned", "noise_um", "unmatched"} <= set(data)
    assert data["protocol"]["rows"] == 30 and len(data["unmatched"]["before"]) == 10
    text = CliRunner().invoke(app, args).stdout
    assert "\n  length" in text and "WARNING" not in text
    assert "goal" not in text and "in before alone, without counterpart" in text and "without frame alignment" in text


def test_a_goal_is_judged_where_one_was_set_and_noise_is_no_miss(tmp_path):
    """A sound machine, measured twice: nothing can fall, and nobody asked for it."""
    places = np.repeat(PLACES, 3, axis=0)
    runs = [run(np.random.default_rng(seed).normal(0.0, 0.005, places.shape), places) for seed in (1, 2)]
    plain = words_of(tmp_path, *runs)
    assert "goal" not in plain and plain.count("what is left is noise") == 3
    judged = words_of(tmp_path, *runs, "--goal", "90,90,80")
    assert judged.count("goal 90 not measurable:") == 2 and "missed" not in judged
    far = run(np.array([0.0, 0.0, 0.2]) + 0.005 * np.random.default_rng(3).normal(size=places.shape), places)
    trusted = words_of(tmp_path, far, far.replace(), "--goal", "50", "--frame", "trusted")
    assert "goal 50 missed" in trusted.split("\n  z ")[1].splitlines()[0]
    bad = CliRunner().invoke(app, ["evaluate", str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--goal", "all"])
    assert bad.exit_code == 2 and "90,90,80" in bad.stderr


def test_a_tracker_set_up_anew_is_not_silently_counted_as_error(tmp_path):
    text = words_of(tmp_path, run(0.05), turned(run(0.005), 0.0, (0.1, 0.2, 0.0)))
    assert "if the tracker was set up anew, its position counts as error" in text


def test_one_run_needs_a_model(tmp_path):
    write_table(run(0.2, name=NAMES), tmp_path / "b.csv")
    result = CliRunner().invoke(app, ["evaluate", str(tmp_path / "b.csv")])
    assert result.exit_code == 2 and "--model" in result.stderr


def test_few_matches_are_the_first_thing_said(tmp_path):
    write_table(run(0.2, name=NAMES), tmp_path / "b.csv")
    write_table(run(0.01, PLACES[:19], name=NAMES[:19]), tmp_path / "a.csv")
    args = ["evaluate", str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--frame", "trusted"]
    result = CliRunner().invoke(app, args)
    assert result.stdout.startswith("WARNING: only 19 of 40 rows of BEFORE count")
    assert "warning: only 19 of 40 rows of BEFORE" in result.stderr
    spoken = CliRunner().invoke(app, [*args, "--json"])
    assert json.loads(spoken.stdout)["protocol"]["rows"] == 19 and "only 19 of 40" in spoken.stderr


def test_a_model_that_shifts_a_trusted_frame_is_a_reason_to_doubt_what_is_read_in_it(tmp_path):
    write_table(run(0.2, name=NAMES), tmp_path / "b.csv")
    write_table(run(0.1, name=NAMES), tmp_path / "a.csv")
    drawing = (DATA / "machine.toml").read_text()
    known = '[[effect]]\nname = "tracker-frame"\n[effect.parameters]\nshift_mm = {value = [0.1, 0.1, 0.1]}\n'
    (tmp_path / "m.toml").write_text(f"{drawing}\n{known}")
    args = ["evaluate", str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--model", str(tmp_path / "m.toml")]
    said = "the model says that the trusted frame is off (tracker-frame)"
    assert said in CliRunner().invoke(app, [*args, "--frame", "trusted"]).stdout
    fitted = CliRunner().invoke(app, [*args, "--frame", "fitted"])
    assert fitted.exit_code == 0 and said not in fitted.stdout


def test_readings_under_other_conditions_are_said_to_be_so(tmp_path):
    warm, load = np.linspace(20.0, 28.0, 40), np.repeat([0.0, 5.0], 20)
    before = run(0.2, name=NAMES, temp_c=warm, payload_kg=load)
    cold = words_of(tmp_path, before, run(0.1, name=NAMES, temp_c=np.full(40, 20.0), payload_kg=load))
    assert "WARNING: 37 of 40 rows of AFTER were measured at another temperature than in BEFORE, up to 8 K off" in cold
    assert "another payload" not in cold
    silent = words_of(tmp_path, before, run(0.1, name=NAMES, temp_c=warm))
    assert "WARNING: AFTER has no payload_kg, which changes by 5 kg in the other run" in silent
    assert "WARNING" not in words_of(tmp_path, before, run(0.1, name=NAMES, temp_c=warm + 0.3, payload_kg=load))
