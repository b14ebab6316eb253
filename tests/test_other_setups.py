"""What other set-ups of the tracker leave of a model, beside a verdict."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.diagnosis.telling.other_setups import other_setups
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ARM = load_machine(Path(__file__).resolve().parents[1] / "data" / "machines" / "kuka_iiwa.toml")


def read(tool: tuple[float, float, float], zeros: float, trusted: str) -> tuple[Model, Problem]:
    """An arm of the modified convention, whose last joint turns behind all its links; how far off its tool sits."""
    machine = ARM.machine.model_copy(update={"convention": "modified"})
    tracker = ARM.tracker.model_copy(update={"frame": "trusted", "tool": trusted, "sigma_mm": 0.02})
    file, random = replace(ARM, machine=machine, tracker=tracker), np.random.default_rng(1)
    off = machine.model_copy(update={"tool_mm": tuple(np.add(machine.tool_mm, tool))})
    q = random.uniform(-1.5, 1.5, (60, 7))
    there = build_mechanism(off).forward(torch.as_tensor(q + zeros)).numpy()
    measured = there + random.normal(0.0, 0.02, there.shape)
    return Model(file), build_problem(file, make_table(None, q, measured=measured))


@pytest.mark.parametrize(
    ("tool", "zeros", "trusted", "told"),
    [
        ((0.15, -0.05, 0.0), 0.0, "trusted", True),
        ((0.15, -0.05, 0.0), 0.0, "fitted", False),
        ((0.0, 0.0, 0.0), 0.0, "trusted", False),
        ((0.0, 0.0, 0.0), 5e-4, "trusted", False),
    ],
)
def test_a_trusted_reflector_is_asked_for_where_its_place_would_explain_the_error(
    tool: tuple[float, float, float], zeros: float, trusted: str, told: bool
) -> None:
    words = other_setups(*read(tool, zeros, trusted))
    assert ('tool = "fitted" the error of the model as given is only 3' in words) is told
    assert (words == "") is not told
