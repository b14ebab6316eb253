"""The front door: files, frames and options are refused as the command line refuses them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from library_folder import DATA
from library_folder import here as here
from matplotlib.figure import Figure

import ptt
from ptt.commands.main import run as command
from ptt.errors import InputError, ModelError, SetupError, TableError


def mistaken(frame: pd.DataFrame) -> pd.DataFrame:
    """A run whose z axis points the other way."""
    return frame.assign(z_meas=-frame["z_meas"])


def test_the_set_up_is_refused_as_the_command_line_refuses_it(here, capsys):
    mistaken(pd.read_csv(here / "run.csv")).to_csv(here / "wrong.csv", index=False)
    model = ptt.load(here / "machine.toml")
    run = ptt.read(here / "wrong.csv", model)
    assert not ptt.check(model, run).ok
    found = ptt.diagnose(model, run)
    assert found.verdict == "setup" and found.suggested == () and isinstance(found.plot(), Figure)
    assert ptt.compare(model, run).to_dict()["setup"]
    words = ["fit", str(here / "wrong.csv"), "--model", str(here / "machine.toml")]
    assert command(words) == 3
    printed = capsys.readouterr().err.strip()
    with pytest.raises(SetupError) as refused:
        ptt.fit(model, run)
    assert printed == f"error: {refused.value}"


@pytest.mark.parametrize(
    ("change", "verb"),
    [
        (lambda frame: frame.assign(b1_cmd=frame["b1_cmd"] + 900.0 * (frame.index < 5)), "compare"),
        (lambda frame: frame.drop(columns="x_meas"), "compare"),
        (lambda frame: frame.assign(x_meas="--"), "compare"),
        (lambda frame: frame.assign(time_s=frame["time_s"].where(frame.index != 7, frame["time_s"][3])), "compare"),
        (lambda frame: frame.assign(**{f"{axis}_meas": frame[f"{axis}_meas"] / 1000 for axis in "xyz"}), "evaluate"),
    ],
)
def test_what_the_command_line_refuses_the_library_refuses_in_the_same_words(change, verb, here, capsys):
    path, machine = str(here / "odd.csv"), str(here / "machine.toml")
    change(pd.read_csv(here / "run.csv")).to_csv(path, index=False)
    words = [verb, path, *(("--model", machine) if verb == "compare" else (path,))]
    code = command(words)
    printed = capsys.readouterr().err.strip().splitlines()[-1]
    with pytest.raises(InputError) as refused:
        if verb == "compare":
            ptt.compare(machine, ptt.read(path, machine))
        else:
            ptt.evaluate(path, path)
    assert printed == f"error: {' '.join(str(refused.value).split())}"
    assert code == refused.value.exit_code == (3 if "links do not meet" in printed else 2)


def test_an_effect_of_ones_own_is_an_object_like_any_other(here):
    class Again(ptt.effects.HomingOffset):
        name = "again"

    class Backlash(ptt.effects.HomingOffset):
        name = "backlash"

    model = ptt.load(here / "machine.toml")
    run = ptt.read(here / "run.csv", model)
    assert ptt.add(model, run, Again()).model.effects == ("again",)
    with pytest.raises(ModelError, match="exists already"):
        ptt.add(model, run, Backlash())


def test_a_frame_that_cannot_be_read_is_named_as_a_frame(here):
    frame = pd.read_csv(here / "run.csv").astype(object)
    frame.loc[3, "x_meas"] = "--"
    with pytest.raises(TableError, match=r"^data frame row 5"):
        ptt.read(frame, here / "machine.toml")


def test_answers_and_targets_are_taken_without_files(here):
    machine, rows = ptt.load(here / "machine.toml"), pd.read_csv(here / "run.csv")
    renamed = rows.rename(columns={"x_meas": "messX", "y_meas": "messY", "z_meas": "messZ"})
    answers = {"columns": {"messX": "x_meas", "messY": "y_meas", "messZ": "z_meas"}}
    wanted = rows[["x_cmd", "y_cmd", "z_cmd"]]
    plain = ptt.read(rows, machine)
    with_answers = ptt.read(renamed, machine, map=answers)
    beside = ptt.read(rows.drop(columns=wanted), machine, targets=wanted)
    in_an_array = ptt.read(rows.drop(columns=wanted), machine, targets=wanted.to_numpy())
    for other in (with_answers, beside, in_an_array):
        np.testing.assert_array_equal(other.table.measured, plain.table.measured)
        np.testing.assert_array_equal(other.table.target, plain.table.target)
    assert "messX" in str(with_answers) and "ptt_" not in str(with_answers) + str(beside)
    with pytest.raises(InputError, match=r"^map: unknown key 'colums'"):
        ptt.read(renamed, machine, map={"colums": {}})
    with pytest.raises(InputError, match=r"^map: got a int; name a file"):
        ptt.read(renamed, machine, map=3)


@pytest.mark.parametrize("verb", ["check", "compare", "diagnose", "add", "remove", "fit", "evaluate", "recheck",
                                  "iso", "report", "train", "export"])  # fmt: skip
def test_every_verb_that_reads_runs_takes_the_same_words(verb, capsys):
    assert command([verb, "--help"]) == 0
    shown = capsys.readouterr().out
    lacking = [word for word in ("--also", "--targets", "--set", "--map", "--effects", "--json") if word not in shown]
    assert not lacking


def test_check_knows_effects_of_ones_own(here, capsys):
    own, model = str(here / "own.py"), str(here / "own.toml")
    assert command(["effects", "new", "own-drag", "--out", own]) == 0
    Path(model).write_text((here / "machine.toml").read_text() + '\n[[effect]]\nname = "own-drag"\n')
    words = ["check", str(here / "run.csv"), "--model", model]
    assert command(words) == 2 and "--effects FILE.py" in capsys.readouterr().err
    assert command([*words, "--effects", own]) == 0


def test_numbers_that_mean_nothing_are_refused():
    with pytest.raises(InputError, match=r"goal: .* is not a finite number; give percent"):
        ptt.evaluate("a.csv", "b.csv", goal=float("nan"))
    with pytest.raises(InputError, match="seed: -1 is below 0"):
        ptt.simulate(DATA / "rigs" / "experiment1.toml", DATA / "targets.csv", seed=-1)
