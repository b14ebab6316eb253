"""Corrected programs, run by a controller and a virtual machine that share nothing with what wrote them."""

import json
import re
from dataclasses import replace
from pathlib import Path

import gcode
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from told_models import compensator

from ptt.commands.main import run
from ptt.correct.program.cut import distance_from_segment
from ptt.correct.program.program import correct_program
from ptt.correct.training.compensator import Compensator
from ptt.errors import InputError
from ptt.machine import load_machine, save_machine
from ptt.machine_schema import TargetsSpec
from ptt.rig import parse_rig, simulate
from ptt.rig.nominal import ideal_machine, nominal_sliders

DATA = Path(__file__).resolve().parents[1] / "data"
FILE = load_machine(DATA / "machine.toml")
PART = (DATA / "programs" / "bracket.ngc").read_text()


BARE = compensator(FILE)
GAPS, ZEROS, LINKS = (0.05, 0.03, 0.06), (0.31, -0.22, 0.15), (0.15, -0.1, 0.08)
WORN = compensator(
    FILE, homing_offset={"offset_mm": ZEROS}, link_length={"length_mm": LINKS}, backlash={"gap_mm": GAPS}
)


def corrected(text: str, model: Compensator = BARE, **options) -> str:
    return correct_program(model, text, "part.ngc", **options).text


def same_path(one: str, other: str, atol: float = 2e-5) -> None:
    left, right = (gcode.whole_path(gcode.execute(text)) for text in (one, other))
    np.testing.assert_allclose(left, right, rtol=0.0, atol=atol)


def test_a_machine_as_drawn_keeps_its_program() -> None:
    text = "%\nN1 G21 G90 G17 G54 G15 G40 G49 G50 G69 G80 (part)\nN2 T3 M6\nN3 S8000 M3\nG0 X10 Y-5\nZ2.5"
    text += " ; down\ng1 x 20.5 f 300\n"
    text += "\nM8\nX-.5 Y+3\nM30\n%\n"
    written = corrected(text)
    same_path(text, written)
    kept = [re.sub(r"\s", "", line).upper() for line in text.splitlines()]
    assert [re.sub(r"\s", "", line).upper() for line in written.splitlines()][:9] == kept[:9]
    assert "X-0.5Y3" in re.sub(r"\s", "", written) and written.endswith("M30\n%\n")


@settings(max_examples=10, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-50.0, 50.0).map(lambda x: round(x, 3))] * 3), min_size=2, max_size=12),
    st.booleans(),
)
def test_lines_of_a_machine_as_drawn_stay(points, inches: bool) -> None:
    unit = 25.4 if inches else 1.0
    lines = [f"G1 X{x:g} Y{y:g} Z{z:g} F200" for x, y, z in np.round(np.array(points) / unit, 4).tolist()]
    text = "\n".join(["G20" if inches else "G21", *lines])
    same_path(text, corrected(text))
    assert len(corrected(text).splitlines()) == len(text.splitlines())


ARCS = {
    "quarter": "G2 X40 Y-10 I0 J-20",
    "long way": "G3 X40 Y-10 I0 J-20",
    "radius": "G3 X40 Y30 R14.5",
    "negative radius": "G2 X35 Y25 R-25",
    "whole": "G2 I-15 J3",
    "turns": "G3 X20 Y10 Z-10 I12 J0 P3",
    "helix": "G2 X0 Y10 Z12 I-10 J0",
    "G18": "G18 G2 X0 Z0 I-10 K0",
    "G18 other way": "G18 G3 X0 Z0 I-10 K0 Y14",
    "G19": "G19 G3 Y30 Z0 J10 K0",
    "G19 radius": "G19 G2 Y30 Z5 R40",
    "centre stated": "G90.1 G3 X20 Y40 I20 J25",
    "G91": "G91 G2 X10 Y10 I10 J0",
}


