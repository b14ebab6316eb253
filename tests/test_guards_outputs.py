"""Outputs: never onto inputs or files of another kind, whole or not at all, and nothing left behind."""

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from small_files import BARE, RUN, put
from small_files import place as place

import ptt
from ptt import files
from ptt.commands.main import run
from ptt.commands.outputs import file_kind
from ptt.door.run import read
from ptt.errors import HostError, InputError, WorkspaceError
from ptt.files import temporary, write_text

ROOT = Path(__file__).resolve().parents[1]


# Every verb with a file for its output, and its inputs.
WRITERS = [
    ("add run.csv backlash --model machine.toml --out {}", "run.csv machine.toml way.toml hard.toml way.csv"),
    ("remove run.csv backlash --model machine.toml --out {}", "run.csv machine.toml"),
    ("fit run.csv --model machine.toml --out {}", "run.csv machine.toml way.toml"),
    ("report run.csv --model machine.toml --out {}", "run.csv machine.toml"),
    ("simulate rig.toml targets.csv --out {}", "rig.toml targets.csv"),
    ("simulate rig.toml targets.csv --out new.csv --truth {}", "rig.toml targets.csv run.csv new.csv"),
    ("predict targets.csv --model machine.toml --out {}", "targets.csv machine.toml run.csv way.csv"),
    ("plan machine.toml --out {}", "machine.toml run.csv"),
    ("plan machine.toml --candidates targets.csv --out {}", "targets.csv"),
    ("train run.csv --machine machine.toml --out {}", "run.csv machine.toml"),
    ("check run.csv --model machine.toml --out-run {}", "run.csv machine.toml way.csv"),
    ("check run.csv --model machine.toml --out-model {}", "run.csv machine.toml hard.toml"),
    ("diagnose run.csv --model machine.toml --measure-next {}", "run.csv machine.toml"),
    ("export --model machine.toml --to klipper --out {}", "machine.toml way.toml run.csv rig.toml targets.csv"),
    ("program part.ngc --model machine.toml --out {}", "part.ngc machine.toml run.csv targets.csv"),
    ("dexterity machine.toml --plot {}", "machine.toml"),
]


