"""docs/json.md names the top-level keys that each verb prints with --json."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from library_folder import DATA, ROOT
from library_folder import here as here

from ptt.commands.main import run

PAGE = ROOT / "docs" / "json.md"
BY_MODEL = ["--model", "solved.toml"]
CASES = {  # as the page has them, in an order in which each finds what it reads
    "check RUN": ["check", "run.csv", "--model", "machine.toml"],
    "check MACHINE": ["check", "machine.toml"],
    "compare": ["compare", "run.csv", "--model", "machine.toml"],
    "diagnose": ["diagnose", "run.csv", "--model", "machine.toml"],
    "add": ["add", "run.csv", "backlash", "--model", "machine.toml", "--out", "solved.toml"],
    "fit": ["fit", "run.csv", *BY_MODEL, "--out", "refit.toml"],
    "remove": ["remove", "run.csv", "backlash", *BY_MODEL, "--out", "less.toml"],
    "train": ["train", "run.csv", "--machine", "solved.toml", "--out", "comp"],
    "predict": ["predict", "targets.csv", *BY_MODEL, "--out", "sent.csv"],
    "evaluate RUN": ["evaluate", "run.csv", *BY_MODEL],
    "evaluate BEFORE AFTER": ["evaluate", "run.csv", "run.csv"],
    "recheck": ["recheck", "run.csv", *BY_MODEL],
    "export": ["export", *BY_MODEL, "--to", "marlin", "--out", "m.txt"],
    "program": ["program", "part.ngc", *BY_MODEL, "--out", "part2.ngc"],
    "simulate": ["simulate", str(DATA / "rigs" / "experiment1.toml"), "targets.csv", "--out", "made.csv"],
    "backlash": ["backlash", str(DATA / "scale.csv"), "--model", str(DATA / "machine.toml")],
    "iso RUN": ["iso", "again.csv", "--any-direction"],
    "plan": ["plan", "machine.toml", "--out", "poses.csv", "--rows", "60"],
    "dexterity": ["dexterity", "machine.toml"],
    "report": ["report", "run.csv", *BY_MODEL, "--out", "r.html"],
    "effects": ["effects"],
    "effects NAME": ["effects", "backlash"],
}


@pytest.fixture(scope="module")
def place(here: Path) -> Path:
    """A folder with a run, the poses of another that were measured twice, and a program."""
    rows = pd.read_csv(here / "run.csv")
    poses = rows[rows["role"] != "base"].head(12).drop(columns="time_s")
    pd.concat([poses, poses]).to_csv(here / "again.csv", index=False)
    (here / "part.ngc").write_text("G21 G90\nG1 X3 F600\nG1 X5 Y2\n")
    return here


def told() -> dict[str, list[str]]:
    """Keys by case, as the page has them."""
    lines = re.findall(r"^\| `([^`]+)` \| (.*) \|$", PAGE.read_text(), flags=re.MULTILINE)
    return {case: re.findall(r"\w+", keys) for case, keys in lines}


def test_the_page_has_every_key_that_a_verb_prints(place: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(place)
    printed = {}
    for case, words in CASES.items():
        assert run([*words, "--json"]) == 0, case
        printed[case] = list(json.loads(capsys.readouterr().out))
    assert printed == told()
