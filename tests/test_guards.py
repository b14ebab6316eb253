"""What is refused before anything is computed, and what is kept when something goes wrong on the way."""

import importlib
import json
import os
import re
import resource
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings

import ptt
from ptt import files
from ptt.commands.main import run
from ptt.commands.outputs import file_kind
from ptt.correct.training.notes import check_notes
from ptt.documents import parse_toml
from ptt.door.run import read
from ptt.effects.registry import library
from ptt.errors import HostError, InputError, MachineError, TableError, WorkspaceError
from ptt.files import temporary, write_text
from ptt.judge.history import read_entries
from ptt.judge.iso.figures import read_axis_figures
from ptt.machine import ThreePttSpec, format_machine, parse_machine
from ptt.model.entries import read_model
from ptt.run.backlash.scale import read_scale_log
from ptt.run.readers.columns import GREATEST
from ptt.run.reading import read_table

ROOT = Path(__file__).resolve().parents[1]
MACHINE = ROOT / "data" / "machine.toml"
HEAD = "x_cmd,y_cmd,z_cmd,payload_kg,x_meas,y_meas,z_meas"
RUN = f"{HEAD}\n1,2,3,0,1.1,2,3\n2,2,3,0,2.1,2,3\n"
BARE = '[machine]\nkind = "three-ptt"\nbase_radius_mm = 200\nplatform_radius_mm = 100\nlink_length_mm = 300\n'
BARE += "slider_travel_mm = [150, 420]\n"
QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def put(place: Path, text: str, name: str = "run.csv") -> Path:
    path = place / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def place(tmp_path):
    put(tmp_path, RUN)
    put(tmp_path, "x_cmd,y_cmd,z_cmd\n40,2,3\n-40,30,9\n", "targets.csv")
    put(tmp_path, BARE, "machine.toml")
    put(tmp_path, 'machine = "machine.toml"\n[drive]\nhoming_mm = [0.1, 0, 0]\n', "rig.toml")
    put(tmp_path, "G21\nG1 X3 F600\n", "part.ngc")
    put(tmp_path, "years of work", "thesis.tex")
    (tmp_path / "way.toml").symlink_to("machine.toml")
    (tmp_path / "way.csv").symlink_to("run.csv")
    os.link(tmp_path / "machine.toml", tmp_path / "hard.toml")
    return tmp_path


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


@pytest.mark.parametrize("words", [words for words, _ in WRITERS if "DIR" not in words and "train" not in words][:9])
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
    assert run(["simulate", "rig.toml", "far.csv", "--out", "out.csv"]) == 2
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


LOG = "slider,command_turns,scale_mm\n"


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (read_scale_log, LOG + "1,0,0\n1,1\n1,2,10\n", r"row 3: 2 cells where 3 are expected"),
        (read_scale_log, LOG + "1,0,0\n1,1,5,7\n", r"row 3: 4 cells where 3"),
        (read_scale_log, LOG + '1,0,0\n"1,1,5\n1,2,10\n', r"row 3: a quote is opened and not closed"),
        (read_scale_log, LOG + "1,0,0\n1,1,1e300\n", r"row 3, column scale_mm: 1e300 is beyond any machine"),
        (read_scale_log, LOG.replace("slider", "scale_mm"), "no rows"),
        (read_axis_figures, "direction,target_mm,measured_mm\nup,0,0\nup,50\n", r"row 3: 2 cells where 3"),
        (read_axis_figures, "direction,target_mm,measured_mm\nup,0,0\nup,1e99,0\n", r"row 3.*beyond any machine"),
        (read_table, RUN + "3,2,3,0,1\n", r"row 4: 5 cells where 7"),
        (read_table, RUN + '3,2,3,0,1,2,"3\n4,2,3,0,1,2,3\n', r"row 4: a quote is opened and not closed"),
        (read_table, RUN + "3,2,3,0,1e150,2,3\n", r"row 4, column x_meas: 1e150 is beyond any machine"),
        (read_table, RUN + f"3,2,3,0,{'9' * 400},2,3\n", r"row 4, column x_meas: not a number|beyond any machine"),
    ],
)
def test_rows_are_whole_and_numbers_bounded(read, text, said, tmp_path):
    with pytest.raises(TableError, match=said) as caught:
        read(put(tmp_path, text), **({"lead_mm": 5.0} if read is read_scale_log else {}))
    assert len(str(caught.value)) < 600


