"""Broken beams that follow each other: no knock, slip or jump that undo one another."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.diagnosis.verdict import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

ROWS, NOISE, GAP = 110, 0.0015, np.array([0.045, 0.13, 0.09])
DRIFT = np.array([0.076, 0.009, -0.046])


@pytest.mark.parametrize("broken", [(104, 105), (50, 51), (97, 98, 99)])
def test_broken_beams_in_a_row_beside_play_and_a_drift_are_gross_errors(broken: tuple[int, ...]) -> None:
    """Play of 0.1 mm hides errors of 0.1 to 0.3 mm at first; a slip and two knocks then explain two of them."""
    random, file = np.random.default_rng(len(broken) + broken[0]), bench()
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE}))
    robot = build_mechanism(file.machine)
    target = random.uniform([-60.0, -60.0, -45.0], [60.0, 60.0, 45.0], (ROWS, 3))
    sent = robot.inverse(torch.as_tensor(target)).numpy()
    way = np.sign(np.diff(sent, axis=0, prepend=sent[:1] - 1.0))
    there = robot.forward(torch.as_tensor(sent - 0.5 * way * GAP)).numpy()
    time = 3.3 * np.arange(ROWS)
    read = there + DRIFT * (1.0 - np.exp(-time / 160.0))[:, None] + random.normal(0.0, NOISE, target.shape)
    for row in broken:
        read[row] += random.uniform(0.08, 0.3) * (side := random.normal(size=3)) / np.linalg.norm(side)
    table = replace(make_table(target, sent, time_s=time), measured=read)
    found = diagnose(Model(file), build_problem(file, table))
    assert found.verdict == "missing" and {step[0] for step in found.suggested} == {"backlash", "tracker-drift"}
    assert found.outliers[list(broken)].all()
