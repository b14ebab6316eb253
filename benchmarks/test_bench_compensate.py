"""One corrected command, and a path of them, beside the drawing's own inverse."""

import numpy as np
import pytest
import torch

from ptt.correct.compensate import compensate
from ptt.effects import library
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

MACHINE = "data/sealed_three/machine.toml"
EFFECTS = ("backlash", "axis-compliance", "frame-growth")


@pytest.fixture(scope="module")
def model() -> Model:
    bare = Model(load_machine(MACHINE))
    problem = build_problem(bare.file, read_table("data/sealed_three/run.csv"))
    for name in EFFECTS:
        bare = bare + library()[name]()
    return fit(bare, problem).model


@pytest.mark.benchmark(group="commands")
@pytest.mark.parametrize("rows", [2, 300])
def test_corrected_commands(benchmark, model, rows):
    angle = np.linspace(0.0, 6.0, rows)
    target = np.column_stack([50.0 * np.cos(angle), 50.0 * np.sin(angle), 3.0 * angle])
    table = make_table(target, payload_kg=np.full(rows, 2.0), temp_c=np.full(rows, 22.0))
    commands = benchmark(compensate, model, table)
    assert np.isfinite(commands.q).all()


@pytest.mark.benchmark(group="commands")
@pytest.mark.parametrize("rows", [2, 300])
def test_drawing_alone(benchmark, rows):
    mechanism = build_mechanism(load_machine(MACHINE).machine)
    target = torch.zeros(rows, 3, dtype=torch.float64)
    assert torch.isfinite(benchmark(mechanism.inverse, target)).all()