@QUICK
@given(exponent=st.floats(10.0, 307.0), sign=st.sampled_from([-1.0, 1.0]), column=st.integers(0, 6))
def test_what_no_machine_can_mean_is_refused_by_cell(tmp_path, exponent, sign, column):
    cells = ["3", "2", "3", "0", "1", "2", "3"]
    cells[column] = repr(sign * 10.0**exponent)
    with pytest.raises(TableError, match=rf"row 4, column {HEAD.split(',')[column]}: .* beyond any machine"):
        read_table(put(tmp_path, RUN + ",".join(cells) + "\n"))
    assert GREATEST["length"] < 1e10


CELLS = st.one_of(
    st.text(max_size=200), st.sampled_from(["nan", "1e5", '"', "1,2", "\u202e", "9" * 500, "1_0", "0x1", "١٢"])
)


@QUICK
@given(cell=CELLS, column=st.integers(0, 6), title=st.booleans())
def test_any_text_in_a_cell_is_read_or_refused_in_one_bounded_line(tmp_path, cell, column, title):
    lines = [line.split(",") for line in (RUN + "3,2,3,0,1,2,3").splitlines()]
    lines[0 if title else 3][column] = cell
    path = tmp_path / "run.csv"
    path.write_bytes("\n".join(",".join(line) for line in lines).encode("utf-8", "replace"))
    try:
        table = read_table(path)
    except TableError as error:
        assert len(str(error)) < 700 and str(error).isprintable()
        assert cell[:80] not in str(error) or len(cell) < 80  # at most 60 characters are quoted
    else:
        assert np.isfinite(table.target).all()


@pytest.mark.parametrize("text", ["x " * 15_000, "x" * 30_000, "[" * 30_000, "a/" * 15_000])
@pytest.mark.parametrize("where", ["title", "cell", "comment"])
def test_long_titles_and_cells_take_a_bounded_time(text, where, tmp_path):
    body = {
        "title": RUN.replace("payload_kg", text),
        "cell": RUN + f"3,2,3,{text},1,2,3\n",
        "comment": f"# {text}\n{RUN}",
    }
    path = put(tmp_path, body[where])
    started = time.process_time()
    try:
        read_table(path)
    except TableError as error:
        assert len(str(error)) < 500
    assert time.process_time() - started < 1.0  # 5.4 s before


KEYS = [*ThreePttSpec.model_fields, "colour"]
VALUES = st.recursive(
    st.one_of(
        st.booleans(), st.integers(), st.floats(), st.text(max_size=80), st.sampled_from([1e308, 1e-308, 10**400])
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(["a", "b"]), inner, max_size=2)
    ),
    max_leaves=6,
)


def toml_of(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(toml_of, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml_of(item)}" for key, item in value.items()) + "}"
    return json.dumps(value) if isinstance(value, str) else repr(value)


@QUICK
@given(key=st.sampled_from(KEYS), value=VALUES)
def test_any_value_of_any_key_is_taken_or_refused_by_its_key(key, value):
    kept = [line for line in BARE.splitlines() if not line.startswith(f"{key} =")]
    try:
        machine = parse_machine("\n".join([*kept, f"{key} = {toml_of(value)}"]) + "\n").machine
    except MachineError as error:
        assert len(str(error)) < 700 and str(error).isprintable()
    else:
        assert np.isfinite(getattr(machine, "link_length_mm"))  # noqa: B009


FIGURES = {"x": 1.0, "y": 2.0, "z": 3.0, "total": 4.0}
STEP = {
    "date": "2026-03-15T10:00:00+00:00", "command": "add", "kind": "added", "added": ["backlash"], "rows": 80,
    "helped": True, "files": [{"file": "a.csv", "sha256": "00"}], "ranges": {"temp_c": [20.0, 22.0]},
    "error_before_um": FIGURES, "error_after_um": FIGURES, "heldout_before_um": FIGURES, "heldout_after_um": FIGURES,
    "noise_um": {**FIGURES, "source": "repeats"}, "parameters_before": {"backlash": {"gap_mm": [0.1, 0.2, 0.3]}},
}  # fmt: skip


@QUICK
@given(key=st.sampled_from(sorted(STEP)), inner=st.integers(0, 3), value=VALUES)
def test_any_value_in_a_step_of_the_history_is_taken_or_refused_by_the_file(key, inner, value):
    """What is taken can be used: a total that is a list was found out by the verb that needed it, as an accident."""
    held = STEP[key]
    if inner and isinstance(held, dict):
        value = {**held, sorted(held)[inner % len(held)]: value}
    elif inner and isinstance(held, list):
        value = [*held[:-1], value]
    text = "[[history]]\n" + "".join(f"{name} = {toml_of(item)}\n" for name, item in {**STEP, key: value}.items())
    try:
        file = parse_machine(BARE + text)
        (step,) = read_entries(file) or (None,)
    except MachineError as error:
        assert len(str(error)) < 700 and str(error).isprintable()
        return
    if step is not None:
        assert all(isinstance(figures["total"], float) for figures in (step.heldout_after_um, step.noise_um))
        assert all(low <= 1e12 and high <= 1e12 for low, high in file.history[0]["ranges"].values())
    assert "[[history]]" in format_machine(file)


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000 + "]" * 5000, "a." * 3000 + "b = 1", "a = " + "9" * 5000, "a = 1e400"]
)
def test_deep_and_endless_toml_is_refused(text):
    with pytest.raises(InputError) as caught:
        parse_toml(text, "m.toml")
    assert str(caught.value).startswith("m.toml") and len(str(caught.value)) < 300


