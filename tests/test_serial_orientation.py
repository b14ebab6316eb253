"""Measured orientations of an arm's tool: compared with the model's, and fitted together with the positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.effects.registry import library, make_effect
from ptt.errors import TableError
from ptt.fitting.orientation import fit_poses, orientation_of
from ptt.fitting.report import format_fit, report_fit
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.mechanisms.rotations import quaternion_of
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.rig.draw_arm import draw_arm
from ptt.rig.serial_arm import rigid
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
TURN = rigid(np.array([0.4, -1.1, 0.3]), np.zeros(3))[:3, :3]  # how the target sits on the tool
SIGMA_RAD = 2e-5


def measured(joint: int = 4) -> tuple[Problem, np.ndarray]:
    """A UR10 with a wrist link off in twist and offset angle, read in six dimensions; and its link errors."""
    file = load_machine(MACHINES / "ur10.toml")
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.01}))
    run = draw_arm(file.machine, "none", 3, rows=80)
    link = np.zeros((6, 4))
    link[joint], link[2, 0] = [0.0, 1.5e-3, 0.0, 2e-3], 0.4
    rig = replace(run.rig, faults=replace(run.rig.faults, link=link))
    readings = rig.measure(run.q, run.payload_kg, run.temp_c, 1)
    random, tools = np.random.default_rng(2), rig.settle(run.q, run.payload_kg, run.temp_c)[1][:, :3, :3]
    wrong = [rigid(random.normal(0.0, SIGMA_RAD, 3), np.zeros(3))[:3, :3] for _ in tools]
    turns = rig.tracker[:3, :3] @ tools @ np.stack(wrong) @ TURN  # as a probe of six dimensions reads them
    table = make_table(None, run.q, readings, orientation_measured=quaternion_of(torch.tensor(turns)).numpy())
    return build_problem(file, table), link


def test_positions_alone_leave_the_wrist_open_and_orientations_close_it() -> None:
    problem, _ = measured()
    model = Model(problem.file) + make_effect(library(), "dh-offsets")
    bare, fitted = fit(Model(problem.file), problem), fit(model, problem)
    before, alone = orientation_of(bare, problem), orientation_of(fitted, problem)
    both = fit_poses(model, problem)
    assert before is not None and alone is not None and both.status == "converged"
    assert before.rms_mrad > 0.5
    assert both.orientation.rms_mrad == pytest.approx(SIGMA_RAD * 3**0.5 * 1e3, rel=0.15)
    rms = np.sqrt(np.square(both.residual[problem.used]).sum(axis=1).mean())
    assert rms == pytest.approx(0.01 * 3**0.5, rel=0.15)


def test_the_tools_own_turn_is_taken_out_and_the_targets_place_found() -> None:
    problem, _ = measured()
    found = fit_poses(Model(problem.file) + make_effect(library(), "dh-offsets"), problem)
    # the place of the target and errors of the last joints are one thing to the data, hence the loose bound
    torch.testing.assert_close(torch.tensor(found.orientation.target), torch.tensor(TURN), rtol=0, atol=5e-3)


def test_pose_fit_predicts_unseen_poses() -> None:
    problem, link = measured()
    model = fit_poses(Model(problem.file) + make_effect(library(), "dh-offsets"), problem).model
    run = draw_arm(problem.file.machine, "none", 9, rows=60)
    rig = replace(run.rig, faults=replace(run.rig.faults, link=link), sigma_mm=0.0)
    fresh = build_problem(
        problem.file, make_table(None, run.q, rig.measure(run.q, 0 * run.payload_kg, run.temp_c * 0 + 20.0, 0))
    )
    left = fit(replace(model, terms=tuple(replace(t, fixed=frozenset(p.stem for p in t.effect.parameters))
                                          for t in model.terms)), fresh)  # fmt: skip
    assert np.sqrt(np.square(left.residual).sum(axis=1).mean()) < 0.03


def test_turn_columns_are_the_derivative_of_the_orientation() -> None:
    from ptt.fitting.orientation import _turn_columns

    file = load_machine(MACHINES / "ur10.toml")
    view = build_view(file, make_table(None, np.random.default_rng(0).uniform(-2, 2, (6, 6)), payload_kg=3.0))
    effects = [make_effect(library(), name) for name in ("axis-compliance", "dh-offsets")]
    thetas = [torch.full((size,), 1e-4, dtype=torch.float64) for size in (6, 30)]
    thetas[0] = thetas[0] * 1e-4
    terms = list(zip(effects, thetas, strict=True))
    columns = _turn_columns(terms, view, predict(terms, view))
    step = 1e-6

    def turned(index: int, by: float) -> torch.Tensor:
        moved = [theta.clone() for theta in thetas]
        which, place = (0, index) if index < 6 else (1, index - 6)
        moved[which][place] += by * (1e-4 if which == 0 else 1.0)
        at = predict(list(zip(effects, moved, strict=True)), view)
        return view.mechanism.pose(at.q, at.geometry)[1]  # type: ignore[attr-defined]

    for index in (1, 4, 6, 13, 20, 27):
        change = (turned(index, step) - turned(index, -step)) / (2.0 * step)
        turn = change @ turned(index, 0.0).mT
        numeric = torch.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], -1)
        scale = 1e-4 if index < 6 else 1.0
        torch.testing.assert_close(columns[..., index] * scale, numeric, rtol=2e-3, atol=1e-6)


def test_fit_report_tells_the_orientation_and_no_orientation_is_an_error() -> None:
    problem, _ = measured()
    fitted = fit(Model(problem.file), problem)
    report = report_fit(fitted, problem)
    assert report.orientation_mrad is not None and "mrad RMS" in format_fit(report)
    blind = build_problem(problem.file, replace(problem.table, orientation_measured=None))
    assert orientation_of(fit(Model(blind.file), blind), blind) is None
    with pytest.raises(TableError, match="no measured orientations"):
        fit_poses(Model(blind.file), blind)