@pytest.mark.parametrize(("words", "ontos"), WRITERS, ids=lambda value: value[:40])
def test_outputs_never_go_onto_inputs_or_files_of_another_kind(words, ontos, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    before = {each.name: each.read_bytes() for each in place.iterdir()}
    for onto in [*ontos.split(), "thesis.tex"]:
        assert run(words.format(onto).split()) == 2
        said = capsys.readouterr()
        assert said.err.startswith("error: ") and len(said.err.splitlines()) == 1 and not said.out
        assert onto in said.err or "new.csv" in onto
    assert {each.name: each.read_bytes() for each in place.iterdir()} == before


TWICE = [
    "simulate rig.toml targets.csv --out out.csv",
    "check out.csv --model machine.toml --out-run mended.csv --out-model mended.toml",
    "predict targets.csv --model machine.toml --out sliders.csv",
    "program part.ngc --model machine.toml --out out.ngc",
    "export --model machine.toml --to klipper --out printer.cfg",
    "export --model machine.toml --to table --step 60 --out grid.csv",
]


def test_an_earlier_output_of_the_same_command_is_replaced(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    for words in TWICE:
        assert [run(words.split()), run(words.split())] == [0, 0], capsys.readouterr().err


@pytest.mark.parametrize("words", [words for words, _ in WRITERS if not words.startswith("train")])
def test_an_output_that_is_a_folder_is_named_as_such(words, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    (place / "folder").mkdir()
    assert run(words.format("folder").split()) == 2
    assert "folder: is a folder, not a file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("dexterity machine.toml --plot new.csv", "new.csv: ends in .csv, but would be a picture; .* end in .png"),
        ("report run.csv --model machine.toml --out new.csv", "but would be a page; let its name end in .html"),
        ("add run.csv backlash --model machine.toml --out new.csv", "but would be a machine file"),
        ("simulate rig.toml targets.csv --out new.toml", "but would be a tracker run; let its name end in .csv"),
    ],
)
def test_a_name_that_ends_like_another_kind_of_file_is_refused(words, said, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    assert run(words.split()) == 2 and re.search(said, capsys.readouterr().err)
    assert not list(place.glob("new*"))


def test_a_target_that_the_rig_cannot_reach_is_named_by_the_line_of_its_file(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    put(place, "x_cmd,y_cmd,z_cmd\n# far away\n40,2,3\n5000,0,0\n", "far.csv")
    assert run(["simulate", "rig.toml", "far.csv", "--out", "out.csv"]) == 3
    assert "error: far.csv row 4: is out of reach; stay inside" in capsys.readouterr().err
    rows = pd.DataFrame({"x_cmd": [0.0, 5000.0], "y_cmd": 0.0, "z_cmd": 0.0})
    with pytest.raises(WorkspaceError, match="data frame row 3: is out of reach") as told:
        ptt.simulate("rig.toml", rows)
    assert told.value.rows == (1,)


def test_kinds_of_files_are_told_by_what_they_begin_with(place):
    write_text(place / "a.html", "<!doctype html>\n<p>x")
    (place / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    kinds = {name: file_kind(place / name) for name in ("run.csv", "targets.csv", "machine.toml", "a.html", "a.png")}
    assert kinds == {"run.csv": "readings", "targets.csv": "table", "machine.toml": "machine", "a.html": "page",
                     "a.png": "picture"}  # fmt: skip
    assert (file_kind(place / "rig.toml"), file_kind(place / "thesis.tex")) == ("rig", "other")
    put(place, "%\n(slot)\nN10 G1 X3\n", "old.ngc")
    put(place, "# bench (three-ptt), exported by ptt 1.0 on 2026-01-02\n[printer]\n", "printer.cfg")
    assert (file_kind(place / "part.ngc"), file_kind(place / "old.ngc")) == ("program", "program")
    assert file_kind(place / "printer.cfg") == "export"
    assert file_kind(put(place, "[printer]\nkinematics: delta\n", "own.cfg")) == "other"
    assert file_kind(put(place, "[\n  1.5, 2]\n", "list.json")) == "json"
    wide = put(place, "", "wide.csv")
    wide.write_bytes(RUN.encode("utf-16"))
    assert file_kind(wide) == "readings"


@pytest.mark.skipif(os.geteuid() != 0, reason="only the administrator may make a device")
def test_a_device_is_not_replaced(tmp_path):
    try:
        os.mknod(tmp_path / "null", 0o020666, os.makedev(1, 3))
    except OSError:
        pytest.skip("no devices in this container")
    with pytest.raises(InputError, match="is a device, not a file"):
        write_text(tmp_path / "null", "x")
    assert (tmp_path / "null").is_char_device()


def test_a_file_beyond_the_limit_is_said_and_the_old_one_stays(tmp_path):
    path = put(tmp_path, "old", "out.txt")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(HostError, match=r"out\.txt: cannot be written \(File too large\)") as caught:
            write_text(path, "x" * 10_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert caught.value.exit_code == 1
    assert path.read_text() == "old" and [each.name for each in tmp_path.iterdir()] == ["out.txt"]


@pytest.mark.parametrize(
    ("end", "code", "said"),
    [(">&-", 1, "standard output is closed"), (">/dev/full", 1, "No space left on device"), ("2>&-", 0, "")],
)
def test_a_closed_or_full_output_is_no_silence(end, code, said):
    done = subprocess.run(
        f"{sys.executable} -m ptt --version --json {end}",
        shell=True,
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == code and said in done.stderr and "Traceback" not in done.stderr
    assert code or json.loads(done.stdout)["ptt"]


def test_the_dead_are_swept_and_the_living_left(tmp_path):
    target = tmp_path / "out.txt"
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    mine = temporary(target)
    theirs = mine.replace(f".{os.getpid()}.", f".{dead.pid}.")
    for name in (f"{mine}abc", f"{theirs}abc", ".out.txt.notes"):
        put(tmp_path, "half", name)
    write_text(target, "whole")
    assert {each.name for each in tmp_path.iterdir()} == {"out.txt", f"{mine}abc", ".out.txt.notes"}


def test_ctrl_c_while_writing_leaves_nothing_half_written(place, monkeypatch, capsys):
    monkeypatch.chdir(place)

    def interrupted(handle):
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "fsync", interrupted)
    before = sorted(each.name for each in place.iterdir())
    assert run(["simulate", "rig.toml", "targets.csv", "--out", "new.csv"]) == 130
    assert capsys.readouterr().err == "error: interrupted\n"
    assert sorted(each.name for each in place.iterdir()) == before


def test_a_travel_that_holds_no_command_is_said(place):
    drawing = put(place, BARE.replace("[150, 420]", "[[1500, 4200], [150, 420], [150, 420]]"), "far.toml")
    run_with = put(place, "b1_cmd,b2_cmd,b3_cmd,x_meas,y_meas,z_meas\n290,300,310,1,2,3\n300,310,320,1,2,3\n", "b.csv")
    (line,) = [each for each in read(run_with, drawing).notes if "lies within its travel" in each]
    assert line.startswith(
        "no command of slider 1 lies within its travel (1500 to 4200 mm; the commands are 290 to 300)"
    )
    assert not [each for each in read(run_with, place / "machine.toml").notes if "lies within its travel" in each]


def test_a_run_without_end_is_refused_by_its_key(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    put(place, (place / "rig.toml").read_text() + "[conditions]\ncycles = 1000000000\n", "rig.toml")
    assert run(["simulate", "rig.toml", "targets.csv", "--out", "new.csv"]) == 2
    assert "rig.toml key conditions.cycles: 1000000000 cycles of 2 targets" in capsys.readouterr().err
