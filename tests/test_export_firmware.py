"""Formats of controllers: a machine driven through each one's own arithmetic misses by what the export says."""

import json
import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import controllers
import numpy as np
import pandas as pd
import pytest

from ptt.commands.main import run
from ptt.correct.exports.firmware import NOTHING_TO_GAIN, what_to_do
from ptt.correct.exports.format import ErrorLeft, Options, said_held
from ptt.correct.exports.held import said_left
from ptt.correct.exports.registry import find_format, writer
from ptt.correct.training.compensator import Compensator
from ptt.errors import InputError
from ptt.files import sha256
from ptt.machine import MachineFile, load_machine, parse_machine, save_machine
from ptt.machine_schema import ControllerSpec, EffectEntry, ParameterEntry
from ptt.mechanisms import build_mechanism
from ptt.model.entries import read_model
from ptt.plan.space import build_space, draw_poses
from ptt.rig import parse_rig, simulate
from ptt.rig.nominal import can_reach, ideal_machine, nominal_sliders
from ptt.run.table import make_table

DATA = Path(__file__).resolve().parents[1] / "data"
DELTAS = ("klipper", "reprapfirmware", "marlin")
ZEROS, LINKS = (0.21, -0.12, 0.05), (0.11, -0.08, 0.15)
ALONG, OUT, GAPS = (0.1, -0.12, 0.05), (0.21, -0.12, 0.05), (0.041, 0.052, 0.037)
MACHINE = {
    "kind": "three-ptt",
    "base_radius_mm": 210.0,
    "platform_radius_mm": 80.0,
    "link_length_mm": 330.0,
    "slider_azimuth_deg": [17.0, 137.0, 257.0],
    "slider_travel_mm": [140.0, 430.0],
    "screw_lead_mm": 5.0,
    "joint_height_mm": 25.0,
}


def drawn(**changes) -> MachineFile:
    values = MACHINE | changes
    return parse_machine(
        "[machine]\n" + "\n".join(f"{key} = {value!r}" for key, value in values.items()).replace("'", '"')
    )


def compensator(file: MachineFile, **effects) -> Compensator:
    entries = tuple(
        EffectEntry(
            name=name.replace("_", "-"), parameters={key: ParameterEntry(value=value) for key, value in own.items()}
        )
        for name, own in effects.items()
    )
    return Compensator(read_model(replace(file, effect=entries)), None, {})


HELD = {
    "homing_offset": {"offset_mm": ZEROS},
    "link_length": {"length_mm": LINKS},
    "tower_position": {"tangential_mm": ALONG},
}
ALL = HELD | {
    "tower_position": {"radial_mm": OUT, "tangential_mm": ALONG},
    "lead_scale": {"scale": (1e-4, -6e-5, 3e-5)},
    "backlash": {"gap_mm": GAPS},
}


def rig_of(file: MachineFile, *, everything: bool):
    spec = file.machine
    geometry = {"link_mm": LINKS, "tower_tangential_mm": ALONG}
    drive = {"homing_mm": ZEROS}
    if everything:
        geometry["tower_radial_mm"] = OUT
        drive |= {"backlash_mm": GAPS, "scale_um_per_m": (100.0, -60.0, 30.0)}
    machine = {key: value for key, value in spec.model_dump(mode="json").items() if value is not None}
    return parse_rig({"machine": machine, "geometry": geometry, "drive": drive, "tracker": {"measure_base": False}})


@lru_cache
def targets(file: MachineFile, count: int = 160) -> np.ndarray:
    """Places all over the workspace, in no order."""
    heights = draw_poses(build_space(file), count, np.random.default_rng(5))
    place = build_mechanism(file.machine).forward(heights).numpy()
    return place[can_reach(ideal_machine(file.machine), place)]


def missed(file: MachineFile, sliders: np.ndarray, *, everything: bool) -> float:
    """What the virtual machine's tool misses by, um."""
    place = targets(file)
    frame = pd.DataFrame(place, columns=["x_cmd", "y_cmd", "z_cmd"])
    sent = pd.DataFrame(sliders, columns=["b1", "b2", "b3"])
    result = simulate(rig_of(file, everything=everything), frame, sliders=sent, noise=False)
    return 1e3 * float(np.sqrt(((result.truth - place) ** 2).sum(axis=1).mean()))


