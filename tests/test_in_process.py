"""`ptt.commands.main.run`: a verb in the running process does what the command does, and the process goes on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ptt.commands.main import run

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "data"
MACHINE = str(DATA / "machine.toml")


def process(*words: str, program: tuple[str, ...] = ("-m", "ptt.commands.main")) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, *program, *words], capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.mark.parametrize(
    "words",
    [
        ["--help"],
        ["predict", "--help"],
        ["train", "--help"],
        [],
        ["levitate"],
        pytest.param(["predict", "none.csv", "--model", MACHINE, "--out", "none/out.csv"], marks=pytest.mark.long),
        ["predict", str(DATA / "targets.csv")],
        ["compare", "--no-such-option"],
    ],
)
def test_text_and_code_are_those_of_a_process(words, capsys):
    code = run(words)
    here, there = capsys.readouterr(), process(*words)
    assert (code, here.out, here.err) == (there.returncode, there.stdout, there.stderr)


def test_figures_are_those_of_a_process(tmp_path, capsys):
    words = ["predict", str(DATA / "targets.csv"), "--model", MACHINE, "--json", "--out"]
    assert run([*words, tmp_path / "a.csv"]) == 0
    here = json.loads(capsys.readouterr().out)
    there = json.loads(process(*words, str(tmp_path / "b.csv")).stdout)
    assert {**here, "out": ""} == {**there, "out": ""}
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_a_code_of_three_comes_back_as_it_is(tmp_path, capsys):
    (tmp_path / "far.csv").write_text("x_cmd,y_cmd,z_cmd\n0,0,0\n5000,0,0\n")
    assert run(["predict", str(tmp_path / "far.csv"), "--model", MACHINE, "--out", str(tmp_path / "s.csv")]) == 3
    assert (tmp_path / "s.csv").exists() and "not sent" in capsys.readouterr().err


READINGS = [(x, y, z) for x in (-30, 0, 30) for y in (-20, 10) for z in (0, 25)]
DATA_THAT_CANNOT_WORK = {  # verb, rows of x, y, z; all cells are whole
    "one pose, nothing to hold out": ("evaluate", READINGS[:1] * 9),
    "no pose twice": ("iso", READINGS),
}


@pytest.mark.parametrize("case", DATA_THAT_CANNOT_WORK)
def test_a_whole_file_of_which_nothing_follows_is_named(case, tmp_path, capsys):
    verb, places = DATA_THAT_CANNOT_WORK[case]
    lines = [f"{x},{y},{z},{x},{y},{z + 0.001 * row}" for row, (x, y, z) in enumerate(places)]
    (tmp_path / "few.csv").write_text("\n".join(["x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas", *lines]) + "\n")
    (tmp_path / "m.toml").write_text("\n".join(Path(MACHINE).read_text().split("[tracker]")[:1]) + "\n")
    assert run([verb, str(tmp_path / "few.csv"), "--model", str(tmp_path / "m.toml"), "--json"]) == 3
    out, err = capsys.readouterr()
    assert out == "" and [line for line in err.splitlines() if line.startswith(f"error: {tmp_path}/few.csv")]


def test_train_is_a_verb_too(tmp_path, capsys):
    words = ["none.csv", "--machine", MACHINE, "--out", str(tmp_path / "out")]
    assert run(["train", *words]) == 2
    ended = process(*words, program=("train.py",))
    assert capsys.readouterr().err == ended.stderr
    assert ended.returncode == 2 and ended.stderr.count("\n") == 1 and "none.csv" in ended.stderr
    assert not (tmp_path / "out").exists()
    assert len((ROOT / "train.py").read_text().splitlines()) < 30


@pytest.mark.parametrize(
    ("raised", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "error: interrupted"),
        (SystemExit(7), 7, ""),
        (SystemExit(None), 0, ""),
        (SystemExit("enough"), 1, "error: enough"),
        (RuntimeError("broken"), 1, "error: unexpected RuntimeError: broken; PTT_TRACEBACK=1 shows where"),
    ],
)
def test_nothing_ends_the_process(raised, code, said, monkeypatch, capsys):
    def fail(*_: object) -> None:
        raise raised

    monkeypatch.setattr("ptt.effects.library", fail)
    assert run(["effects"]) == code
    assert capsys.readouterr().err.strip() == said


def test_a_traceback_that_was_asked_for_is_printed_and_the_process_goes_on(monkeypatch, capsys):
    monkeypatch.setenv("PTT_TRACEBACK", "1")
    monkeypatch.setattr("ptt.effects.library", lambda *_: 1 / 0)
    assert run(["effects"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_one_text_instead_of_words_is_refused_in_words(capsys):
    assert run("compare run.csv") == 2
    assert "a list of words" in capsys.readouterr().err


def test_the_environment_stays_as_it_was(monkeypatch, capsys):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    assert run(["effects", "--json"]) == 0
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"
    assert "OMP_NUM_THREADS" not in os.environ and json.loads(capsys.readouterr().out)["effects"]


POOLS = """
import numpy, scipy.linalg, torch
from threadpoolctl import threadpool_info
import ptt, ptt.door.model, ptt.effects
from ptt.commands.main import run
from ptt.threads import one_thread

def pools():
    return [pool["num_threads"] for pool in threadpool_info()]

def look(path, load=ptt.door.model.load):
    assert set(pools()) == {1}
    return load(path)

before = pools()
ptt.door.model.load = look
ptt.load(%r)
ptt.effects.library = lambda *own, library=ptt.effects.library: look(%r) and library(*own)
assert run(["effects"]) == 0
with one_thread(), one_thread():
    assert set(pools()) == {1}
assert pools() == before and max(before) > 1, (before, pools())
"""


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has no threads to wait for")
def test_the_front_door_calculates_on_one_thread_whatever_was_loaded_before_it():
    """Two threads of numpy's linear algebra take four times as long as one for arrays of this size."""
    environment = {name: value for name, value in os.environ.items() if "NUM_THREADS" not in name}
    done = subprocess.run(
        [sys.executable, "-c", POOLS % (MACHINE, MACHINE)], env=environment, cwd=ROOT, capture_output=True
    )
    assert done.returncode == 0, done.stderr.decode()


def test_it_needs_no_import_but_that_of_ptt():
    code = "import ptt; assert ptt.commands.main.run(['--version']) == 0; ptt.errors.PttError"
    told = process(program=("-c", code))
    assert (told.returncode, told.stderr) == (0, "") and told.stdout.startswith("ptt ")
    late = process(program=("-c", "import ptt, ptt.commands.common; ptt.commands.main.run"))
    assert late.returncode == 0, late.stderr