@pytest.mark.parametrize("arc", ARCS.values(), ids=ARCS)
@pytest.mark.parametrize("chord", [5.0, 40.0])
def test_arcs_stay_within_the_chord(arc: str, chord: float) -> None:
    text = f"G21\nG0 X20 Y10 Z0\n{arc} F400\n"
    written = corrected(text, chord_um=chord)
    assert not re.search(r"G0?[23]\b|[IJKR]", written.replace("G21", "").replace("G20", ""))
    true = gcode.whole_path(gcode.execute(text))
    cut = gcode.whole_path(gcode.execute(written))
    assert gcode.beside(cut, true).max() < 4e-4  # corners lie on the arc, as far as the arc itself is drawn
    assert gcode.beside(true, cut).max() < 1e-3 * chord
    np.testing.assert_allclose(cut[-1], true[-1], atol=2e-5)
    ways = [np.linalg.norm(np.diff(each, axis=0), axis=1).sum() for each in (true, cut)]
    assert ways[1] == pytest.approx(ways[0], rel=2e-3)  # as many turns


def test_the_distance_from_a_stretch_is_that_from_its_end_for_what_lies_beyond() -> None:
    points = np.array([[5.0, 3.0, 0.0], [14.0, 3.0, 0.0], [-3.0, 0.0, 4.0]])
    begin, end = np.zeros(3), np.array([10.0, 0.0, 0.0])
    np.testing.assert_allclose(distance_from_segment(points, begin, end), [3.0, 5.0, 5.0])
    np.testing.assert_allclose(distance_from_segment(points[2:], begin, begin), [5.0])  # a stretch of no length


def test_arcs_are_cut_no_finer_than_needed() -> None:
    coarse, fine = (len(corrected("G0 X20 Y10 Z0\nG2 I-15 J3\n", chord_um=chord).splitlines()) for chord in (80.0, 5.0))
    assert 2.5 < fine / coarse < 6.0  # as the root of the tolerance: 4


def test_units_and_ways_of_counting_say_the_same() -> None:
    metric = "G21 G90\nG0 X25.4 Y12.7 Z0\nG1 X50.8 F508\nG3 X25.4 Y38.1 I-25.4 J0\nG1 Z-12.7\nX0\n"
    inch = "G20 G90\nG0 X1 Y.5 Z0\nG1 X2 F20\nG3 X1 Y1.5 I-1 J0\nG1 Z-.5\nX0\n"
    ways = "G21 G90\nG0 X25.4 Y12.7 Z0\nG91\nG1 X25.4 F508\nG3 X-25.4 Y25.4 I-25.4 J0\nG1 Z-12.7\nX-25.4\n"
    for model in (BARE, WORN):
        one = corrected(metric, model)
        same_path(one, corrected(inch, model), atol=4e-5)
        same_path(one, corrected(ways, model), atol=4e-5)
    feeds = {move["feed"] for text in (metric, inch) for move in gcode.execute(corrected(text, WORN)) if move["feed"]}
    assert feeds == {508.0}


def tool_path(rig, text: str) -> np.ndarray:
    """Where the virtual machine's tool goes when a controller with the drawing's kinematics runs a program."""
    path = gcode.dense(gcode.whole_path(gcode.execute(text)), 0.4)
    frame = pd.DataFrame(path, columns=["x_cmd", "y_cmd", "z_cmd"])
    heights = nominal_sliders(ideal_machine(rig.spec), path)
    return simulate(rig, frame, sliders=pd.DataFrame(heights, columns=["b1", "b2", "b3"]), noise=False).truth


def test_the_tool_of_the_virtual_machine_follows_the_program() -> None:
    machine = {key: value for key, value in FILE.machine.model_dump(mode="json").items() if value is not None}
    drive = {"homing_mm": ZEROS, "backlash_mm": GAPS}
    rig = parse_rig({"machine": machine, "drive": drive, "geometry": {"link_mm": LINKS}, "tracker": {}})
    wanted = gcode.whole_path(gcode.execute(PART))
    still = compensator(FILE, homing_offset={"offset_mm": ZEROS}, link_length={"length_mm": LINKS})

    def off(text: str) -> np.ndarray:
        # The first two moves come from a place that the program has not stated, and so could nobody correct.
        return 1e3 * gcode.beside(tool_path(rig, text)[200::4], wanted)

    before, without_play, after = (off(text) for text in (PART, corrected(PART, still), corrected(PART, WORN)))
    assert np.sqrt(np.mean(before**2)) > 200.0 and np.sqrt(np.mean(without_play**2)) > 15.0
    assert np.sqrt(np.mean(after**2)) < 3.0 and after.max() < 5.0  # um, the tolerance


