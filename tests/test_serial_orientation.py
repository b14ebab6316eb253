"""Measured orientations of an arm's tool, compared with the model's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.effects.registry import library, make_effect
from ptt.fitting.orientation import orientation_rms
from ptt.fitting.report import report_fit
from ptt.fitting.report_words import format_fit
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.mechanisms.rotations import quaternion_of
from ptt.model.model import Model
from ptt.rig.draw_arm import draw_arm
from ptt.rig.serial_arm import rigid
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
TURN = rigid(np.array([0.4, -1.1, 0.3]), np.zeros(3))[:3, :3]  # how the target sits on the tool
SIGMA_RAD = 2e-5


def measured() -> Problem:
    """A UR10 with a wrist link off in twist and offset angle, read in six dimensions."""
    file = load_machine(MACHINES / "ur10.toml")
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.01}))
    run = draw_arm(file.machine, "none", 3, rows=80)
    link = np.zeros((6, 4))
    link[4], link[2, 0] = [0.0, 1.5e-3, 0.0, 2e-3], 0.4
    rig = replace(run.rig, faults=replace(run.rig.faults, link=link))
    readings = rig.measure(run.q, run.payload_kg, run.temp_c, 1)
    random, tools = np.random.default_rng(2), rig.settle(run.q, run.payload_kg, run.temp_c)[1][:, :3, :3]
    wrong = [rigid(random.normal(0.0, SIGMA_RAD, 3), np.zeros(3))[:3, :3] for _ in tools]
    turns = rig.tracker[:3, :3] @ tools @ np.stack(wrong) @ TURN  # as a probe of six dimensions reads them
    table = make_table(None, run.q, readings, orientation_measured=quaternion_of(torch.tensor(turns)).numpy())
    return build_problem(file, table)


def test_a_fit_of_positions_brings_orientations_nearer_and_their_target_sits_anyhow() -> None:
    problem = measured()
    model = Model(problem.file) + make_effect(library(), "dh-offsets")
    before, after = (orientation_rms(fit(each, problem), problem) for each in (Model(problem.file), model))
    assert before is not None and after is not None
    assert before > 0.5 > after


def test_fit_report_tells_the_orientation_where_there_is_one() -> None:
    problem = measured()
    fitted = fit(Model(problem.file), problem)
    report = report_fit(fitted, problem)
    assert report.orientation_mrad is not None and "mrad RMS" in format_fit(report)
    blind = build_problem(problem.file, replace(problem.table, orientation_measured=None))
    assert orientation_rms(fit(Model(blind.file), blind), blind) is None
    turned = problem.table.orientation_measured
    lone = np.full_like(turned, np.nan)  # one orientation, at a row without a position
    lone[0], positions = turned[0], np.where(np.arange(80)[:, None] > 0, problem.table.measured, np.nan)
    apart = build_problem(problem.file, replace(problem.table, orientation_measured=lone, measured=positions))
    assert orientation_rms(fit(Model(apart.file), apart), apart) is None
