"""The ONNX graph in onnxruntime: the static commands of `ptt predict`."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from built_c import path_of, random_model
from test_export_c import network_over
from test_export_urdf import arm

from ptt.correct.compensate import compensate
from ptt.correct.exports.format import Options
from ptt.correct.exports.onnx import write
from ptt.correct.training.compensator import Compensator
from ptt.machine import MachineFile
from ptt.machine_schema import TargetsSpec
from ptt.mechanisms import build_mechanism
from ptt.rig.draw_machine import draw_machine_file
from ptt.run.table import make_table

pytest.importorskip("onnx", reason="no onnx")
runtime = pytest.importorskip("onnxruntime", reason="no onnxruntime")


def run(path: Path, **inputs: np.ndarray) -> dict[str, np.ndarray]:
    session = runtime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    wanted = [each.name for each in session.get_inputs()]
    names = [each.name for each in session.get_outputs()]
    return dict(zip(names, session.run(names, {name: inputs[name] for name in wanted}), strict=True))


@pytest.mark.parametrize("seed", [1, pytest.param(4, marks=pytest.mark.long)])
def test_all_effects_on_drawn_machines(seed: int, tmp_path: Path) -> None:
    file = draw_machine_file(seed).file
    compensator = Compensator(random_model(file, seed), None, {})
    targets = build_mechanism(file.machine).forward(torch.tensor(path_of(file, seed))).numpy()
    result = write(compensator, tmp_path / "m.onnx", Options())
    assert {item.effect for item in result.cannot_hold} == {"backlash", "windup"} and len(result.holds) == 17
    assert result.error_um.model < result.error_um.format < result.error_um.drawing
    expected = compensate(compensator.model, make_table(targets, payload_kg=1.3, temp_c=26.0), reversal="none")
    rows = len(targets)
    load, warm = np.full((rows, 1), 1.3), np.full((rows, 1), 26.0)
    b = run(tmp_path / "m.onnx", p=targets, payload_kg=load, temp_c=warm)["b"]
    assert expected.sent.mean() > 0.8
    np.testing.assert_allclose(b[expected.sent], expected.q[expected.sent], rtol=0.0, atol=1e-9)


def test_the_network_its_domain_and_a_frame(bench: MachineFile, tmp_path: Path) -> None:
    stated = replace(bench, targets=TargetsSpec(origin_mm=(3.0, -2.0, 5.0), turn_deg=(0.0, 0.0, 20.0)))
    targets = build_mechanism(bench.machine).forward(torch.tensor(path_of(bench, 8, 150))).numpy()
    compensator = Compensator(
        random_model(stated, 9, ("homing-offset", "lead-scale")), network_over(targets[:90], 3), {}
    )
    write(compensator, tmp_path / "m.onnx", Options())
    correction, inside = compensator.network_parts()
    expected = compensate(compensator.model, make_table(targets), correction=correction, inside=inside)
    found = run(tmp_path / "m.onnx", p=targets)
    np.testing.assert_array_equal(found["inside"][:, 0], expected.in_domain)
    assert 0.1 < expected.in_domain.mean() < 0.95
    np.testing.assert_allclose(found["b"][expected.sent], expected.q[expected.sent], rtol=0.0, atol=1e-9)


FEW = ("homing-slip", "dh-offsets", "backlash", "windup")


@pytest.mark.parametrize(
    ("convention", "names"), [pytest.param("standard", FEW, marks=pytest.mark.long), ("modified", ())]
)
def test_an_arm_beside_its_nominal_joint_values(convention: str, names: tuple[str, ...], tmp_path: Path) -> None:
    """Angles tiny enough for a cosine that a runtime takes for one are among them."""
    file = arm(convention)
    compensator = Compensator(random_model(file, 4, names), None, {})
    posture = path_of(file, 5, 120)
    result = write(compensator, tmp_path / "m.onnx", Options())
    assert {item.effect for item in result.cannot_hold} == {"backlash", "windup"}
    all_ = {"dh-offsets", "axis-compliance", "self-weight", "joint-error-map", "frame-growth"}
    assert (set(names) & {"dh-offsets", "homing-slip"} or all_) <= set(result.holds)
    assert result.error_um.format < 0.5 * result.error_um.drawing
    targets = make_table(np.full((120, 3), np.nan), command=posture, payload_kg=1.3, temp_c=26.0)
    expected = compensate(compensator.model, targets, reversal="none", limit=50.0)
    load, warm = np.full((120, 1), 1.3), np.full((120, 1), 26.0)
    q = run(tmp_path / "m.onnx", q_nominal=posture, payload_kg=load, temp_c=warm)["q"]
    assert expected.sent.mean() > 0.8
    assert np.abs(expected.q - posture)[expected.sent].max() > 1e-4
    np.testing.assert_allclose(q[expected.sent], expected.q[expected.sent], rtol=0.0, atol=1e-9)
