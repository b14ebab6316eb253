"""Readings that were set aside as gross errors: those that all lie along the way of one joint are the machine's."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

ROWS, NOISE = 240, 0.004


def told_of(seed: int, err: Literal["to every side", "along x", "by slider 2"], reach: float = 60.0) -> Diagnosis:
    """A sound machine that errs by a tenth of a millimetre in one reading of twenty, within a reach in mm."""
    file, random = bench(), np.random.default_rng(seed)
    robot = build_mechanism(file.machine)
    target = random.uniform(-reach, reach, (ROWS, 3))
    joints = robot.inverse(torch.as_tensor(target))
    off = random.random(ROWS) < 0.05
    size = off * random.choice([-1.0, 1.0], ROWS) * random.uniform(0.08, 0.2, ROWS)
    way = np.array([1.0, 0.0, 0.0]) if err == "along x" else random.normal(size=(ROWS, 3))
    way = way / np.linalg.norm(way, axis=-1, keepdims=True)
    error = (robot.jacobian(joints).numpy()[:, :, 1] if err == "by slider 2" else way) * size[:, None]
    read = target + error + random.normal(0.0, NOISE, target.shape)
    table = replace(make_table(target, joints.numpy()), measured=read)
    return diagnose(Model(file), build_problem(file, table))


@pytest.mark.parametrize("err", ["to every side", "along x"])
@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.long)])
def test_gross_errors_are_to_every_side_or_to_one(seed: int, err: Literal["to every side", "along x"]) -> None:
    found = told_of(seed, err)
    assert found.outliers.sum() >= 5
    assert found.verdict == "nothing-missing"


@pytest.mark.parametrize("reach", [8.0, 60.0])
@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.long)])
def test_what_one_joint_does_now_and_then_is_no_gross_error(seed: int, reach: float) -> None:
    found = told_of(seed, "by slider 2", reach)
    assert found.verdict == "unknown"
    assert "in which slider 2 moves the tool" in found.words or any(
        "slider 2" in each.residual for each in found.depends_on
    )


@pytest.mark.parametrize("seed", [pytest.param(2, marks=pytest.mark.long), 3])
def test_what_sticks_after_each_reversal_of_all_joints_is_no_gross_error(seed: int) -> None:
    """Columns driven up and down: each joint is off by a tenth, the way it goes, from 4 to 14 mm past a reversal."""
    file, random = bench(), np.random.default_rng(seed)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE}))
    robot, up = build_mechanism(file.machine), np.linspace(-45.0, 45.0, 9)
    columns = random.uniform(-35.0, 35.0, (15, 2))
    target = np.array([[*column, z] for column in columns for z in (*up, *up[::-1])])
    sent = robot.inverse(torch.as_tensor(target)).numpy()
    steps = np.diff(sent, axis=0, prepend=2.0 * sent[:1] - sent[1:2])
    way, past = np.sign(steps[0]), np.full(3, 50.0)
    error = np.zeros_like(sent)
    for row, step in enumerate(steps):
        turned = (step != 0.0) & (np.sign(step) != way)
        past = np.where(turned, np.abs(step), past + np.abs(step))
        way = np.where(turned, np.sign(step), way)
        error[row] = 0.1 * way * ((past > 4.0) & (past < 14.0))
    read = robot.forward(torch.as_tensor(sent + error)).numpy() + random.normal(0.0, NOISE, target.shape)
    found = diagnose(Model(file), build_problem(file, replace(make_table(target, sent), measured=read)))
    assert found.verdict == "unknown"
