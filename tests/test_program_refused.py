"""Lines of a program that nobody can correct or no machine can run are refused by number."""

import re
from pathlib import Path

import pytest
from test_program import DATA, FILE, WORN, corrected

from ptt.commands.main import run
from ptt.errors import InputError, PosesError
from ptt.machine import save_machine

REFUSED = {
    "#1=5": "a parameter",
    "G1 X[1+2]": "an expression",
    "G1 X-#5": "a parameter",
    "G1 @10 ^45": "a polar coordinate",
    "G1 X--5": "not G-code",
    "o100 sub": "subprogram",
    "M98 P12": "subprogram",
    "G41 D1": "cutter compensation",
    "G81 X1 Y1 Z-2 R1": "canned cycle",
    "G92 X0": "moves the origin",
    "G10 L2 P1 X3": "change of offsets",
    "G93": "inverse time",
    "/G1 X5": "may skip",
    "G80\nX5": "before any of",
    "G1 X5 X6": "X appears twice",
    "G1 X" + "9" * 300: "beyond any machine",
    "G1 X-1000000000.5": "beyond any machine",
    "G1 X": "no number",
    "G1 G0 X5": "two kinds",
    "G2 X10 Y10": "gives its centre",
    "G2 X10 Y10 I3 J1": "not an arc",
    "G2 X90 Y0 R4": "not an arc",
    "G2 X10 Y10 I5 J5 P0.5": "number of turns",
    "G1 X5 (open": "is not closed",
    "G1 X5 ?": "not G-code",
    "G55 G1 X5": "second work coordinate",
    "G91 G53 G0 X1": "G53 needs",
    "G123 X5": "is not known",
    "G50 X5": "axis words beside G50",
    "G154 P3": "is not known",
    "G54.1 P1": "is not known",
    "G66 P9010": "is not known",
    "G12 I4": "is not known",
    "G234 I0": "is not known",
    "G92.3": "is not known",
    "M92 X80 Y80": "how the controller takes positions",
    "M206 Z-0.2": "how the controller takes positions",
    "M665 L250": "how the controller takes positions",
    "M777 X5": "what M777 does with X is not known",
    "G1 X5 M205 Y3": "M205 and a move",
}


@pytest.mark.parametrize("line", REFUSED, ids=str)
def test_lines_that_nobody_can_correct_are_refused_by_number(line: str) -> None:
    with pytest.raises(InputError, match=rf"^part\.ngc line [34]\b.*{re.escape(REFUSED[line])}"):
        corrected(f"G0 X0 Y0 Z0\n\n{line}\n")


def test_lines_that_the_machine_cannot_run_are_refused_by_number(tmp_path: Path, capsys) -> None:
    text = "G0 X0 Y0 Z0\nG1 X50 F100\nG1 X250\nG1 X0\nG3 X0 Y0 I70 J90\nG1 Z-400\n"
    with pytest.raises(PosesError, match=r"part.ngc line 3: out of .*line 4: .*line 5: .*line 6: "):
        corrected(text)
    with pytest.raises(PosesError, match=r"part.ngc line 1: too large"):
        corrected("G0 X1 Y1 Z1\n", WORN, limit=1e-3)
    model, part, out = tmp_path / "m.toml", tmp_path / "p.ngc", tmp_path / "o.ngc"
    save_machine(FILE, model)
    part.write_text(text)
    assert run(["program", str(part), "--model", str(model), "--out", str(out)]) == 3
    assert "line 3" in capsys.readouterr().err and not out.exists()
    part.write_text("G1 X#1\n")
    assert run(["program", str(part), "--model", str(model), "--out", str(out)]) == 2
    assert "p.ngc line 1, column 5" in capsys.readouterr().err and not out.exists()
    assert run(["program", str(part), "--model", str(DATA / "machines" / "ur10.toml"), "--out", str(out)]) == 2
