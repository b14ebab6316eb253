"""What is refused before anything is computed, and what is kept when something goes wrong on the way."""

import importlib
import json
import sys
import time
import tomllib
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from small_files import BARE, HEAD, QUICK, RUN, put
from small_files import place as place

from ptt.commands.main import run
from ptt.effects.registry import library
from ptt.errors import InputError, TableError
from ptt.judge.iso.figures import read_axis_figures
from ptt.machine import parse_machine
from ptt.model.entries import read_model
from ptt.run.backlash.scale import read_scale_log
from ptt.run.readers.columns import GREATEST
from ptt.run.reading import read_table

ROOT = Path(__file__).resolve().parents[1]
MACHINE = ROOT / "data" / "machine.toml"

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


def spent(path: Path) -> float:
    """Processor time of reading a file or refusing it, s: the least of three, for others work on the machine too."""
    took = []
    for _ in range(3):
        started = time.process_time()
        try:
            read_table(path)
        except TableError as error:
            assert len(str(error)) < 500
        took.append(time.process_time() - started)
    return min(took)


@pytest.mark.parametrize("text", ["x " * 15_000, "x" * 30_000, "[" * 30_000, "a/" * 15_000])
@pytest.mark.parametrize("where", ["title", "cell", "comment"])
def test_the_time_for_a_title_or_cell_grows_no_faster_than_its_length(text, where, tmp_path):
    """What is eight times as long takes eight times as long at most; a pattern that goes back and forth, 64 times."""
    own, share = {}, len(text) // 8
    for name, part in (("whole", text), ("eighth", text[:share])):
        body = {
            "title": RUN.replace("payload_kg", part),
            "cell": RUN + f"3,2,3,{part},1,2,3\n",
            "comment": f"# {part}\n{RUN}",
        }
        own[name] = spent(put(tmp_path, body[where], f"{name}.csv"))
    assert own["whole"] < 20.0 * own["eighth"]


OWN = (ROOT / "benchmarks" / "fuzz_inputs.py").read_text().split("OWN = '''")[1].split("'''")[0]
EYE = "torch.eye(3, 2, dtype=torch.float64)"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"pull"', "3", "name 3 is not a name"),
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
