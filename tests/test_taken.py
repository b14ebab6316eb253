"""What the tracker's frame took is said with the error before and after it, and when the drawing is to blame."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.commands.main import run as command
from ptt.run.taken import frames_said

DATA = Path(__file__).resolve().parents[1] / "data" / "sealed_one"
BLAME = "the drawing or the commands are wrong"


def told(verb: str, run: Path, drawing: Path, *more: str) -> tuple[dict, str]:
    """The entry of the one frame, and what is said on standard error."""
    done = CliRunner().invoke(app, [verb, str(run), *more, "--model", str(drawing), "--json"])
    assert done.exit_code == 0, done.stderr
    (taken,) = json.loads(done.stdout)["frame_taken"]
    return taken, done.stderr


def redrawn(folder: Path, key: str, value: float) -> Path:
    lines = (DATA / "machine.toml").read_text().splitlines()
    changed = [f"{key} = {value}" if line.startswith(key) else line for line in lines]
    assert changed != lines
    (folder / "machine.toml").write_text("\n".join(changed) + "\n")
    return folder / "machine.toml"


@pytest.mark.parametrize("verb", ["compare", "add"])
def test_a_wrong_drawing_is_not_taken_up_by_the_frame_in_silence(verb: str, tmp_path: Path) -> None:
    more = () if verb == "compare" else ("backlash", "--out", str(tmp_path / "out.toml"), "--anyway")
    taken, words = told(verb, DATA / "run.csv", redrawn(tmp_path, "link_length_mm", 312.0), *more)
    assert "frame alignment shifted the readings by" in words and BLAME in words
    assert taken["before_mm"] > 5.0 and taken["as_read_mm"] < 0.7
    assert f"lay {taken['before_mm']:.3f} mm (rms) from where the drawing puts them" in words
    assert f"{taken['after_mm']:.3f} mm after it" in words


def test_a_tracker_that_stands_elsewhere_is_no_fault_of_the_drawing(tmp_path: Path) -> None:
    frame = pd.read_csv(DATA / "run.csv")
    frame["x_meas"], frame["y_meas"] = 2500.0 - frame["y_meas"], frame["x_meas"] - 800.0  # a quarter turn
    frame.to_csv(tmp_path / "run.csv", index=False)
    taken, words = told("compare", tmp_path / "run.csv", DATA / "machine.toml")
    assert "frame alignment shifted the readings by" in words and BLAME not in words
    np.testing.assert_allclose(np.abs(taken["turn_deg"]), [0.0, 0.0, 90.0], atol=0.1)
    assert taken["before_mm"] > 2000.0 and taken["after_mm"] < 0.2


def test_what_any_set_up_takes_is_not_mentioned() -> None:
    taken, words = told("compare", DATA / "run.csv", DATA / "machine.toml")
    assert "frame alignment" not in words and taken["rms_mm"] < 1.0


@pytest.mark.parametrize(("verb", "option"), [("diagnose", "--model"), ("train", "--machine"), ("evaluate", "--model")])
def test_errors_before_and_after_frame_alignment_are_printed(verb: str, option: str, tmp_path: Path, capsys) -> None:
    run = tmp_path / "run.csv"  # a part of it says as much of the frame
    pd.read_csv(DATA / "run.csv", dtype=str, keep_default_na=False, nrows=120).to_csv(run, index=False)
    words = [verb, str(run), option, str(DATA / "machine.toml")]
    words += ["--out", str(tmp_path / "comp")] if verb == "train" else []
    assert command([*words, "--json"]) == 0
    (taken,) = json.loads(capsys.readouterr().out)["frame_taken"]
    assert command(words) == 0
    said = "tracker frame: readings lay {:,.1f} um (rms) from where the drawing puts them, {:,.1f} um after alignment"
    lines = capsys.readouterr().out.splitlines()
    assert lines.count(said.format(1e3 * taken["before_mm"], 1e3 * taken["after_mm"])) == 1


def test_a_few_frames_of_many_are_said() -> None:
    frames = [{"run": f"run {run}", "before_mm": 1.0 + run, "after_mm": 0.1} for run in range(9)]
    said = frames_said(frames)
    assert said[0].startswith("tracker frame of run 0: readings lay 1,000.0 um") and said[-1] == "and 6 more frames"
    assert len(said) == 4 and frames_said([]) == []