NOTES = {
    "format": 1,
    "sha256": {"model.toml": "a", "rbf.safetensors": "b"},
    "trained_on": [{"file": "run.csv", "sha256": "c"}],
    "heldout_rms_um": {"physics": {"x": 1.0, "y": 1.0, "z": 1.0, "total": 1.7}},
    "protocol": "blocks",
    "rbf": {"centres": 8, "spread": 1.0, "learned": [True, True, False], "share": 0.5, "inputs": "tool"},
}  # fmt: skip


PATHS = ["format", "sha256", "trained_on", "heldout_rms_um", "heldout_rms_um.physics", "heldout_rms_um.physics.total"]
USED = ("rbf", "rbf.centres", "rbf.learned", "rbf.share", "protocol", "trained_on", "heldout_rms_um")  # by the report


@pytest.mark.parametrize("path", USED)
@pytest.mark.parametrize("gone", [True, False])
def test_what_a_report_reads_of_a_compensator_is_there(path, gone):
    notes = json.loads(json.dumps(NOTES))
    *above, last = path.split(".")
    holder = notes[above[0]] if above else notes
    if gone:
        del holder[last]
    else:
        holder[last] = None
    with pytest.raises(InputError, match=re.escape(f"compensator.json, {path}")):
        check_notes(notes, "comp")


@QUICK
@given(
    path=st.sampled_from([*PATHS, "rbf", "rbf.learned", "rbf.centres"]).map(lambda text: text.split(".")), value=VALUES
)
def test_notes_of_a_compensator_are_of_their_kind_or_refused_by_key(path, value):
    notes = json.loads(json.dumps(NOTES))
    assert check_notes(notes, "comp") == NOTES
    holder = notes
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    try:
        kept = check_notes(notes, "comp")
    except InputError as error:
        assert f"compensator.json, {'.'.join(path)}" in str(error) and len(str(error)) < 500
    else:
        assert type(kept["format"]) is int and isinstance(kept["sha256"], dict)


OWN = (ROOT / "benchmarks" / "fuzz_inputs.py").read_text().split("OWN = '''")[1].split("'''")[0]
EYE = "torch.eye(3, 2, dtype=torch.float64)"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"pull"', "3", "name 3 is no name"),
        ("count=2", "count=0", "count = 0, not a whole number"),
        ("count=2", "count=10**9", "not a whole number from 1 to"),
        ("1e-4", 'float("nan")', "usual size nan"),
        ('mechanisms = ("three-ptt",)', "mechanisms = 3", "mechanisms = 3"),
        ("requires = ()", 'requires = ("moon",)', "requires = "),
        (f"height[:, None, None] * {EYE}", f"(height[:, None, None] * {EYE}).float()", "float32 of shape"),
        (EYE, "torch.eye(3, 2, dtype=torch.float32).to(torch.complex64)", "complex"),
        (EYE, "torch.eye(3, 3, dtype=torch.float64)", r"float64 of shape \(\d+, 3, 3\)"),
        (EYE, f"float('nan') * {EYE}", "holds nan"),
        ("return height", "import sys; sys.exit(); return height", "it ends the program"),
        (
            "return height",
            "raise ValueError('no')\n        return height",
            r"line 20: basis of pull fails: ValueError: no",
        ),
        ("import torch\n", "import sys; sys.exit(0)\n", "it ends the program"),
        ("    def basis(", "    async def basis(", "is async"),
        (
            "    def basis(",
            "    def shift(self, theta, view): return theta\n\n    def basis(",
            "shift of pull is float64 of",
        ),
        (
            "    def basis(",
            "    shift = lambda self, theta, view: theta[0] * view.q\n    slope = lambda self, theta, view: view.q\n\n"
            "    def basis(",
            "slope of pull is float64 of",
        ),
        ("Pull(Effect)", "Pull(Effect, int)", "cannot be made"),
    ],
)
def test_own_effects_of_the_wrong_form_are_refused_by_their_file(old, new, said, tmp_path):
    path = put(tmp_path, OWN.replace(old, new, 1), "own.py")
    with pytest.raises(InputError, match=said) as caught:
        library(path)
    assert str(caught.value).startswith(str(path))


