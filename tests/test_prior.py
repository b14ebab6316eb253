"""Sizes learned by the fit: what the rows see is released however large, what they do not see is held."""

from dataclasses import replace
from pathlib import Path

import drawings
import numpy as np
import pytest

from ptt.effects import library
from ptt.fitting.observability import unobservable
from ptt.fitting.solve import fit, residual_of
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.rig.draw_arm import draw_arm
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROOT = Path(__file__).resolve().parents[1]
SIGMA = 0.01


@pytest.mark.parametrize("seed", [0, pytest.param(6, marks=pytest.mark.long)])
def test_a_drawing_off_by_centimetres_is_put_right_to_the_noise(seed: int) -> None:
    score = drawings.run(seed)
    assert score.good, score
    assert score.worst < 4.0 and score.before > 1000.0


def arm(fault: str, seed: int, rows: int, name: str = "kuka_iiwa") -> Problem:
    """A short run of an arm, which does not tell what else is wrong with it."""
    file = load_machine(ROOT / "data" / "machines" / f"{name}.toml")
    tracker = file.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": "fitted", "tool": "fitted"})
    run = draw_arm(file.machine, fault, seed, rows=rows, sigma_mm=SIGMA)
    return build_problem(replace(file, tracker=tracker), make_table(None, run.q, measured=run.readings))


def held_out(problem: Problem, *names: str) -> float:
    """Error of five parts of the run, each told by the others, um."""
    part, squares = np.arange(problem.table.rows) * 5 // problem.table.rows, []
    model = Model(problem.file)
    for name in names:
        model = model + library()[name]()
    for index in range(5):
        rest = problem.masked(part == index)
        fitted = fit(model, rest, lean=True) if names else residual_of(model, rest)
        squares.append(np.square(fitted.residual[part == index]).sum(axis=1))
    return float(np.sqrt(np.concatenate(squares).mean()) * 1e3)


@pytest.mark.parametrize(("fault", "seed"), [("none", 1), ("none", 4), ("compliance", 1)])
def test_links_fitted_on_a_short_run_that_does_not_show_them_spoil_little(fault: str, seed: int) -> None:
    problem = arm(fault, seed, 25)
    assert held_out(problem, "dh-offsets") < 1.2 * held_out(problem)


def test_links_that_a_short_run_shows_are_found() -> None:
    problem = arm("link", 1, 25)
    assert held_out(problem, "dh-offsets") < 0.05 * held_out(problem)


def homed(offset: tuple[float, float, float]) -> tuple[MachineFile, Problem]:
    """A bench whose sliders are homed wrong by millimetres."""
    rig, _, _ = drawings.build(1)
    wrong = rig.drive.model_copy(update={"homing_mm": offset})
    clean = rig.geometry.model_copy(update={"tower_radial_mm": (0.0, 0.0, 0.0), "link_mm": (0.0, 0.0, 0.0)})
    rig = replace(rig, drive=wrong, geometry=clean)
    targets = drawings.make_volume(drawings.ideal_machine(rig.spec), 60, 5)
    return rig.machine, build_problem(rig.machine, drawings.table_of(drawings.simulate(rig, targets).frame))


def test_a_gauge_stays_unmeasured_however_large_the_rest() -> None:
    file, problem = homed((8.0, -6.0, 4.0))
    result = fit(Model(file) + library()["homing-offset"](), problem)
    assert result.sizes[0] > 5.0 and result.unseen.shape[1] == 1
    assert not result.measured[:3].any()
    assert [item.what for item in unobservable(result)] == ["offset of all sliders together"]
    found = result.values[:3] - result.values[:3].mean()
    error = found - (np.array([8.0, -6.0, 4.0]) - 2.0)
    onto = np.eye(3) - 1.0 / 3.0
    std = np.sqrt(np.diag(onto @ result.covariance[:3, :3] @ onto))
    assert np.abs(error / std).max() < 4.0 and std.max() < 0.05
    assert (result.std[:3] > 20 * std).all()  # what the prior holds has the prior's


def test_a_parameter_that_the_rows_do_not_need_stays_small_and_its_error_is_the_rows_own() -> None:
    file, problem = homed((0.0, 0.0, 0.0))
    result = fit(Model(file) + library()["link-length"](), problem)
    own = result.layout.owner == 0
    assert np.abs(result.values[own] / result.std[own]).max() < 3.0
    assert (result.sizes[own] == 1.0).all() and (result.prior.variance[own] < 0.5).all()
    free = np.linalg.inv(result.information)  # least squares, no prior at all
    np.testing.assert_allclose(result.std[own], np.sqrt(np.diag(free))[own] * result.layout.scale[own], rtol=0.15)