def export(name: str, comp: Compensator, out: Path, **options):
    return writer(find_format(name), comp.model.file.machine.kind)(comp, out, Options(**options))


def sliders(name: str, file: MachineFile, path: Path) -> np.ndarray:
    ends = [high for _, high in file.machine.travel_ends]
    if name == "linuxcnc":
        return controllers.linuxcnc(path, file.machine.joint_height_mm, targets(file))
    if name == "siemens":
        return controllers.siemens(path, file.machine, targets(file))
    return getattr(controllers, name)(path, ends, targets(file))


FILE = drawn()


@pytest.mark.parametrize("name", DELTAS)
def test_what_a_delta_holds_is_gone_on_the_machine(name: str, tmp_path: Path) -> None:
    result = export(name, compensator(FILE, **HELD), tmp_path / "out")
    assert set(result.holds) == {"homing-offset", "link-length", "tower-position"} and not result.cannot_hold
    left = missed(FILE, sliders(name, FILE, tmp_path / "out"), everything=False)
    assert left < 0.1 and result.error_um.format < 0.1
    plain = missed(FILE, nominal_sliders(ideal_machine(FILE.machine), targets(FILE)), everything=False)
    assert plain > 200.0 and result.error_um.drawing > 200.0


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
    assert any(word in note and "stays" in note for note in result.notes)
    assert any(note.startswith("or, instead of this file, ") and "ptt program" in note for note in result.notes)


@pytest.mark.parametrize("name", [*DELTAS, "siemens"])
def test_a_file_that_corrects_nothing_says_so(name: str, tmp_path: Path) -> None:
    """It does not say how to load it then; play is taken up by the controller or by programs, never by both."""
    result = export(name, compensator(FILE, backlash={"gap_mm": GAPS}), tmp_path / "out")
    words = said_held(result.holds, [item.effect for item in result.cannot_hold], result.error_um)
    assert words == "no effect whole; it moves the machine hardly better than the drawing does"
    *asked, note = result.notes
    assert len(asked) == (name == "siemens") and not any("load" in line for line in result.notes)
    (play,) = (item.why for item in result.cannot_hold)
    assert ("MD32450" in play) == ("instead of what `ptt program`" in play) == (name == "siemens")
    assert note.startswith("this file puts next to nothing right") and "ptt program" in note
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
    assert leave.startswith("this file puts next to nothing right, so leave it; keep") and "or, instead" not in leave
    assert what_to_do("load it", ErrorLeft(5.0, 4.9, 4.8)) == (NOTHING_TO_GAIN,)


def test_an_error_too_small_to_show_is_explained_by_what_no_run_told(tmp_path: Path) -> None:
    """Rest and reference temperature are the reason only where nobody told otherwise."""
    effects = {"lead_scale": {"scale": (1e-9, 0.0, 0.0)}, "frame_growth": {"radius_per_k": 1e-5, "link_per_k": 0.0}}
    place = targets(FILE)
    told = make_table(place, temp_c=np.full(len(place), FILE.machine.reference_temp_c))
    for table in (None, told):
        result = export("klipper", compensator(FILE, **effects), tmp_path / "out", table=table)
        why = {item.effect: item.why for item in result.cannot_hold}
        assert why["lead-scale"].split("; first")[0].endswith("(all that it makes is less than 0.05 um)")
        assert ("unless --run names a run" in why["frame-growth"]) == (table is None)
    assert said_left(9.0, 9.0, untold=True) == "all of its 9.0 um are left"


def test_figures_that_take_a_part_are_no_drawing() -> None:
    unknown = ErrorLeft.told({"drawing": 5.0, "format": None, "model": 1.0})
    assert said_held((), ("lead-scale",), unknown) == "no effect whole"
    assert said_held((), (), ErrorLeft(5.0, 5.0, 5.0)) == "the drawing, for the model has no effects"
    assert said_held((), ("lead-scale",), ErrorLeft(90.0, 9.0, 1.0)).startswith("no effect whole")
    assert said_held(("backlash",), ("lead-scale",), ErrorLeft(90.0, 9.0, 1.0)) == "backlash"


