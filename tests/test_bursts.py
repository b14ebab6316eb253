"""Broken beams that follow each other: no knock, slip or jump that undo one another, no wander and no unknown."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_runs import empty_run, machine

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.search.bursts import lost_rows
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

ROWS, NOISE, EVERY = 100, 0.0014, 3.3  # rows, mm, s
GAP, DRIFT, BEND = np.array([0.045, 0.13, 0.09]), np.array([0.076, 0.009, -0.046]), np.array([-0.001, 0.0037, 0.0])
NAMES = {"backlash", "tracker-drift", "column-bend"}


def behind(sent: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Where sliders with play are that came from below, (n, 3) mm."""
    at, there = sent[0] - gap / 2.0, []
    for command in sent:
        at = np.clip(at, command - gap / 2.0, command + gap / 2.0)
        there.append(at)
    return np.array(there)


def told_of(seed: int, broken: range, size: tuple[float, float], machine_is_off: bool = True) -> Diagnosis:
    """Play, a drift and a column that bends, or a sound machine, with some readings to every side of the truth."""
    random, file = np.random.default_rng(seed), bench()
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE}))
    robot = build_mechanism(file.machine)
    target = random.uniform([-60.0, -60.0, -45.0], [60.0, 60.0, 45.0], (ROWS, 3))
    sent = robot.inverse(torch.as_tensor(target)).numpy()
    time, load = EVERY * np.arange(ROWS), random.choice([0.0, 2.7, 6.9], ROWS)
    read = target + random.normal(0.0, NOISE, target.shape)
    if machine_is_off:
        read += robot.forward(torch.as_tensor(behind(sent, GAP))).numpy() - target
        read += DRIFT * (1.0 - np.exp(-time / 160.0))[:, None] + load[:, None] * BEND
    for row in broken:
        side = random.normal(size=3)
        read[row] += random.uniform(*size) * side / np.linalg.norm(side)
    table = replace(make_table(target, sent, time_s=time), measured=read, payload_kg=load)
    return diagnose(Model(file), build_problem(file, table))


@pytest.mark.parametrize(
    ("seed", "broken"), [pytest.param(1, range(94, 96), marks=pytest.mark.long), (2, range(96, 99))]
)
def test_broken_beams_in_a_row_are_gross_errors_beside_larger_faults(seed: int, broken: range) -> None:
    """Play of 0.1 mm hides errors of 0.1 to 0.25 mm at first; a slip and two knocks then explain two of them."""
    found = told_of(seed, broken, (0.08, 0.25))
    assert found.verdict == "missing" and {step[0] for step in found.suggested} == NAMES
    assert found.outliers[list(broken)].all() and found.outliers.sum() <= len(broken) + 2


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_they_are_gross_errors_of_a_sound_machine_too(seed: int) -> None:
    found = told_of(seed, range(40, 42), (0.05, 0.1), machine_is_off=False)
    assert found.verdict == "nothing-missing" and set(np.flatnonzero(found.outliers)) == {40, 41}


@pytest.mark.parametrize("apart", [-2, 3])
def test_a_broken_beam_next_to_a_knock_is_a_gross_error(apart: int) -> None:
    """Two moments within a few rows, one of which did happen: beside it alone one reading is far off."""
    random, file, knock = np.random.default_rng(5), bench(), 60
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE}))
    robot = build_mechanism(file.machine)
    target = random.uniform([-60.0, -60.0, -45.0], [60.0, 60.0, 45.0], (ROWS, 3))
    read = target + random.normal(0.0, NOISE, target.shape)
    read[knock:] += np.cross([4e-4, -2e-4, 3e-4], target[knock:])
    read[knock:] += [0.02, -0.03, 0.01]
    read[knock + apart] += [0.7, -0.8, 0.5]
    table = make_table(target, robot.inverse(torch.as_tensor(target)).numpy(), time_s=EVERY * np.arange(ROWS))
    found = diagnose(Model(file), build_problem(file, replace(table, measured=read)))
    assert (found.verdict, found.suggested) == ("missing", (("setup-jump",),))
    assert found.outliers[knock + apart] and found.outliers.sum() <= 2


@pytest.mark.parametrize(("rows", "lost"), [(slice(90, 98), True), (slice(172, 180), False), (slice(0, 8), False)])
def test_rows_with_which_a_run_begins_or_ends_may_have_slipped(rows: slice, lost: bool) -> None:
    table = empty_run(180)
    read = table.target + np.random.default_rng(3).normal(0.0, 0.004, (180, 3))
    read[rows, 2] += 5.0
    found = lost_rows(build_problem(machine(frame="trusted"), table.replace(measured=read)))
    assert np.flatnonzero(found).tolist() == (np.arange(180)[rows].tolist() if lost else [])
