"""Frames that are registered as a run begins: what is off by the same in all of it is no wander of the tracker."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.noise.wander import Clock
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.machine_schema import TrackerSpec
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SIGMA = 0.004  # mm, one coordinate
STEP = 10.0  # s from row to row


def told(shift: float, wander: float, rows: int = 200, seed: int = 0) -> Diagnosis:
    """Of a sound machine in a trusted frame, off by some mm to one side, under a wander of a stand of so many mm."""
    random = np.random.default_rng([seed, 5])
    target, slow = random.uniform(-50.0, 50.0, (rows, 3)), np.zeros((rows, 3))
    keep = np.exp(-STEP / 600.0)
    for row in range(1, rows):
        slow[row] = keep * slow[row - 1] + np.sqrt(1.0 - keep**2) * random.normal(0.0, wander, 3)
    side = random.normal(size=3)
    read = target + slow + shift * side / np.linalg.norm(side) + random.normal(0.0, SIGMA, (rows, 3))
    file = replace(bench(), tracker=TrackerSpec(frame="trusted"))
    table = make_table(target, time_s=STEP * np.arange(rows), measured=read)
    return diagnose(Model(file), build_problem(file, table))


@pytest.mark.parametrize("seed", [0, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("times", [4.0, pytest.param(12.0, marks=pytest.mark.long)])
def test_a_constant_that_no_wander_shows_is_not_the_wander_s(times: float, seed: int) -> None:
    """One that lasts four times as long as the run could be off by it from the first row on."""
    found = told(times * np.sqrt(3.0) * SIGMA, 0.0, seed=seed)
    assert found.verdict == "missing"
    assert {"tracker-frame", "tracker-scale"} & set(found.suggested[0])
    assert found.rms_um["after"]["total"] < 0.5 * found.rms_um["before"]["total"]


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.long)])
def test_a_wander_that_a_run_shows_is_met_with_silence(seed: int) -> None:
    assert told(0.0, SIGMA, seed=seed).verdict == "nothing-missing"


def test_rows_are_told_about_the_mean_of_their_own_run() -> None:
    clock = Clock(np.arange(5.0), np.array([True, False, True, False, False]), registered=True)
    left = np.arange(15.0).reshape(5, 3)
    about = clock.about_means(left)
    np.testing.assert_allclose(about[:2], left[:2] - left[:2].mean(axis=0))
    np.testing.assert_allclose(about[2:], left[2:] - left[2:].mean(axis=0))