def test_no_other_figures_of_klipper_miss_less(tmp_path: Path) -> None:
    """Refitted, not copied: each printed figure moved either way, the machine misses more."""
    out = tmp_path / "printer.cfg"
    effects = {key: value for key, value in ALL.items() if key != "backlash"}
    export("klipper", compensator(FILE, **effects), out)
    ends = [high for _, high in FILE.machine.travel_ends]
    rig = rig_of(FILE, everything=True)
    rig = replace(rig, drive=rig.drive.model_copy(update={"backlash_mm": (0.0, 0.0, 0.0)}))
    frame = pd.DataFrame(targets(FILE), columns=["x_cmd", "y_cmd", "z_cmd"])

    def left(text: str) -> float:
        (tmp_path / "moved.cfg").write_text(text)
        heights = controllers.klipper(tmp_path / "moved.cfg", ends, targets(FILE))
        sent = pd.DataFrame(heights, columns=["b1", "b2", "b3"])
        truth = simulate(rig, frame, sliders=sent, noise=False).truth
        return 1e3 * float(np.sqrt(((truth - targets(FILE)) ** 2).sum(axis=1).mean()))

    text = out.read_text()
    best = left(text)
    figures = list(re.finditer(r"(delta_radius|arm_length|angle|position_endstop): (\S+)", text))
    assert len(figures) == 10
    for figure in figures:
        for move in (-0.1, 0.1):
            value = float(figure[2]) + move
            assert left(text[: figure.start(2)] + f"{value:.6f}" + text[figure.end(2) :]) > best


def test_lineardeltakins_is_what_linuxcnc_has() -> None:
    """Debian's linuxcnc-uspace brings LinuxCNC's own kinematics as a Python module."""
    theirs = pytest.importorskip("lineardeltakins", reason="LinuxCNC's Python module lineardeltakins is not installed")
    theirs.set_geometry(100.25, 301.5)
    place = np.random.default_rng(4).uniform(-90.0, 90.0, (50, 3))
    wanted = [theirs.inverse(*row) for row in place.tolist()]
    np.testing.assert_allclose(controllers.lineardelta(100.25, 301.5, place), wanted, atol=1e-10)


def test_a_bare_drawing_is_said_exactly(tmp_path: Path) -> None:
    for name in (*DELTAS, "siemens"):
        export(name, compensator(FILE), tmp_path / name)
        wanted = nominal_sliders(ideal_machine(FILE.machine), targets(FILE))
        np.testing.assert_allclose(sliders(name, FILE, tmp_path / name), wanted, atol=5e-5)
    export("linuxcnc", compensator(FILE), tmp_path / "delta.ini")
    np.testing.assert_allclose(sliders("linuxcnc", FILE, tmp_path / "delta.ini"), wanted, atol=5e-5)


def test_wider_platforms_and_clockwise_sliders(tmp_path: Path) -> None:
    wide = drawn(base_radius_mm=80.0, platform_radius_mm=210.0)
    export("klipper", compensator(wide), tmp_path / "k")
    wanted = nominal_sliders(ideal_machine(wide.machine), targets(wide))
    np.testing.assert_allclose(sliders("klipper", wide, tmp_path / "k"), wanted, atol=1e-5)
    round_ = drawn(slider_azimuth_deg=[0.0, 240.0, 120.0])
    for name in ("klipper", "marlin", "linuxcnc"):
        with pytest.raises(InputError, match="clockwise"):
            export(name, compensator(round_), tmp_path / "no")
    export("reprapfirmware", compensator(round_), tmp_path / "r")
    wanted = nominal_sliders(ideal_machine(round_.machine), targets(round_))
    np.testing.assert_allclose(sliders("reprapfirmware", round_, tmp_path / "r"), wanted, atol=5e-5)


@pytest.mark.parametrize("name", [*DELTAS, "linuxcnc"])
def test_machines_that_are_no_such_delta_are_refused(name: str, tmp_path: Path) -> None:
    out = tmp_path / "no"
    with pytest.raises(InputError, match="below the platform"):
        export(name, compensator(drawn(sliders="below")), out)
    with pytest.raises(InputError, match="cannot say this drawing"):
        export(name, compensator(drawn(slider_lean_deg=[6.0, 6.0, 6.0])), out)
    assert not list(tmp_path.iterdir())


def test_linuxcnc_says_uneven_azimuths_only_by_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="uneven"):
        export("linuxcnc", compensator(drawn(slider_azimuth_deg=[10.0, 135.0, 250.0])), tmp_path)


