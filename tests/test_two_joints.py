"""A joint of an arm that errs with the attitude of a link, which follows two joints together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.effects.prefilled import prefilled
from ptt.judge.ladder.climb import climb
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

UR10 = load_machine(Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml")
NOISE = 0.03  # mm


def run(joint: int, error) -> Problem:
    """Random poses of an arm of which one joint errs by a function of all joints, rad."""
    file = replace(UR10, tracker=UR10.tracker.model_copy(update={"frame": "fitted", "sigma_mm": NOISE}))
    robot, random = build_mechanism(file.machine), np.random.default_rng(4)
    q = random.uniform(-2.0, 2.0, (300, 6))
    off = np.zeros_like(q)
    off[:, joint] = error(*q.T)
    reading = robot.forward(torch.as_tensor(q + off)).numpy() + random.normal(0.0, NOISE, (len(q), 3))
    return build_problem(file, make_table(None, q, measured=reading, time_s=10.0 * np.arange(len(q))))


@pytest.mark.parametrize(
    ("joint", "error", "together"),
    [
        (2, lambda q1, q2, q3, *_: 6e-4 * np.sin(2.0 * (q2 + q3)), ("q2", "q3")),
        pytest.param(4, lambda *q: 8e-3 * np.sin(2.0 * q[3]) * np.cos(q[4]), ("q4", "q5"), marks=pytest.mark.long),
    ],
)
def test_what_follows_two_joints_is_told_by_these_and_written_as_a_law(tmp_path: Path, joint, error, together) -> None:
    """It is no matter of time, and no weight, gear or link stands in for it."""
    problem = run(joint, error)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.residual, first.together) == (f"joint {joint + 1}", together) and first.share > 0.9
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [first.to_dict()]).text)
    ladder = climb(Model(problem.file), problem, [library(path)["own-cause"]()])
    assert ladder.steps[-1].heldout_rms_um["total"] < 1.1e3 * np.sqrt(3.0) * NOISE
