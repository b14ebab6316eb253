"""Slips and knocks where a frame, a run or a repeat could stand for them."""

from dataclasses import replace

import numpy as np
import pytest
from stated_bench import NOISE, run_of, stated, up_and_down

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.errors import TableError
from ptt.judge.ladder.climb import climb
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem


@pytest.mark.parametrize("frame", [pytest.param("fitted", marks=pytest.mark.long), "fitted-per-run"])
def test_a_slip_between_two_runs_is_placed_there(frame: str) -> None:
    """Not told as a wind-up that is never over, though the travel turns over where it slipped."""
    rows = 218
    run = np.repeat([0, 1], rows // 2)
    slip = np.where(run == 1, 0.14, 0.0)[:, None] * np.eye(3)[0]
    time = 5.0 * np.arange(rows) + 300.0 * run
    columns = {"run": run, "run_label": ("morning", "noon"), "time_s": time}
    problem = run_of(stated(frame), up_and_down(rows), slip, 7, **columns)
    found = diagnose(Model(problem.file), problem)
    assert "between run morning and run noon" in found.candidates[0].words
    assert found.verdict == "missing"
    assert [names[0] for names in found.suggested] == ["homing-slip"]
    moment = dict(zip(found.model.keys, found.model.terms, strict=True))["homing-slip"].theta[-1]
    assert time[rows // 2 - 2] <= float(moment) < time[rows // 2]
    ladder = climb(Model(problem.file), problem, [library()["homing-slip"]()])
    assert time[rows // 2 - 2] <= float(ladder.model.terms[0].theta[-1]) < time[rows // 2]


def test_a_slip_is_placed_between_runs_whose_clocks_start_anew() -> None:
    rows = 36
    run, target = np.repeat([0, 1], rows // 2), np.random.default_rng(5).uniform(-50.0, 50.0, (rows, 3))
    slip = np.where(run == 1, 0.14, 0.0)[:, None] * np.eye(3)[0]
    time = np.tile(5.0 * np.arange(rows // 2), 2)
    problem = run_of(stated(), target, slip, 7, run=run, run_label=("run 7", "noon"), time_s=time)
    found = diagnose(Model(problem.file), problem)
    assert found.suggested[0][0] == "homing-slip" and not found.outliers.any()
    assert "between run 7 and run noon" in found.candidates[0].words


def test_three_poses_tell_a_slip_where_no_frame_is_fitted() -> None:
    rows = 120
    target = np.tile([[0.0, 0.0, 0.0], [50.0, -20.0, 30.0], [-40.0, 30.0, -20.0]], (rows // 3, 1))
    slip = np.where(np.arange(rows) > 70, 0.09, 0.0)[:, None] * np.eye(3)[2]
    problem = run_of(stated("trusted"), target, slip, 4, time_s=5.0 * np.arange(rows))
    assert diagnose(Model(problem.file), problem).suggested == (("homing-slip",),)
    with pytest.raises(TableError, match="of 3 poses"):
        diagnose(Model(stated()), run_of(stated(), target, slip, 4, time_s=5.0 * np.arange(rows)))


def test_what_happened_once_is_listed_once() -> None:
    rows = 120
    target = np.random.default_rng(3).uniform(-50.0, 50.0, (rows, 3))
    slip = np.where(np.arange(rows) > 70, 0.09, 0.0)[:, None] * np.eye(3)[2]
    problem = run_of(stated(), target, slip, 4, time_s=5.0 * np.arange(rows))
    found = diagnose(Model(problem.file), problem)
    assert found.suggested == (("homing-slip",),)
    assert not any(one.effect.startswith("homing-slip[") for one in found.candidates)


def knocked(after: int, frame: str, *, runs: int = 1, rounds: int = 1) -> Problem:
    """Poses that are gone through so often, in so many runs, whose readings jump after a row."""
    rows = 240
    target = np.tile(np.random.default_rng(3).uniform(-60.0, 60.0, (rows // rounds, 3)), (rounds, 1))
    run, labels = np.repeat(np.arange(runs), rows // runs), tuple("abc"[:runs])
    problem = run_of(stated(frame), target, np.zeros((rows, 3)), 3, run=run, run_label=labels)
    moved = np.array([0.1, -1.0, 0.8]) + np.cross([-1.5e-3, -4e-3, 6e-3], problem.measured)
    read = problem.measured + np.where(np.arange(rows) > after, 1.0, 0.0)[:, None] * moved
    return build_problem(problem.file, replace(problem.table, measured=read))


def test_add_finds_a_knock_that_each_runs_own_frame_all_but_takes() -> None:
    """Few rows see it, and those by little of what it is: it is many times larger than knocks are."""
    problem = knocked(135, "fitted-per-run", runs=2)
    ladder = climb(Model(problem.file), problem, [library()["setup-jump"]()])
    assert float(ladder.model.terms[0].theta[-1]) == 135.0
    assert ladder.steps[-1].rms_um["total"] < 1.1 * 1e3 * NOISE * 3**0.5


def test_add_takes_no_knock_between_repeats_for_noise() -> None:
    problem = knocked(119, "fitted", rounds=4)
    problem = build_problem(replace(problem.file, tracker=bench().tracker), problem.table)
    assert problem.noise is not None and problem.noise.total > 0.1
    ladder = climb(Model(problem.file), problem, [library()["setup-jump"]()])
    assert ladder.noise_um["source"] == "repeats"
    assert ladder.noise_um["total"] == pytest.approx(1e3 * NOISE * 3**0.5, rel=0.15)
    assert ladder.steps[-1].heldout_rms_um["total"] < 1.1 * 1e3 * NOISE * 3**0.5