def test_play_that_the_controller_takes_up_is_in_no_table(tmp_path: Path) -> None:
    done = replace(FILE, controller=ControllerSpec(compensates=("backlash",)))
    result = export("linuxcnc", compensator(done, **ALL), tmp_path / "delta.ini")
    assert "backlash" in {item.effect for item in result.cannot_hold}
    assert any("BACKLASH" in note for note in result.notes)
    rows = controllers.triplets(tmp_path / "delta_joint_0.comp")
    np.testing.assert_array_equal(rows[:, 1], rows[:, 2])
    export("linuxcnc", compensator(FILE, **ALL), tmp_path / "own.ini")
    rows = controllers.triplets(tmp_path / "own_joint_1.comp")
    np.testing.assert_allclose(rows[:, 1] - rows[:, 2], GAPS[1], atol=2e-3)


def test_steps_of_tables_are_as_asked(tmp_path: Path) -> None:
    export("siemens", compensator(FILE, **HELD), tmp_path / "a", step=10.0)
    assert "$AA_ENC_COMP[0,29,AX1]" in (tmp_path / "a").read_text()
    assert "$AA_ENC_COMP[0,30,AX1]" not in (tmp_path / "a").read_text()
    export("linuxcnc", compensator(FILE, **HELD), tmp_path / "b.ini", step=0.1)
    assert len(controllers.triplets(tmp_path / "b_joint_2.comp")) == 256


def test_a_table_follows_the_screw_where_it_turns(tmp_path: Path) -> None:
    """A wave of the screw is met where the slider really goes, half a millimetre from where it was sent before."""
    wave = {"once_per_rev": {"cosine_mm": (0.01, 0.012, 0.008), "period_mm": 5.0}, "homing_offset": {"offset_mm": 0.6}}
    result = export("siemens", compensator(FILE, **wave), tmp_path / "out")
    assert set(result.holds) == {"once-per-rev", "homing-offset"} and result.error_um.format < 0.3


ARM = """
[machine]
kind = "serial"
convention = "{convention}"
tool_mm = [10.0, -20.0, 95.0]
{joints}
"""


def arm(convention: str) -> MachineFile:
    joints = [(0.0, 90.0, 330.0, 0.0), (-410.0, 3.0, 12.0, 90.0), (95.0, -90.0, 5.0, -30.0), (0.0, 90.0, 310.0, 0.0)]
    joints += [(0.0, -90.0, 0.0, 0.0), (0.0, 0.0, 80.0, 20.0)]
    keys = ("a_mm", "alpha_deg", "d_mm", "theta_offset_deg")
    text = "".join(
        "[[machine.joint]]\nlimits_deg = [-150.0, 150.0]\n"
        + "".join(f"{key} = {value}\n" for key, value in zip(keys, joint, strict=True))
        for joint in joints
    )
    return parse_machine(ARM.format(convention=convention, joints=text))