def test_what_is_no_place_is_kept_in_its_place() -> None:
    text = "G0 X0 Y0 Z10\nN70 G1 X40 Y10 F300 M8 (cut) S900\nG4 P0.5\nN80 G2 I-9 M0\nG64 P0.01\nM48\n"
    lines = corrected(text, WORN).splitlines()
    first = next(line for line in lines if line.startswith("N70"))
    assert re.fullmatch(r"N70 G1( [XYZ]\S+){3} F300 M8 \(cut\) S900", first)
    block = lines[lines.index("G4 P0.5") + 1 : lines.index("G64 P0.01")]
    assert len(block) > 9 and block[0].startswith("N80 G1 X") and block[-1].endswith(" M0")
    assert sum("M0" in line for line in block) == 1
    assert sum("F300" in line for line in lines) == 1 and lines[-1] == "M48"


def test_settings_of_a_printer_are_no_moves() -> None:
    """Axis words of an M-code of its own are what it sets: as a move they would drive the tool."""
    lines = ["M205 X8 Y8 Z0.4 E5", "M203 X500 Z12", "M92 E93", "M117 Layer X5 of 60, 50 % {", "G11", "G10", "M84 X E"]
    text = "\n".join(["G21 G90", "G0 X0 Y0 Z10", "G1 X40 F300", *lines, "G1 Y10 M64 P1", "X20 M8", "M30", ""])
    written = corrected(text, WORN)
    assert [line for line in written.splitlines() if line in lines] == lines
    left = [line for line in written.splitlines() if line not in lines]
    assert left == corrected("\n".join(line for line in text.splitlines() if line not in lines), WORN).splitlines()


def test_further_axes_are_shared_out() -> None:
    text = "G21 M82\nG92 E0\nG0 X-40 Y0 Z0\nG3 I20 E8 F600\nG1 E6\nG91 M83\nG1 X80 E8\nG1 E-1\n"
    written = corrected(text, WORN)
    lines = written.splitlines()
    at = lines.index("G91 M83")
    absolute = [float(value) for value in re.findall(r" E(\S+)", "\n".join(lines[2:at]))]
    assert absolute[-2:] == [8.0, 6.0] and absolute[:-1] == sorted(absolute[:-1]) and len(absolute) > 4
    relative = [float(value) for value in re.findall(r" E(\S+)", "\n".join(lines[at:]))]
    assert sum(relative[:-1]) == pytest.approx(8.0, abs=1e-4) and relative[-1] == -1.0


def test_where_the_tool_is_that_nobody_says_is_said():
    def notes(text: str, model: Compensator, **options) -> str:
        return " ".join(correct_program(model, text, "part.ngc", **options).notes)

    part, zero = "G21\nG0 X10 Y5 Z40\nG1 X20 F900\n", np.zeros(3)
    assert "--start" in notes(part, WORN) and "--start" not in notes(part, WORN, start=zero)
    assert "--start" not in notes(part, BARE)  # nothing of it turns over
    assert "G28" in notes(f"{part}G28\nG0 X10 Y5 Z40\n", WORN) and "G28" not in notes(part, WORN)


def test_only_axes_that_were_stated_are_written() -> None:
    lines = corrected("G0 Z40\nG0 X10\nY5\nG28\nG0 Z40\n", WORN).splitlines()
    letters = ["".join(re.findall(r"([XYZ])[-\d]", line)) for line in lines]
    assert letters == ["Z", "XZ", "XYZ", "", "Z"]


@pytest.mark.parametrize("home", ["G30", "G29", "G32"])
def test_a_move_by_so_much_begins_where_every_code_that_goes_home_ends(home: str) -> None:
    """What a printer's probing leaves is as little told as where it homes: both are the program's start."""
    text = "G0 X0 Y0 Z40\nG0 X30\n{}\nG91\nG0 X5\n"
    assert corrected(text.format(home), WORN).replace(home, "G28") == corrected(text.format("G28"), WORN)


@pytest.mark.parametrize("start", [None, np.array([0.0, 0.0, 40.0])])
def test_a_lift_from_a_place_that_nobody_knows_makes_no_place_of_it(start: np.ndarray | None) -> None:
    """Behind G28 only the controller knows Z: 'Z5' by increments is no position 5 that later lines may be sent to."""
    found = correct_program(WORN, "G90\nG28\nG91\nG1 Z5 F300\nG90\nG1 X40 Y10\nX-40\nZ20\n", start=start)
    lines = found.text.splitlines()
    assert re.fullmatch(r"G1 Z[45]\.\d+ F300", lines[3])  # the lift itself stays
    assert all("Z" not in line for line in lines[4:-1]) and "Z" in lines[-1]
    assert sum("by increments (G91)" in note and note.startswith("line 4 ") for note in found.notes) == 1
    assert not any("increments" in note for note in correct_program(WORN, "G0 X0 Y0 Z40\nG91\nG0 X5\n").notes)


