"""The command line: verbs, exit codes, one-line errors, JSON that is JSON."""

import json
import math
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke

from ptt.commands import common
from ptt.commands.main import VERBS, guard
from ptt.commands.numbers import require_numbers
from ptt.door.options import parse_settings
from ptt.errors import InputError, PttError
from ptt.record import plain

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "data"
MACHINE = str(DATA / "machine.toml")


def error_line(result, code=2) -> str:
    """The only line on standard error."""
    lines = result.stderr.splitlines()
    assert result.exit_code == code, (result.stdout, result.stderr)
    assert len(lines) == 1 and lines[0].startswith("error: "), result.stderr
    assert result.stdout == ""
    return lines[0]


def test_help_lists_exactly_the_verbs_whose_file_is_there():
    listed = [line.split()[0] for line in invoke("--help").stdout.split("Commands:")[1].splitlines() if line.strip()]
    here = {path.stem for path in (ROOT / "ptt" / "commands").glob("*.py")}
    assert [verb for verb in listed if verb in VERBS] == [verb for verb in VERBS if verb in here]
    assert "train" not in listed


def test_a_verb_without_a_file_is_not_there(monkeypatch):
    monkeypatch.setattr("ptt.commands.main.VERBS", (*VERBS, "levitate"))
    assert "levitate" not in invoke("--help").stdout


def test_a_mistyped_verb_is_suggested():
    assert "did you mean 'predict'" in error_line(invoke("predcit"))


def test_a_missing_option_is_one_line():
    assert "--out" in error_line(invoke("predict", DATA / "targets.csv", "--model", MACHINE))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("diagnose", "--model", "m.toml"), "5 readings are too few for a verdict"),
        (("iso",), "no pose was measured twice"),
        (("add", "screw-growth", "--model", "m.toml", "--out", "m2.toml"), "this run cannot test 'screw-growth'"),
    ],
)
def test_a_sound_file_with_too_little_in_it_ends_with_three(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (DATA / "sealed_one" / "run.csv").read_text().splitlines()[:6]
    Path("five.csv").write_text("\n".join(rows) + "\n")
    Path("m.toml").write_text((DATA / "sealed_one" / "machine.toml").read_text())
    verb, *more = words
    result = invoke(verb, "five.csv", *more)
    assert result.exit_code == 3 and said in result.stderr.splitlines()[-1] and result.stdout == ""


def test_start_imports_nothing_heavy_and_takes_less_than_pandas_alone():
    code = (
        "import sys; from ptt.commands.main import app; from typer.testing import CliRunner;"
        "CliRunner().invoke(app, ['--help']);"
        "print([m for m in ('torch', 'pandas', 'scipy', 'numpy', 'matplotlib', 'pydantic') if m in sys.modules])"
    )
    started = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert started.stdout.strip() == "[]"
    own, other = (
        min(_processor_seconds(*words) for _ in range(3))
        for words in (("-m", "ptt.commands.main", "--help"), ("-c", "import pandas"))
    )
    assert own < other


def _processor_seconds(*words: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.parametrize(
    ("raised", "code", "shown"),
    [
        (InputError("odd", where="a.csv", fix="mend it"), 2, "error: a.csv: odd; mend it"),
        (PttError("failed"), 1, "error: failed"),
        (FileNotFoundError(2, "No such file or directory", "b.csv"), 2, "error: b.csv: No such file or directory"),
        (KeyError("x"), 1, "error: unexpected KeyError"),
        (KeyboardInterrupt(), 130, "error: interrupted"),
    ],
)
def test_every_exception_becomes_one_line_and_a_code(raised, code, shown, capsys):
    def fail() -> None:
        common.note("a note that is of no use now")
        raise raised

    assert guard(fail) == code
    printed = capsys.readouterr()
    assert printed.err.startswith(shown) and printed.err.count("\n") == 1 and printed.out == ""


def test_notes_wait_for_the_result_and_stay_off_standard_output(capsys):
    assert guard(lambda: (common.note("understood"), common.show({"a": float("nan")}, "text", True))) == 0
    printed = capsys.readouterr()
    assert printed.err == "understood\n" and json.loads(printed.out) == {"a": None}


def test_plain_leaves_only_what_json_knows():
    value = {"a": np.float64("inf"), 1: (np.int64(2), np.array([1.0, np.nan])), "p": Path("x"), "s": {"b", "a"}}
    assert plain(value) == {"a": None, "1": [2, [1.0, None]], "p": "x", "s": ["a", "b"]}


def test_settings_are_read_or_refused():
    assert parse_settings(["payload_kg=2", "temp_c = 21.5"]) == {"payload_kg": 2.0, "temp_c": 21.5}
    with pytest.raises(InputError, match="payload_kg=2"):
        parse_settings(["payload_kg"])


def test_a_file_that_is_no_machine_is_asked_about():
    line = error_line(invoke("compare", DATA / "experiment1.csv", "--model", DATA / "README.md"))
    assert "not valid TOML" in line and line.endswith("is this a machine file?")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("evaluate run.csv run.csv --goal nan", "--goal: nan is not a finite number; give percent, as 90,90,80"),
        ("evaluate run.csv run.csv --goal 90,inf,80", "--goal: inf is not a finite number"),
        ("simulate rig.toml t.csv --out o.csv --seed -1", "'--seed'"),
        ("plan m.toml --out o.csv --seed -3", "'--seed'"),
        ("program i.ngc --model m.toml --out o.ngc --start nan 0 0", "--start: nan is not a finite number"),
        ("program i.ngc --model m.toml --out o.ngc --offset 1e300 0 0", "--offset: 1e+300 is beyond any machine"),
        ("program i.ngc --model m.toml --out o.ngc --chord-um inf", "--chord-um: inf is not a finite number"),
        ("challenge new o.csv --rows 1000000000", "'--rows'"),
    ],
)
def test_numbers_that_mean_nothing_are_refused_before_anything_is_written(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in error_line(invoke(*words.split()))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "verb, named", [("iso", ("RUN.csv", "--effects FILE.py")), ("backlash", ("LOG.csv", "--lead MM"))]
)
def test_help_names_files_as_the_other_verbs_do(verb, named):
    shown = " ".join(invoke(verb, "--help").stdout.split())
    assert all(name in shown for name in named)


def test_help_of_challenges_is_plain():
    shown = invoke("challenge", "--help").stdout
    assert "Commands:" in shown and "\u2500" not in shown and "--install-completion" not in shown


def test_dexterity_reads_both_families(tmp_path):
    bench = json.loads(invoke("dexterity", MACHINE, "--targets", DATA / "targets.csv", "--json").stdout)
    assert bench["home"]["condition"] == pytest.approx(4.0) and len(bench["targets"]) == 180
    assert bench["home"]["determinant"] == pytest.approx(1 / bench["home"]["manipulability"])
    arm = json.loads(invoke("dexterity", DATA / "machines" / "kuka_iiwa.toml", "--json").stdout)
    assert arm["kind"] == "serial" and arm["workspace"]["condition"]["least"] >= 1.0
    assert "inverse singularity" in invoke("dexterity", MACHINE).stdout


def test_a_library_that_counts_its_objects_has_nothing_to_say_at_the_end(tmp_path):
    """What is spared of the interpreter's end would be leaks to the store's library, which looks for them."""
    words = [sys.executable, "-m", "ptt", "fleet", "init", "store"]
    ended = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_limit_may_be_none() -> None:
    require_numbers({"limit_mm": math.inf, "size": 3.0}, {})
    with pytest.raises(InputError, match=r"--limit-mm: nan is not a finite number"):
        require_numbers({"limit_mm": math.nan}, {})