OFFSETS = {
    "da_mm": [0.3, -0.2, 0.1, 0.0, 0.2, 0.0],
    "dalpha_rad": [1e-3, -2e-3, 5e-4, 1e-3, 0.0, 0.0],
    "dtheta_rad": [2e-3, 1e-3, -1e-3, 0.0, 1e-3, 0.0],
}


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_urdf_is_the_calibrated_arm(convention: str, tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    file = arm(convention)
    result = export("urdf", compensator(file, dh_offsets=OFFSETS), tmp_path / "arm.urdf")
    assert result.holds == ("dh-offsets",) and result.error_um.format < 0.01 < 100.0 < result.error_um.drawing
    q = np.random.default_rng(2).uniform(-2.5, 2.5, (50, 6))
    place, turned = np.zeros((50, 3)), Rotation.identity(50)
    for joint, spec in enumerate(file.machine.joint):
        a, alpha = spec.a_mm + OFFSETS["da_mm"][joint], np.radians(spec.alpha_deg) + OFFSETS["dalpha_rad"][joint]
        angle = q[:, joint] + np.radians(spec.theta_offset_deg) + OFFSETS["dtheta_rad"][joint]
        about_z = Rotation.from_euler("z", angle[:, None])
        screws = [(about_z, (0.0, 0.0, spec.d_mm)), (Rotation.from_euler("x", alpha), (a, 0.0, 0.0))]
        for turn, shift in screws if convention == "standard" else screws[::-1]:
            place, turned = place + turned.apply(shift), turned * turn
    place = place + turned.apply(file.machine.tool_mm)
    np.testing.assert_allclose(controllers.urdf(tmp_path / "arm.urdf", q), place, atol=1e-5)


def test_urdf_is_read_by_another_package(tmp_path: Path) -> None:
    chain = pytest.importorskip("ikpy.chain")
    export("urdf", compensator(arm("modified"), dh_offsets=OFFSETS), tmp_path / "arm.urdf")
    mask = [False, *[True] * 6, False]
    read = chain.Chain.from_urdf_file(
        str(tmp_path / "arm.urdf"), base_elements=["base_link"], active_links_mask=mask, symbolic=False
    )
    q = np.random.default_rng(3).uniform(-2.5, 2.5, (10, 6))
    theirs = np.array([1e3 * read.forward_kinematics([0.0, *row, 0.0])[:3, 3] for row in q])
    np.testing.assert_allclose(controllers.urdf(tmp_path / "arm.urdf", q), theirs, atol=1e-6)


def test_an_effect_of_the_pose_is_no_part_of_a_chain(tmp_path: Path) -> None:
    file = load_machine(DATA / "machines" / "ur10.toml")
    weak = {"compliance_rad_per_nmm": [1e-8] * 6}
    comp = compensator(file, homing_offset={"offset_rad": [1e-3] * 6}, axis_compliance=weak)
    result = export("urdf", comp, tmp_path / "arm.urdf")
    assert [item.effect for item in result.cannot_hold] == ["axis-compliance"] and result.holds == ("homing-offset",)
    assert result.error_um.format < 0.8 * result.error_um.drawing


def test_axes_of_an_arm_have_tables_in_degrees(tmp_path: Path) -> None:
    file = arm("standard")
    zeros = [2e-3, -1e-3, 1e-3, 0.0, 5e-4, 0.0]
    result = export("siemens", compensator(file, homing_offset={"offset_rad": zeros}), tmp_path / "arm.ini")
    at = np.array([-30.0, 10.0, 80.0])
    for axis, zero in enumerate(zeros):
        sent = controllers.siemens_axis(tmp_path / "arm.ini", axis, at)
        np.testing.assert_allclose(sent, at - np.degrees(zero), atol=1e-3)
    assert result.error_um.format < 0.1 * result.error_um.drawing


def test_the_command_tells_a_program_and_heads_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, out = tmp_path / "m.toml", tmp_path / "printer.cfg"
    comp = compensator(FILE, **ALL)
    own = ({"note": "greased the screws", "files": 3},)  # a person's entry holds what it likes
    save_machine(replace(comp.model.file, text="", history=comp.model.file.history + own), model)
    assert run(["export", "--model", str(model), "--to", "klipper", "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["written"] == [str(out)] and set(told["error_um"]) == {"drawing", "format", "model"}
    assert {item["effect"] for item in told["cannot_hold"]} >= {"backlash"}
    head = out.read_text().split("[printer]")[0]
    assert sha256(model) in head and "m.toml" in head and re.search(r"\d{4}-\d\d-\d\d", head)
    assert run(["export", "--model", str(model), "--to", "urdf", "--out", str(out)]) == 2
    assert run(["export", "--model", str(model), "--to", "klipper", "--out", str(tmp_path)]) == 2
    assert run(["export", "--model", str(model), "--to", "linuxcnc", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "lineardelta.ini").exists() and (tmp_path / "lineardelta_joint_2.comp").exists()
    assert run(["export", "--model", str(DATA / "machines" / "ur10.toml"), "--to", "marlin", "--out", str(out)]) == 2


@pytest.mark.parametrize("to", ["klipper", "linuxcnc", "siemens", "table"])
def test_what_yields_to_a_payload_alone_is_not_held_where_none_is_known(to: str, tmp_path: Path) -> None:
    weak = {"axis_compliance": {"compliance_mm_per_n": [3e-4] * 3}}
    result = export(to, compensator(drawn(), **weak), tmp_path / "out")
    assert result.holds == () and "load" in result.cannot_hold[0].why
    heavy = export(to, compensator(drawn(platform_mass_kg=60.0), **weak), tmp_path / "heavy")
    assert heavy.error_um.format < 0.5 * heavy.error_um.drawing  # the platform's own weight is there without a payload
    assert all("stated" not in item.why and "of none" not in item.why for item in heavy.cannot_hold)
