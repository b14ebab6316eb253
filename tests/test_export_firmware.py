"""Formats of controllers: a machine driven through each one's own arithmetic misses by what the export says."""

import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import controllers
import numpy as np
import pandas as pd
import pytest
from told_models import compensator

from ptt.correct.exports import reprapfirmware
from ptt.correct.exports.delta import drawn_delta
from ptt.correct.exports.format import ErrorLeft, Options, said_held
from ptt.correct.exports.left import sample_workspace
from ptt.correct.exports.registry import find_format, writer
from ptt.correct.training.compensator import Compensator
from ptt.errors import InputError
from ptt.machine import MachineFile, parse_machine
from ptt.machine_schema import ControllerSpec
from ptt.mechanisms import build_mechanism
from ptt.plan.space import build_space, draw_poses
from ptt.rig import parse_rig, simulate
from ptt.rig.nominal import can_reach, ideal_machine, nominal_sliders

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


def test_figures_that_take_a_part_are_no_drawing() -> None:
    unknown = ErrorLeft.told({"drawing": 5.0, "format": None, "model": 1.0})
    assert said_held((), ("lead-scale",), unknown) == "no effect completely"
    assert said_held((), (), ErrorLeft(5.0, 5.0, 5.0)) == "the drawing, for the model has no effects"
    assert said_held((), ("lead-scale",), ErrorLeft(90.0, 9.0, 1.0)).startswith("no effect completely")
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


def test_a_tilt_of_the_bed_is_read_by_the_firmware_as_it_is_meant(tmp_path: Path) -> None:
    """In millimetres of height a hundred millimetres aside, as M666 has it: 0.2 along x and -0.1 along y."""
    sample = sample_workspace(compensator(FILE), Options(), 40)
    meant = replace(drawn_delta(FILE.machine), tilt=np.array([2e-3, -1e-3]))
    lines, printed = reprapfirmware._lines(meant, sample)
    assert lines[1].endswith("A0.20000 B-0.10000")
    (tmp_path / "config.g").write_text("\n".join(lines) + "\n")
    read = sliders("reprapfirmware", FILE, tmp_path / "config.g")
    for delta in (meant, printed):
        np.testing.assert_allclose(read, delta.sliders(targets(FILE)), atol=5e-5)


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
    with pytest.raises(InputError, match="cannot express this drawing"):
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
