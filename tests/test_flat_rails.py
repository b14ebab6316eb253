"""Rails that lie flat, as in a star: across them is up and sideways, and outward is along them."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from built_c import check, path_of, random_model
from test_export_onnx import run as run_graph

from ptt.correct.compensate import compensate
from ptt.correct.exports.format import Options
from ptt.correct.exports.onnx import write
from ptt.correct.training.compensator import Compensator
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.rig.nominal import ideal_machine, nominal_sliders
from ptt.rig.rig_file import parse_rig
from ptt.rig.simulate import simulate, write_run
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

STAR = """
[machine]
kind = "three-ptt"
name = "star"
base_radius_mm = 600
platform_radius_mm = 120
link_length_mm = 620
slider_lean_deg = [90, 90, 90]
slider_travel_mm = [150, 650]
screw_lead_mm = 10
platform_mass_kg = 2

[tracker]
frame = "trusted"
sigma_mm = 0.005
"""
BOW = {"straightness_height_mm": [300.0, 350.0, 400.0, 450.0, 500.0]}


@pytest.fixture
def star() -> MachineFile:
    return parse_machine(STAR, "star.toml")


def measure(tmp_path, star: MachineFile, geometry: dict, *, noise: bool) -> Problem:
    """Places at random, of a star with faults."""
    rig = parse_rig(
        {
            "machine": tomllib.loads(format_machine(star)),
            "geometry": geometry,
            "tracker": {},
            "conditions": {},
        }
    )
    targets = np.random.default_rng(4).uniform(-1.0, 1.0, (150, 3)) * (110.0, 110.0, 60.0)
    found = simulate(rig, pd.DataFrame(targets, columns=["x_cmd", "y_cmd", "z_cmd"]), noise=noise)
    write_run(found.frame, tmp_path / "run.csv")
    return build_problem(star, read_table(tmp_path / "run.csv"))


FAULTS = {
    "yaw": ("tower-tilt", {"lean_tangential_mrad": [0.0, 0.6, 0.0]}, "Tower 2 leans counter-clockwise"),
    "sag": ("tower-tilt", {"lean_radial_mrad": [0.0, 0.0, 0.6]}, "Tower 3 leans downward"),
    "bow": (
        "guide-straightness",
        BOW | {"straightness_radial_um": [[0.0] * 5, [0, 30, 40, 30, 0], [0.0] * 5]},
        "downward",
    ),
    "low": ("tower-position", {"tower_radial_mm": [0.08, 0.0, 0.0]}, "[Tt]ower 1 stands 8\\d um too far downward"),
}


@pytest.mark.parametrize(("lean", "rises"), [(0.0, 0.0), (44.0, 0.0), (46.0, -np.sin(np.radians(46.0))), (90.0, -1.0)])
def test_a_rail_is_flat_beyond_forty_five_degrees_and_stands_off_across_then(lean: float, rises: float) -> None:
    """Less steep than that, what lies outward lies along the rail rather than across it, and is a homing offset."""
    spec = parse_machine(STAR).machine.model_copy(update={"slider_lean_deg": (lean,) * 3})
    mechanism = build_mechanism(spec)
    assert mechanism.flat.tolist() == [lean > 45.0] * 3
    np.testing.assert_allclose(mechanism.foot_direction[:, 2], rises, atol=1e-12)
    outward = np.sqrt(1.0 - rises**2)
    azimuth = np.radians([0.0, 120.0, 240.0])
    wanted = outward * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    np.testing.assert_allclose(mechanism.foot_direction[:, :2], wanted, atol=1e-12)


@pytest.mark.parametrize("fault", list(FAULTS))
def test_what_lies_across_a_flat_rail_has_its_name_and_is_said_as_it_lies(fault: str, star: MachineFile, tmp_path):
    name, geometry, said = FAULTS[fault]
    found = diagnose(Model(star), measure(tmp_path, star, geometry, noise=True))
    assert (found.verdict, [step[0] for step in found.suggested]) == ("missing", [name]), found.words
    assert re.search(said, found.words), found.words


@pytest.mark.parametrize(
    ("name", "geometry"),
    [
        ("tower-position", {"tower_radial_mm": [0.3, -0.2, 0.1], "tower_tangential_mm": [0.1, 0.2, -0.3]}),
        ("tower-tilt", {"lean_radial_mrad": [1.0, -0.5, 0.0], "lean_tangential_mrad": [0.6, 0.0, -1.1]}),
    ],
)
def test_the_equation_is_the_machine(name: str, geometry: dict, star: MachineFile, tmp_path):
    problem = measure(tmp_path, star, geometry, noise=False)
    scale = 1e-3 if name == "tower-tilt" else 1.0
    theta = scale * torch.tensor([value for way in geometry.values() for value in way], dtype=torch.float64)
    reading = predict([(library()[name](), theta)], problem.view).reading.numpy()
    assert np.abs(problem.measured - problem.view.p.numpy()).max() > 0.1
    assert np.abs(problem.measured - reading).max() < 1e-3


def test_exports_send_what_predict_sends(star: MachineFile, tmp_path):
    file = replace(star, machine=star.machine.model_copy(update={"slider_lean_deg": (90.0, 60.0, -30.0)}))
    model = random_model(file, 5, ("tower-position", "tower-tilt", "guide-straightness"))
    targets = build_mechanism(file.machine).forward(torch.tensor(path_of(file, 3, 40))).numpy()
    compensator = Compensator(model, None, {})
    _, found, _ = check(compensator, targets, tmp_path)
    assert found.sent.any() and found.missed[found.sent].max() < 1e-9
    write(compensator, tmp_path / "m.onnx", Options())
    expected = compensate(model, make_table(targets), reversal="none")
    sent = run_graph(tmp_path / "m.onnx", p=targets)["b"]
    np.testing.assert_allclose(sent[expected.sent], expected.q[expected.sent], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("lean", [0.0, 40.0, 70.0, 90.0])
@pytest.mark.parametrize("side", ["above", "below"])
def test_the_virtual_machine_counts_from_where_its_sliders_stand_at_zero(lean: float, side: str) -> None:
    """A rail that leans past the link has its slider on the other side of it, and elsewhere than upright."""
    spec = parse_machine(STAR).machine.model_copy(update={"slider_lean_deg": (lean,) * 3, "sliders": side})
    drawing, mechanism = ideal_machine(spec), build_mechanism(spec)
    zero = np.zeros((1, 3))
    np.testing.assert_allclose(drawing.home, mechanism.home().numpy(), atol=1e-9)
    np.testing.assert_allclose(nominal_sliders(drawing, zero)[0], drawing.home, atol=1e-9)
    reach = np.linalg.norm(drawing.platform_radius * drawing.outward - drawing.pivot, axis=1)
    np.testing.assert_allclose(reach, drawing.link, atol=1e-9)
