"""A check finds readings where every other command finds them: bare x, y, z beside commands are none of the targets."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import run_verb

from ptt.door.reading import ask_once

DATA = Path(__file__).parent.parent / "data" / "sealed_one"
SENT, READ = ["b1_cmd", "b2_cmd", "b3_cmd"], ["x_meas", "y_meas", "z_meas"]


@pytest.fixture
def bare(tmp_path: Path) -> pd.DataFrame:
    """Columns of the sample run with its readings, in a frame of the tracker's own, under X, Y, Z."""
    run = pd.read_csv(DATA / "run.csv").rename(columns=dict(zip(READ, "XYZ", strict=True)))
    run["X"], run["Y"] = 900.0 - run["Y"], run["X"] - 400.0
    return run


@pytest.mark.parametrize("beside", [SENT, ["x_cmd", "y_cmd", "z_cmd"], ["b1", "b2", "b3"]])
def test_bare_coordinates_beside_what_was_sent_are_readings(
    bare: pd.DataFrame, beside: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = bare.rename(columns=dict(zip(SENT, ["b1", "b2", "b3"], strict=True))) if "b1" in beside else bare
    path, cured = tmp_path / "run.csv", tmp_path / "cured.csv"
    run[[*beside, "X", "Y", "Z"]].to_csv(path, index=False)
    assert run_verb("check", path, "--model", DATA / "machine.toml", "--out-run", cured) == 0
    assert "no mistakes found in the set-up" in capsys.readouterr().out
    written = pd.read_csv(cured)
    np.testing.assert_allclose(written[READ], run[["X", "Y", "Z"]], atol=1e-6)
    assert set(written.columns) & {"x_cmd"} == set(beside) & {"x_cmd"}


def test_a_mistake_is_found_in_bare_coordinates(
    bare: pd.DataFrame, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare["Z"] = -bare["Z"]
    bare[[*SENT, "X", "Y", "Z"]].to_csv(tmp_path / "run.csv", index=False)
    assert run_verb("check", tmp_path / "run.csv", "--model", DATA / "machine.toml", "--json") == 0
    (found,) = json.loads(capsys.readouterr().out)["findings"]
    assert found["mistake"] in ("axis-sign", "axes-swapped") and found["rms_um"]["after"] < 50.0


@pytest.mark.parametrize("rows", [1, 60])
def test_bare_coordinates_alone_are_targets(rows: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = pd.read_csv(DATA / "run.csv")[:rows].rename(columns={f"{axis}_cmd": axis for axis in "xyz"})
    run[["x", "y", "z"]].to_csv(tmp_path / "targets.csv", index=False)
    assert run_verb("check", tmp_path / "targets.csv", "--model", DATA / "machine.toml") == 0
    assert ("there are no readings (60 rows)" if rows > 1 else "too little to judge") in capsys.readouterr().out


def test_a_file_that_is_read_for_its_roles_first_is_asked_about_once() -> None:
    questions = []

    def ask(question: str, choices: object) -> str:
        questions.append(question)
        return "a"

    once = ask_once(ask)
    assert [once("which?", ("a", "b")), once("which?", ["a", "b"]), once("what?", ("a",))] == ["a", "a", "a"]
    assert questions == ["which?", "what?"]