def test_what_an_own_effect_prints_stays_off_standard_output(tmp_path, capsys):
    text = OWN.replace("import torch\n", "import torch\nprint('hello')\n", 1).replace(
        "return height", "print('x'); return height"
    )
    library(put(tmp_path, text, "own.py"))
    assert capsys.readouterr().out == ""


def test_version_says_what_figures_come_from(capsys):
    assert run(["--version", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"ptt", "python", "torch", "numpy", "scipy", "pandas"} <= set(found) and found["torch"]
    assert run(["--version"]) == 0 and capsys.readouterr().out.startswith("ptt ")


@pytest.mark.parametrize("program", ["ptt.__main__", "train"])
def test_ctrl_c_while_the_program_is_loaded_is_one_line_too(program, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(ROOT))
    main = importlib.import_module(program).main

    class Loading:
        def __getattr__(self, name):
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "ptt.commands.main", Loading())
    monkeypatch.setattr("os._exit", sys.exit)
    monkeypatch.setattr("atexit._run_exitfuncs", lambda: None)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130 and capsys.readouterr().err == "error: interrupted\n"


def test_what_was_tested_can_be_had_again():
    pinned = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    names = {line.split("==")[0].lower() for line in pinned}
    assert all(line.count("==") == 1 for line in pinned)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = {text.split(">")[0].lower() for text in project["dependencies"]}
    assert needed <= names and project["license"]


def test_an_effect_of_a_long_name_is_refused_in_few_words():
    file = parse_machine(f'{BARE}[[effect]]\nname = "{"x" * 30_000}"\n')
    with pytest.raises(InputError) as caught:
        read_model(file)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("sigma", ["1e-308", "1e-12", "0.0", "-1.0"])
def test_a_scatter_that_no_tracker_has_is_refused_by_its_key(sigma):
    with pytest.raises(MachineError, match=r"machine\.toml key tracker\.sigma_mm"):
        parse_machine(f"{BARE}[tracker]\nsigma_mm = {sigma}\n")


@pytest.mark.parametrize("azimuth", ["[0, 120, 0]", "[0, 120, 119.9999]", "[0, 360, 240]", "[-1e9, 120, 240]"])
def test_sliders_at_one_azimuth_are_refused_by_the_key(azimuth):
    with pytest.raises(MachineError, match=r"machine\.toml key machine\.slider_azimuth_deg: .*azimuth"):
        parse_machine(f"{BARE}slider_azimuth_deg = {azimuth}\n")
    assert parse_machine(f"{BARE}slider_azimuth_deg = [-120, 0, 120]\n").machine.kind == "three-ptt"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("slider_azimuth_deg = [true, 120, 240]", r"machine\.slider_azimuth_deg\[1\]: .*\(found True\); write it as a"),
        ('joint_height_mm = "3"', r"machine\.joint_height_mm: .*\(found '3'\); write it as a plain number"),
        ("reference_temp_c = 293", r"machine\.reference_temp_c: .*\(found 293.*\); give it in degrees C, such as 20"),
        ('[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_mm = {value = [1, 1, 1], std = [0.1, -0.1, 0.1]}',
         r"effect\[1\]\.parameters\.gap_mm\.std\[2\]: .*\(found -0\.1\); give a standard deviation, zero or more"),
    ],
)  # fmt: skip
def test_what_is_no_number_of_its_key_is_refused_by_it(text, said):
    with pytest.raises(MachineError, match=rf"machine\.toml key {said}"):
        parse_machine(f"{BARE}{text}\n")


def test_what_a_controller_cannot_compensate_is_named():
    file = parse_machine(f'{BARE}[controller]\ncompensates = ["backlash", "backlsh"]\n')
    with pytest.raises(InputError, match=r"key controller\.compensates: effect 'backlsh' .* did you mean 'backlash'"):
        read_model(file)
    own = parse_machine(f'{BARE}[controller]\ncompensates = ["once-per-rev[harmonic 2]", "my own thing"]\n')
    assert read_model(own).file.controller.compensates == ("once-per-rev[harmonic 2]", "my own thing")


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


def test_a_screw_finer_than_any_is_refused_by_its_key(tmp_path):
    text = (ROOT / "data" / "machine.toml").read_text()
    for old, new in (("screw_lead_mm = 5", "screw_lead_mm = 1e-9 #"), ("screw_lead_mm = 5", "screw_lead_mm = 1e9 #")):
        assert old in text
        with pytest.raises(InputError, match="screw_lead_mm"):
            parse_machine(text.replace(old, new, 1))
