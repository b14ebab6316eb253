"""An arm as URDF and as tables of its axes, driven through arithmetic of its own."""

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import controllers
import numpy as np
import pytest
from test_export_firmware import ALL, FILE, drawn, export
from told_models import compensator

from ptt.commands.main import run
from ptt.files import sha256
from ptt.machine import MachineFile, load_machine, parse_machine, save_machine

DATA = Path(__file__).resolve().parents[1] / "data"


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


def test_hyphens_in_a_name_leave_the_file_well_formed(tmp_path: Path) -> None:
    named = arm("modified").text.replace("[machine]", '[machine]\nname = "cell---3"', 1)
    export("urdf", compensator(parse_machine(named), dh_offsets=OFFSETS), tmp_path / "arm.urdf")
    assert ElementTree.parse(tmp_path / "arm.urdf").getroot().get("name") == "cell---3"


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
