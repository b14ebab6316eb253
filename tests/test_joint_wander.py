"""A slow wander is the machine's own where it moves the readings as one joint does, else a tracker's."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import SIGMA, machine

from ptt.diagnosis.diagnose import diagnose
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

ROWS, STEP_S, LASTS_S = 200, 5.0, 80.0
TIMES = 2.0  # standard deviation of the wander over that of one axis's noise: less than what a tracker's may have


def wandering(seed: int, slider: int | None) -> Problem:
    """Random poses of a sound machine while a slider, or all readings, follow an Ornstein-Uhlenbeck process."""
    random, file = np.random.default_rng(seed), machine(frame="trusted")
    table = make_table(random.uniform(-60.0, 60.0, (ROWS, 3)), time_s=STEP_S * np.arange(ROWS))
    view, keeps = build_view(file, table), np.exp(-STEP_S / LASTS_S)
    walk = random.normal(size=(ROWS, 3))
    for row in range(1, ROWS):
        walk[row] = keeps * walk[row - 1] + np.sqrt(1.0 - keeps**2) * walk[row]
    way = view.jacobian.numpy()[:, :, slider] if slider is not None else np.ones((ROWS, 3))
    amount = walk if slider is None else walk[:, :1] * np.sqrt(3.0) / np.linalg.norm(way, axis=1).mean()
    read = view.p.numpy() + TIMES * SIGMA * amount * way + random.normal(0.0, SIGMA, (ROWS, 3))
    return build_problem(file, replace(table, measured=read))


@pytest.mark.parametrize(
    "slider", [pytest.param(0, marks=pytest.mark.long), pytest.param(1, marks=pytest.mark.long), 2]
)
def test_a_slider_that_wanders_is_told_from_a_tracker_that_does(slider: int) -> None:
    problem = wandering(slider, slider)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "unknown" and found.suggested == ()
    assert (found.depends_on[0].residual, found.depends_on[0].on) == (f"slider {slider + 1}", "time")
    assert found.depends_on[0].share > 0.5


@pytest.mark.parametrize(
    "seed", [0, 1, pytest.param(2, marks=pytest.mark.long), pytest.param(3, marks=pytest.mark.long)]
)
def test_a_tracker_that_wanders_as_much_is_none_of_the_machine(seed: int) -> None:
    problem = wandering(seed, None)
    assert diagnose(Model(problem.file), problem).verdict == "nothing-missing"
