"""A rung of a ladder: the order in which effects are added does not decide what is fitted."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.judge.ladder.climb import climb
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROWS, KNOCKED = 160, 96  # readings, and the first one after the knock


def knocked_beside_a_worn_guide() -> Problem:
    """A run that climbs: where guide 3 errs is when it errs, so a knock sought without it is found at a wrong row."""
    file, random, row = bench(), np.random.default_rng(4), np.arange(ROWS)
    robot = build_mechanism(file.machine)
    assert isinstance(robot, ThreePtt)
    heights = np.linspace(-60.0, 60.0, ROWS)
    target = np.column_stack([40.0 * np.cos(0.7 * row), 40.0 * np.sin(0.9 * row), heights]).round(4)
    sent = robot.inverse(torch.as_tensor(target))
    turned = sent + 0.03 * torch.sin(2.0 * torch.pi * sent / 5.0 + torch.tensor([0.3, 1.1, 2.0]))
    worn = 1.1 * torch.exp(-torch.square(((sent[:, 2] - sent[:, 2].mean()) / 60.0 - 0.6) / 0.25))
    azimuth = np.radians(240.0)
    across = torch.tensor([-np.sin(azimuth), np.cos(azimuth), 0.0], dtype=torch.float64)
    reached = []
    for heights_of_row, aside in zip(turned, worn, strict=True):
        foot = robot.foot.clone()
        foot[2] += aside * across
        reached.append(replace(robot, foot=foot).forward(heights_of_row[None])[0])
    measured = torch.stack(reached).numpy() + random.normal(0.0, 0.004, (ROWS, 3))
    measured[KNOCKED:] += [0.02, 0.0, -0.05]
    return build_problem(file, make_table(target, sent.numpy(), measured=measured, time_s=10.0 * row))


@pytest.mark.parametrize(
    "order",
    [("guide-straightness", "once-per-rev", "setup-jump"), ("once-per-rev", "setup-jump", "guide-straightness")],
)
def test_a_knock_that_is_added_before_what_hides_it_ends_at_the_same_row(order: tuple[str, ...]) -> None:
    problem = knocked_beside_a_worn_guide()
    ladder = climb(Model(problem.file), problem, [make_effect(library(), name) for name in order])
    (knock,) = (term for term in ladder.model.terms if term.effect.name == "setup-jump")
    assert float(knock.theta[-1]) == 10.0 * (KNOCKED - 1)
    assert ladder.to_dict()["steps"][-1]["rms_um"]["total"] < 7.5
