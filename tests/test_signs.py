"""Values of a sign that no cause has: another name, or none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.machine import load_machine
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view

DRAWN = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
TRACKER = DRAWN.tracker.model_copy(update={"frame": "fitted", "sigma_mm": 0.003, "base_point": ()})
FILE = replace(DRAWN, tracker=TRACKER, text="")
PLACES = np.random.default_rng(3).uniform(-60.0, 60.0, (160, 3))


def read(name: str, theta: list[float], **columns: np.ndarray) -> Table:
    """A machine on which one effect has values that it may not have."""
    table = make_table(PLACES, **columns)
    there = predict([(library()[name](), torch.tensor(theta, dtype=torch.float64))], build_view(FILE, table)).p.numpy()
    return table.replace(measured=there + 0.003 * np.random.default_rng(4).normal(size=there.shape))


def test_a_spring_that_moves_against_its_load_is_told_as_an_unknown() -> None:
    table = read("axis-compliance", [-4e-4, -4e-4, -5e-4], payload_kg=np.repeat([0.0, 5.0, 0.0, 5.0], 40))
    found = diagnose(Model(FILE), build_problem(FILE, table))
    assert found.verdict == "unknown" and "axis-compliance" not in {step[0] for step in found.suggested}
    assert found.depends_on[0].on == "payload"


def test_screws_that_shrink_with_warmth_are_not_named() -> None:
    warm = np.linspace(18.0, 26.0, 160)
    growth = [-4e-5, -4e-5, -4e-5, 2e-3, -3e-3, 1e-3, *[0.0] * 5]
    table = read("screw-growth", growth, temp_c=warm, time_s=60.0 * np.arange(160.0))
    found = diagnose(Model(FILE), build_problem(FILE, table))
    assert not any(item.effect == "screw-growth" and min(p.value for p in item.parameters[:3]) < -2e-5
                   for item in found.candidates if (item.effect,) in found.suggested)  # fmt: skip