@pytest.mark.parametrize("turn", ["G17 G3 X-10 Y0 I-10 J0", "G18 G2 X-10 Z0 I-10 K0", "G19 G3 Y10 Z10 J0 K10"])
def test_a_place_that_is_said_is_stated(turn: str) -> None:
    """A lathe's program never states Y: its arcs are cut once somebody says where the tool is."""
    text = f"S2000 M3 $1\n{turn} F200\n"
    with pytest.raises(InputError, match=r"line 2: an arc from a place .* --start X Y Z"):
        corrected(text)
    start = np.array([10.0, 0.0, 0.0])
    written = corrected(text, start=start)
    assert written.startswith("S2000 M3 $1\n")
    one, two = (gcode.whole_path(gcode.execute(f"G0 X10 Y0 Z0\n{each}")) for each in (text, written))
    assert max(gcode.beside(one, two).max(), gcode.beside(two, one).max()) < 5e-3
    assert len(two) > 20


def test_offsets_are_where_the_program_lies() -> None:
    text = "G0 X10 Y5 Z0\nG1 X40 Y-20 F100\nG53 G0 Z30\nG0 X0\n"
    shift = np.array([-7.0, 3.0, 11.0])
    by_hand = gcode.execute("G0 X3 Y8 Z11\nG1 X33 Y-17 F100\nG0 Z30\nG0 X-7\n")
    moved = gcode.whole_path(gcode.execute(corrected(text, WORN, offset=shift), offset=shift))
    other = gcode.whole_path(gcode.execute(corrected("G0 X3 Y8 Z11\nG1 X33 Y-17 F100\nG0 Z30\nG0 X-7\n", WORN)))
    np.testing.assert_allclose(moved, other, atol=3e-5)
    assert len(by_hand) == 4
    frame = TargetsSpec(origin_mm=tuple(shift.tolist()), turn_deg=(0.0, 0.0, 90.0))
    turned = replace(WORN, model=replace(WORN.model, file=replace(WORN.model.file, targets=frame)))
    there = gcode.whole_path(gcode.execute(corrected("G0 X5 Y-10 Z0\nG1 X-20 Y-40\n", turned)))
    there = np.column_stack([-there[:, 1], there[:, 0], there[:, 2]]) + shift
    here = gcode.whole_path(gcode.execute(corrected("G0 X3 Y8 Z11\nG1 X33 Y-17\n", WORN)))
    np.testing.assert_allclose(there, here, atol=3e-5)


def test_a_program_keeps_its_letters_and_line_ends(tmp_path: Path) -> None:
    model, part, out = tmp_path / "m.toml", tmp_path / "p.ngc", tmp_path / "o.ngc"
    save_machine(FILE, model)
    part.write_bytes("(Tr\u00e4ger, 45\u00b0)\r\nG0 X1 Y2 Z3\r\nM2\r\n".encode("latin-1"))
    assert run(["program", str(part), "--model", str(model), "--out", str(out)]) == 0
    assert out.read_bytes() == part.read_bytes()


def test_the_command_tells_a_program(tmp_path: Path, capsys) -> None:
    model, out = tmp_path / "m.toml", tmp_path / "o.ngc"
    save_machine(replace(WORN.model.file, text=""), model)
    part = DATA / "programs" / "bracket.ngc"
    assert run(["program", str(part), "--model", str(model), "--out", str(out), "--chord-um", "10", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["moves"] < told["pieces"] and 0.0 < told["deviation_um"] <= 10.0 and told["largest_shift_um"] > 100.0
    assert out.read_text() == corrected(part.read_text(), WORN, chord_um=10.0)
    assert run(["program", str(out), "--model", str(model), "--out", str(out)]) == 2
    for setting in ("payload_kg=1e308", "temp_c=nan", "time_s=inf", "feed_mm_s=3"):
        words = ["program", str(part), "--model", str(model), "--out", str(tmp_path / "no.ngc"), "--set", setting]
        assert run(words) == 2 and "--set: " in capsys.readouterr().err
