"""One joint of an arm that winds up, or whose zero is off, is named: an unknown of that joint needs fewer values."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from serial_arms import MACHINES

from ptt.challenge.cases import draw, plan
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.run.problem import build_problem
from ptt.run.table import make_table


def behind(angles: np.ndarray, height: float, length: float) -> np.ndarray:
    """How far a joint stays behind, (n,) rad: each move brings it nearer to the side that it moves to."""
    side = np.zeros(len(angles))
    for row in range(1, len(angles)):
        move = angles[row] - angles[row - 1]
        side[row] = np.sign(move) + (side[row - 1] - np.sign(move)) * np.exp(-abs(move) / length)
    return -height * side


@pytest.mark.parametrize(("name", "joint"), [pytest.param("kuka_iiwa", 3, marks=pytest.mark.long), ("ur10", 4)])
def test_wind_up_of_one_joint_is_named(name: str, joint: int) -> None:
    file, random, rows = load_machine(MACHINES / f"{name}.toml"), np.random.default_rng(5), 220
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.03, "frame": "fitted"}))
    robot, joints = build_mechanism(file.machine), file.machine.joints
    sent = np.cumsum(random.normal(0.0, 0.08, (rows, joints)), axis=0)  # short moves, on which it shows
    sent -= sent.mean(axis=0)
    actual = sent.copy()
    actual[:, joint] += behind(sent[:, joint], 6e-4, 0.1)
    measured = robot.forward(torch.as_tensor(actual)).numpy() + random.normal(0.0, 0.03, (rows, 3))
    table = make_table(None, sent, measured)
    found = diagnose(Model(file), build_problem(file, table))
    assert (found.verdict, found.suggested) == ("missing", (("windup",),))


@pytest.mark.long
def test_a_zero_that_is_off_is_no_unknown_which_is_hardly_more_than_a_level() -> None:
    """Its name has to pay for its size and the choice of its joint, a block of that joint with a level does not."""
    case = next(case for case in plan("multi", 24, 95210, arm=True, bench=None) if case.seed == 95214)
    drawn, _ = draw(case)
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    assert found.verdict == "missing"
    assert {step[0] for step in found.suggested} == {"homing-offset", "windup", "self-weight"}
