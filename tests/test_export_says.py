"""What a file for a controller says: what it holds, what it cannot, what to do with it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from test_export_c import network_over
from test_export_firmware import ALL, FILE, GAPS, export, missed, sliders, targets
from told_models import compensator

import ptt
from ptt.correct.exports.firmware import what_to_do
from ptt.correct.exports.format import NOTHING_TO_GAIN, USELESS, ErrorLeft, Options, said_held
from ptt.correct.exports.held import said_left, untold_note
from ptt.correct.exports.registry import find_format, writer
from ptt.correct.training.compensator import Compensator
from ptt.machine import save_machine
from ptt.model.entries import write_model
from ptt.model.model import Model
from ptt.rig.nominal import ideal_machine, nominal_sliders
from ptt.run.table import make_table
from ptt.run.written import write_table

DELTAS = ("klipper", "reprapfirmware", "marlin")


@pytest.mark.parametrize("name", [*DELTAS, "linuxcnc", "siemens"])
def test_what_a_format_cannot_hold_is_counted(name: str, tmp_path: Path) -> None:
    """The error that is stated is the one that the machine has, and what is said to be held is not in it."""
    out = tmp_path / ("out.ini" if name == "linuxcnc" else "out")
    result = export(name, compensator(FILE, **ALL), out)
    left = missed(FILE, sliders(name, FILE, out), everything=True)
    # Stated for sliders that arrive from either side by lot; from one place to another they more often go together,
    # and then play moves the tool less.
    assert 0.6 * result.error_um.format < left < 1.15 * result.error_um.format
    assert result.error_um.model < 3.0 < left < 0.5 * result.error_um.drawing
    cannot = {item.effect for item in result.cannot_hold}
    assert cannot | set(result.holds) == {key.replace("_", "-") for key in ALL} and not cannot & set(result.holds)
    assert ("backlash" in result.holds) == (name == "linuxcnc")
    assert ("lead-scale" in result.holds) == (name in ("linuxcnc", "siemens"))
    assert "homing-offset" in result.holds


@pytest.mark.parametrize(("name", "word"), [*zip(DELTAS, ("rotation_distance", "M92", "M92"), strict=True)])
def test_a_file_says_what_it_holds_and_what_to_do_with_it(name: str, word: str, tmp_path: Path) -> None:
    """Figures of the file that are no drawing's are not called so, and the setting that sets scales right is named."""
    result = export(name, compensator(FILE, **ALL), tmp_path / "out")
    head = (tmp_path / "out").read_text()
    assert all(note in head for note in result.notes) and "no effect" not in head
    (scale,) = (item.why for item in result.cannot_hold if item.effect == "lead-scale")
    assert word in scale and scale.index("1.000100, 0.999940, 1.000030") < scale.index("measure again")
    assert scale.endswith("instead of loading this file")
    assert any(word in note and "everything else" in note for note in result.notes)
    assert any(note.startswith("or, instead of this file, ") and "ptt program" in note for note in result.notes)


def test_a_table_of_play_alone_is_not_to_be_used_and_c_that_holds_it_is(tmp_path: Path) -> None:
    model = compensator(FILE, backlash={"gap_mm": GAPS})
    assert any(note.startswith(USELESS) for note in export("table", model, tmp_path / "out").notes)
    assert not any(USELESS in note or NOTHING_TO_GAIN in note for note in export("c", model, tmp_path / "c").notes)
    warm = compensator(
        FILE, frame_growth={"radius_per_k": 2e-5, "link_per_k": 0.0}
    )  # held, but judged where it is zero
    assert NOTHING_TO_GAIN not in export("c", warm, tmp_path / "warm").notes


def test_effects_that_are_judged_without_what_they_depend_on_are_named(tmp_path: Path) -> None:
    model = compensator(FILE, frame_growth={"radius_per_k": 2e-5, "link_per_k": 0.0}, backlash={"gap_mm": GAPS}).model
    (note,) = untold_note(model, None)
    assert note.startswith("frame-growth depends on temperature") and "at the reference temperature" in note
    assert "--run RUN.csv" in note and "backlash" not in note
    assert untold_note(model, make_table(np.zeros((1, 3)), temp_c=np.array([25.0]))) == ()


@pytest.mark.parametrize("name", [*DELTAS, "siemens"])
def test_a_file_that_corrects_nothing_says_so(name: str, tmp_path: Path) -> None:
    """It does not say how to load it then; play is taken up by the controller or by programs, never by both."""
    result = export(name, compensator(FILE, backlash={"gap_mm": GAPS}), tmp_path / "out")
    words = said_held(result.holds, [item.effect for item in result.cannot_hold], result.error_um)
    assert words == "no effect completely; it is hardly better than the drawing"
    *asked, note = result.notes
    assert len(asked) == (name == "siemens") and not any("load" in line for line in result.notes)
    (play,) = (item.why for item in result.cannot_hold)
    gaps = ", ".join(f"{gap:.6f}" for gap in GAPS)
    assert (f"MD32450 $MA_BACKLASH of the axes takes {gaps} mm" in play) == (name == "siemens")
    assert ("instead of what `ptt program`" in play) == (name == "siemens")
    assert note.startswith("this file corrects almost nothing") and "ptt program" in note
    assert note in (tmp_path / "out").read_text()


@pytest.mark.parametrize("name", [*DELTAS, "linuxcnc", "siemens"])
def test_a_file_with_nothing_to_gain_says_so(name: str, tmp_path: Path) -> None:
    out = tmp_path / ("out.ini" if name == "linuxcnc" else "out")
    result = export(name, compensator(FILE), out)
    assert NOTHING_TO_GAIN in result.notes and NOTHING_TO_GAIN in out.read_text()
    assert not any("measure again" in note for note in result.notes)


