"""Unknown physics of few values: it is told where it acts, and no tracker is blamed for it."""

from dataclasses import replace

import numpy as np
import torch
from made_runs import PLACE, SIGMA, TRACKER, machine

from ptt.diagnosis.diagnose import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROWS = 240


def read(slider: np.ndarray, link: np.ndarray, **context: np.ndarray) -> Problem:
    """Readings of a sound machine but for shifts of slider 2 and of the length of link 1, (n,) mm each."""
    file, random = machine(), np.random.default_rng(3)
    robot, target = build_mechanism(file.machine), random.uniform(-60.0, 60.0, (ROWS, 3))
    q, geometry = robot.inverse(torch.as_tensor(target)), torch.zeros(ROWS, len(robot.slots), dtype=torch.float64)
    geometry[:, list(robot.slots).index("leg 1 link length [mm]")] = torch.as_tensor(link)
    shift = torch.zeros_like(q)
    shift[:, 1] = torch.as_tensor(slider)
    tool = robot.forward(q + shift, geometry).numpy() + random.normal(0.0, SIGMA, (ROWS, 3))
    table = make_table(target, time_s=20.0 * np.arange(ROWS), **context)
    return build_problem(file, replace(table, measured=tool @ TRACKER.T + PLACE))


def test_a_link_that_warms_alone_is_no_growth_of_its_screw() -> None:
    """Nor of all of them: 4 um/K in the sun, on a day that warms by 6 K and has clouds."""
    time = np.linspace(0.0, 1.0, ROWS)
    warmth = 6.0 * time + np.sin(12.0 * time)
    problem = read(np.zeros(ROWS), 0.004 * warmth, temp_c=20.0 + warmth)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "unknown" and not found.suggested
    assert (found.depends_on[0].on, found.depends_on[0].acts_on) == ("temperature", "link 1")


def test_a_slider_that_settles_in_the_first_minutes_is_no_drift_of_the_tracker() -> None:
    problem = read(0.03 * np.exp(-np.arange(ROWS) / 12.0), np.zeros(ROWS))
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "unknown" and not found.suggested
    assert (found.depends_on[0].on, found.depends_on[0].acts_on) == ("time", "slider 2")
