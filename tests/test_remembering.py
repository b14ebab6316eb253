"""Readings that still tell from which side the joints came to a run: nobody knows it, so they name nothing."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.fitting.opening import remembering_rows, without_opening
from ptt.judge.ladder.climb import climb, descend
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

SIGMA, ROWS, HEIGHT, LENGTH = 0.003, 400, 0.03, 4.0
NOISE = Noise(SIGMA**2 * np.eye(3), "machine file")


def wound_up(height: float = HEIGHT) -> Term:
    return Term(library()["windup"](), torch.tensor([height] * 3 + [LENGTH] * 3, dtype=torch.float64))


def fine_path(height: float = HEIGHT) -> Problem:
    """A spiral of small steps on a machine that winds up, come to from the side that its second row does not show."""
    turn, radius = np.linspace(0.0, 9.0 * np.pi, ROWS), np.linspace(4.0, 45.0, ROWS)
    place = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 20.0 * np.sin(0.4 * turn)])
    file = bench_machine()
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA}))
    table = make_table(place, measured=place)
    view = build_problem(file, table).view
    other = replace(view, direction=torch.where(view.starts[:, None], -view.direction, view.direction))
    term = wound_up(height)
    reading = predict([(term.effect, term.theta)], other).reading.numpy()
    noisy = reading + np.random.default_rng(4).normal(0.0, SIGMA, reading.shape)
    return build_problem(file, replace(table, measured=noisy))


def test_a_drive_that_winds_up_alone_is_told_alone_from_whichever_side_the_run_began():
    problem = fine_path()
    found = diagnose(Model(problem.file), problem)
    assert found.suggested == (("windup",),) and found.verdict == "missing"
    assert found.opening.sum() > 3


def test_what_is_added_leaves_them_aside_as_well():
    problem = fine_path()
    ladder = climb(Model(problem.file), problem, [library()["windup"]()])
    assert ladder.steps[-1].heldout_rms_um["total"] < 1.15e3 * np.sqrt(3.0) * SIGMA
    assert [note for note in ladder.notes if "set aside: their direction of arrival" in note]
    np.testing.assert_allclose(ladder.model.terms[0].theta[:3], HEIGHT, rtol=0.1)


def test_what_is_removed_is_held_to_the_rows_that_stay_without_it():
    """Else the fall would be that of other rows."""
    problem = fine_path()
    without = descend(Model(problem.file) + wound_up(), problem, ["windup"])
    added = climb(Model(problem.file), problem, [library()["windup"]()])
    assert [note for note in without.notes if "set aside" in note]
    refitted, last = without.steps[-2].heldout_rms_um["total"], added.steps[-1].heldout_rms_um["total"]
    assert without.steps[-2].kind == "refit" and refitted == pytest.approx(last, rel=0.02)


def test_what_is_found_later_has_its_own_rows_left_aside():
    """Play is told first, and remembers a few rows; the wind-up that is told beside it a turn later remembers more."""
    problem = fine_path()
    table, term = (
        problem.table,
        Term(library()["backlash"](), torch.tensor([0.03, 0.03, 0.03, 1.0], dtype=torch.float64)),
    )
    view = replace(
        problem.view,
        direction=torch.where(problem.view.starts[:, None], -problem.view.direction, problem.view.direction),
    )
    reading = predict([(each.effect, each.theta) for each in (term, wound_up())], view).reading.numpy()
    noisy = reading + np.random.default_rng(5).normal(0.0, SIGMA, reading.shape)
    problem = build_problem(problem.file, replace(table, measured=noisy))
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing" and set(found.suggested) == {("backlash",), ("windup",)}
    assert not remembering_rows(found.model.terms, without_opening(problem, found.opening), found.noise).any()


def test_rows_tell_of_the_side_until_it_is_forgotten():
    problem = fine_path()
    told = remembering_rows([wound_up()], problem, NOISE)
    last = int(np.flatnonzero(told).max())
    travel = np.abs(np.diff(problem.view.q.numpy(), axis=0)).cumsum(axis=0)
    left = 2.0 * HEIGHT * np.exp(-travel[last] / LENGTH)  # what is remembered at the row behind the last one
    assert told[: last + 1].all() and 3 < last < 0.25 * ROWS
    assert 0.3 * SIGMA < np.linalg.norm(left) < 3.0 * SIGMA


@pytest.mark.parametrize("terms", [(), (wound_up(1e-4),), (Term(library()["homing-offset"](), torch.ones(3)),)])
def test_nothing_is_left_out_where_nothing_hangs_on_it(terms):
    assert not remembering_rows(terms, fine_path(), NOISE).any()


def test_what_is_left_out_dates_nothing():
    """A slip after readings that all are left out would be there all along."""
    problem, rows = fine_path(), np.arange(ROWS) < 30
    first = min(float(shape["after"]) for shape in library()["homing-slip"]().search(problem.view))
    later = without_opening(problem, rows)
    assert first < 30.0 and not later.used[rows].any() and later.used[~rows].all()
    assert min(float(shape["after"]) for shape in library()["homing-slip"]().search(later.view)) > 30.0
    assert without_opening(problem, 0 * rows > 0) is problem


def test_play_that_is_told_beside_an_unknown_is_tried_alone_as_it_bends():
    """One short step back within the play of a slider: a common unknown of the direction knows it, no tangent does."""
    random, file = np.random.default_rng(2), bench_machine()
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.004}))
    pose, side = random.uniform(-45.0, 45.0, (110, 3)), np.where(random.random(110) < 0.5, 1.0, -1.0)
    mechanism = build_mechanism(file.machine)
    before, there = (
        mechanism.inverse(torch.as_tensor(place)).numpy() for place in (pose + 6.0 * side[:, None] * [0, 0, 1.0], pose)
    )
    there[40, 1] = before[40, 1] - 0.06 * np.sign(before[40, 1] - there[39, 1])
    q = np.stack([before, there], 1).reshape(-1, 3)
    place = mechanism.forward(torch.as_tensor(q)).numpy()
    table = make_table(place, command=q, measured=place)
    play = torch.tensor([0.22, 0.19, 0.16, 1.0], dtype=torch.float64)
    reading = predict([(library()["backlash"](), play)], build_problem(file, table).view).reading.numpy()
    noisy = reading + random.normal(0.0, 0.004, reading.shape)
    noisy[0::2] = np.nan  # on the way to each pose
    found = diagnose(Model(file), build_problem(file, replace(table, measured=noisy)))
    assert found.suggested == (("backlash",),) and found.verdict == "missing"
    torch.testing.assert_close(found.model.terms[0].theta, play, atol=0.005, rtol=0.0)