def test_each_file_is_told_one_thing_or_two_that_exclude_each_other() -> None:
    assert what_to_do("load it", ErrorLeft(90.0, 1.5, 1.0)) == ("load it",)
    load, instead = what_to_do("load it", ErrorLeft(90.0, 9.0, 1.0))
    assert load == "load it" and instead.startswith("or, instead of this file, keep the drawing's figures")
    (leave,) = what_to_do("load it", ErrorLeft(90.0, 89.0, 1.0))
    assert leave.startswith("this file corrects almost nothing, so do not use it; keep") and "or, instead" not in leave
    assert (
        "ptt program" in instead and "ptt program" not in what_to_do("load it", ErrorLeft(90.0, 9.0, 1.0), arm=True)[1]
    )


def test_what_a_drawing_itself_leaves_is_said_and_its_programs_are_not_corrected(tmp_path: Path) -> None:
    """A controller that computes upright towers errs by the lean of these, whatever is in its programs."""
    machine = FILE.machine.model_copy(update={"slider_lean_deg": (0.3, 0.0, -0.2)})
    leaning = replace(FILE, machine=machine)
    moved = {"homing-offset": {"offset_mm": (0.5, -0.3, -0.4)}}
    for file, said in ((leaning, True), (FILE, False)):
        result = export("klipper", compensator(file, **moved, backlash={"gap_mm": GAPS}), tmp_path / f"{said}")
        text = " ".join(result.notes)
        assert ("for a machine exactly as drawn it would leave" in text) == said
        assert ("correct each program with `ptt program`" in text) != said
        assert not said or result.error_um.format > 100.0


@pytest.mark.parametrize("name", ["c", "table"])
def test_a_network_without_effects_is_named_where_the_file_holds_it(name: str, tmp_path: Path) -> None:
    places = targets(FILE)
    found = writer(find_format(name), "three-ptt")(
        Compensator(Model(FILE), network_over(places, 3), {}), tmp_path / "out", Options(step=60.0)
    )
    assert found.network and not found.holds
    assert said_held(found.holds, (), found.error_um, network=found.network) == "the network"
    assert name != "c" or "holds the network" in (tmp_path / "out" / "ptt_selftest.c").read_text()
    taken = said_held((), (), ErrorLeft(90.0, 9.0, 1.0))
    assert taken == "no effect completely; its figures include what they can of the network"
    assert what_to_do("load it", ErrorLeft(5.0, 4.9, 4.8)) == (NOTHING_TO_GAIN,)


def test_an_error_too_small_to_show_is_explained_by_what_no_run_told(tmp_path: Path) -> None:
    """Rest and reference temperature are the reason only where nobody told otherwise."""
    effects = {"lead_scale": {"scale": (1e-9, 0.0, 0.0)}, "frame_growth": {"radius_per_k": 1e-5, "link_per_k": 0.0}}
    place = targets(FILE)
    told = make_table(place, temp_c=np.full(len(place), FILE.machine.reference_temp_c))
    for table in (None, told):
        result = export("klipper", compensator(FILE, **effects), tmp_path / "out", table=table)
        why = {item.effect: item.why for item in result.cannot_hold}
        assert why["lead-scale"].split("; first")[0].endswith("(its whole error is less than 0.05 um)")
        assert ("unless --run names a run" in why["frame-growth"]) == (table is None)
    assert said_left(9.0, 9.0, untold=True) == "all of its 9.0 um remain"


def test_a_bare_drawing_is_said_exactly(tmp_path: Path) -> None:
    for name in (*DELTAS, "siemens"):
        export(name, compensator(FILE), tmp_path / name)
        wanted = nominal_sliders(ideal_machine(FILE.machine), targets(FILE))
        np.testing.assert_allclose(sliders(name, FILE, tmp_path / name), wanted, atol=5e-5)
    export("linuxcnc", compensator(FILE), tmp_path / "delta.ini")
    np.testing.assert_allclose(sliders("linuxcnc", FILE, tmp_path / "delta.ini"), wanted, atol=5e-5)


def test_a_run_with_empty_cells_is_judged_alike_by_library_and_command(tmp_path: Path) -> None:
    """Empty temperatures are filled as in every run; poses of a run that has none at all are not judged at."""
    warm = compensator(FILE, homing_offset={"offset_mm": [0.3, -0.2, 0.1]}, screw_growth={"growth_per_k": [2e-5] * 3})
    save_machine(write_model(warm.model), tmp_path / "m.toml")
    place = np.random.default_rng(1).uniform([-50, -50, 0], [50, 50, 40], (40, 3)).round(3)
    temp = np.linspace(22.0, 34.0, 40).round(2)

    def judged(values: np.ndarray, **columns: np.ndarray) -> list[dict[str, float]]:
        write_table(make_table(place[np.arange(len(values)) % 40], measured=place[np.arange(len(values)) % 40],
                               temp_c=values, **columns), tmp_path / "r.csv")  # fmt: skip
        words = ("--model", tmp_path / "m.toml", "--to", "marlin", "--out", tmp_path / "a", "--run", tmp_path / "r.csv")
        told = json.loads(invoke("export", *words, "--json").stdout)["error_um"]
        library = ptt.export(ptt.load(tmp_path / "m.toml"), "marlin", tmp_path / "b", run=tmp_path / "r.csv")
        return [told, library.to_dict()["error_um"]]

    (whole, same), gap = judged(temp), judged(np.where(np.arange(40) % 9 == 4, np.nan, temp))
    none = judged(np.append(temp, np.full(40, np.nan)), run=np.repeat([0, 1], 40))
    assert whole == same and gap[0] == gap[1] and none[0] == none[1]
    for figures in (gap[0], none[0]):
        assert figures == pytest.approx(whole, rel=1e-3)
