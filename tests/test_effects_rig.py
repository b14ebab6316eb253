"""The equations of effects against the virtual machine, which solves six equations a pose and shares none of them."""

import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.effects import library
from ptt.machine import format_machine
from ptt.model.chain import predict
from ptt.rig.rig_file import parse_rig
from ptt.rig.simulate import simulate, write_run
from ptt.run.problem import build_problem
from ptt.run.reading import read_table

TRUSTED = replace(bench_machine(), tracker=bench_machine().tracker.model_copy(update={"frame": "trusted"}))
WARM = {"room": {"rise_k": 30.0, "time_constant_s": 400.0}}
LOADED = {"cycles": 2, "payload_per_cycle_kg": [1.0, 6.0]}


def run(folder, faults, conditions, spread, file=TRUSTED):
    """Commands in a volume, read without noise; the view of the same rows, and what was read."""
    rig = parse_rig({"machine": tomllib.loads(format_machine(file)), "conditions": conditions, **faults})
    targets = np.random.default_rng(3).uniform(-1.0, 1.0, (60, 3)) * spread
    path = folder / "run.csv"
    write_run(simulate(rig, pd.DataFrame(targets, columns=["x_cmd", "y_cmd", "z_cmd"]), noise=False).frame, path)
    problem = build_problem(file, read_table(path))
    return problem.view, problem.measured


# effect, its true parameters, the rig's faults, conditions; then what may be left of an error, um.
EXACT = [
    ("frame-growth", [24e-6, 11e-6, *[0.0] * 5],
     {"thermal": {"frame_um_per_m_k": 24.0, "link_um_per_m_k": 11.0}}, WARM, 1e-3),
    ("screw-growth", [12e-6, -12e-6, 8e-6, *[0.0] * 8], {"thermal": {
        "growth_um_per_m_k": [12.0, -12.0, 8.0], "fixed_end_mm": [282.842712474619] * 3}}, WARM, 1e-3),
    ("homing-slip", [0.1, 0.0, -0.2, 29.0], {"drive": {"slip_mm": [0.1, 0.0, -0.2], "slip_row": 30}}, {}, 1e-3),
    ("link-compliance", [4e-4, 1e-4, 0.0], {"geometry": {"link_compliance_um_per_n": [0.4, 0.1, 0.0]}}, LOADED, 0.05),
    ("backlash", [-0.05, 0.04, 0.0, 1.0], {"controller": {"backlash_mm": [0.08, 0.0, 0.0]},
                                      "drive": {"backlash_mm": [0.03, 0.04, 0.0]}}, {}, 0.05),
]  # fmt: skip


@pytest.mark.parametrize(("name", "theta", "faults", "conditions", "left_um"), EXACT)
def test_the_equation_is_the_machine(tmp_path, name, theta, faults, conditions, left_um):
    view, measured = run(tmp_path, faults, conditions, (85.0, 85.0, 50.0))
    values = torch.tensor(theta, dtype=torch.float64)
    if name == "homing-slip":
        values[-1] = view.time[int(values[-1])]
    reading = predict([(library()[name](), values)], view).reading.numpy()
    error, whole = 1e3 * np.abs(reading - measured).max(), 1e3 * np.abs(view.p.numpy() - measured).max()
    assert whole > 20.0
    assert error < left_um


def test_growth_is_exact_where_its_first_order_is_not(tmp_path):
    name, theta, faults, conditions, _ = EXACT[0]
    view, measured = run(tmp_path, faults, conditions | {"dwell_s": 40.0}, (85.0, 85.0, 50.0))
    values = torch.tensor(theta, dtype=torch.float64)
    first = (view.p + library()[name]().basis(view, {"start": values[2:-1], "late": values[-1:]}) @ values[:2]).numpy()
    whole = predict([(library()[name](), values)], view).reading.numpy()
    assert float(view.warmth.max()) > 29.0
    assert np.abs(whole - measured).max() < 0.01 * np.abs(first - measured).max()


LEANING = TRUSTED.machine.model_copy(update={"slider_lean_deg": (6.6, -8.0, 3.0)})


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("way", ["radial", "tangential"])
@pytest.mark.parametrize("drawn", [TRUSTED.machine, LEANING], ids=["upright", "leaning"])
def test_a_rail_that_leans_is_turned_about_its_pivot(tmp_path, drawn, way, sign):
    lean = [sign * 0.8, 0.0, sign * -1.2]
    values = torch.zeros(6, dtype=torch.float64)
    values[slice(0, 3) if way == "radial" else slice(3, 6)] = 1e-3 * torch.tensor(lean, dtype=torch.float64)
    view, measured = run(
        tmp_path,
        {"geometry": {f"lean_{way}_mrad": lean}},
        {},
        (85.0, 85.0, 50.0),
        replace(TRUSTED, machine=drawn, text=""),
    )
    reading = predict([(library()["tower-tilt"](), values)], view).reading.numpy()
    error, whole = 1e3 * np.abs(reading - measured).max(), 1e3 * np.abs(view.p.numpy() - measured).max()
    assert whole > 20.0
    assert error < 0.1  # the cosine of the turn is left out: half its square of the height above the pivot
