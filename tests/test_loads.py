"""Sliders that err by what they bear: play, friction and yielding by the load on each, told, written and taken out."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from made_legs import drawing
from test_report_chinese import SAY

from ptt.dependence.contexts import loads_of, path_views, unit_of
from ptt.diagnosis.diagnose import Diagnosis, diagnose
from ptt.diagnosis.telling.verdict_words import depends
from ptt.effects.case import make_case
from ptt.effects.contract import check_acts
from ptt.effects.own import load_effects
from ptt.effects.prefilled import prefilled
from ptt.fitting.solve import fit
from ptt.machine import MachineFile
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import differentiate
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

SIGMA, KG = 0.003, 4.0  # mm, and of the platform
SIDE, HEIGHT = 120.0, 60.0  # mm: beyond the triangle of the joints, where the force of a link changes its sign

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]  # loads in N and directions of arrival -> errors in mm, (n, 3)


def rubbing(load: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Friction in proportion to what a slider bears, which a soft drive falls short by."""
    return -0.0012 * np.abs(load) * side


def yielding(load: np.ndarray, side: np.ndarray) -> np.ndarray:
    """The second screw's bearing gives way to a light load, and stiffens."""
    return np.array([0.0, 0.06, 0.0]) * np.sign(load) * np.sqrt(np.abs(load) / (KG * 9.80665))


def playing(load: np.ndarray, side: np.ndarray) -> np.ndarray:
    """The third nut has play, and rests on the flank that its load pushes it to."""
    return np.array([0.0, 0.0, 0.03]) * np.sign(load)


def bearing(law: Law, seed: int = 3, count: int = 260) -> Problem:
    """A machine whose sliders err by a law, at random places of which a quarter lie beyond the triangle."""
    spec = drawing(platform_mass_kg=KG)
    file, random = MachineFile(machine=spec), np.random.default_rng(seed)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": "trusted"}))
    robot = ThreePtt.from_spec(spec)
    middle = robot.forward(torch.full((1, 3), 320.0, dtype=torch.float64)).numpy()[0]
    places = middle + random.uniform(-1.0, 1.0, (count, 3)) * np.array([SIDE, SIDE, HEIGHT]) / 2.0
    sent = robot.inverse(torch.as_tensor(places)).numpy()
    side = np.sign(np.diff(sent, axis=0, prepend=sent[:1] - 1.0))
    reached = robot.forward(torch.as_tensor(sent + law(loads(robot, places), side))).numpy()
    return build_problem(file, make_table(None, sent, reached + random.normal(0.0, SIGMA, reached.shape)))


def loads(robot: ThreePtt, places: np.ndarray) -> np.ndarray:
    """Upward force by which the platform's weight moves each slider: balance of three links, solved pose by pose."""
    along = robot.link_vectors(torch.as_tensor(places)).numpy()  # from joint to joint of each leg
    along = along / np.linalg.norm(along, axis=2, keepdims=True)
    force = np.stack([np.linalg.solve(unit.T, [0.0, 0.0, -KG * 9.80665]) for unit in along])
    return force * along[:, :, 2]


def taken_out(problem: Problem, found: Diagnosis, folder: object) -> float:
    """What is left, um, with the effects that are written for an unknown."""
    written = prefilled("by-load", found.to_dict()["depends_on"])
    file = folder / "own.py"  # type: ignore[operator]
    file.write_text(written.text)
    known, model = load_effects(file), Model(problem.file)
    for name in written.names:
        assert check_acts(make_case(known[name](), "three-ptt", differentiate)) == ""
        model = model + known[name]()
    return 1e3 * float(np.sqrt(np.nanmean(np.square(fit(model, problem).residual).sum(axis=1))))


def test_the_load_on_a_slider_is_the_force_of_its_link_along_the_rail():
    problem = bearing(yielding)
    robot = ThreePtt.from_spec(problem.file.machine)
    found, own = loads_of(problem), loads(robot, problem.view.p.numpy())
    assert [*found] == ["force1", "force2", "force3"] and {unit_of(problem, name) for name in found} == {"N"}
    np.testing.assert_allclose(np.column_stack([*found.values()]), own, atol=1e-9)
    assert 0.05 < (own > 0.0).mean() < 0.2  # most of it hangs


def test_there_is_no_load_where_the_drawing_has_no_mass_and_a_column_of_that_name_is_the_user_s():
    problem = bearing(yielding)
    light = problem.file.machine.model_copy(update={"platform_mass_kg": 0.0})
    assert not loads_of(build_problem(replace(problem.file, machine=light), problem.table))
    own = np.arange(problem.view.rows)
    table = problem.table.replace(watched=("force2",), extra={"force2": tuple(map(str, own))})
    problem = build_problem(problem.file, table)
    assert [*loads_of(problem)] == ["force1", "force3"]
    np.testing.assert_array_equal(path_views(problem)["force2"], own)


@pytest.mark.parametrize(("law", "on"), [(yielding, "force2"), (playing, "force3")])
def test_a_slider_that_errs_by_its_load_is_told_by_it(law, on, tmp_path):
    problem = bearing(law)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.residual, first.on, first.acts_on, first.unit) == (f"slider {on[-1]}", on, f"slider {on[-1]}", "N")
    assert first.share > 0.9
    said = depends(first)
    assert f"the load on slider {on[-1]} ({on})" in said and "载荷" in SAY(said)
    assert taken_out(problem, found, tmp_path) < 1.3 * np.sqrt(3.0) * 1e3 * SIGMA


def test_friction_by_what_a_slider_bears_is_no_backlash(tmp_path):
    problem = bearing(rubbing)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    told = {(one.residual, one.on, one.size.along) for one in found.depends_on if one.size is not None}
    assert told == {(f"slider {leg}", f"direction{leg}", f"force{leg}") for leg in (1, 2, 3)}
    assert taken_out(problem, found, tmp_path) < 10.0  # of 54 um; a curve is a guess where nothing bears


def test_play_of_a_nut_has_the_step_where_its_load_changes_sides():
    found = diagnose(Model((problem := bearing(playing)).file), problem)
    size = found.depends_on[0].size
    assert size is not None and size.value == pytest.approx(0.06, abs=0.004)
