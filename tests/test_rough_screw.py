"""A screw that is rough is told as one, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter1d
from test_diagnosis import MACHINE

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table


def rough_screw(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Heights, and what a screw is off by there, mm: it drifts along its length and is wavy over a few millimetres."""
    random, height = np.random.default_rng(seed), np.arange(180.0, 380.0, 0.25)
    drift = gaussian_filter1d(random.normal(size=len(height)).cumsum(), 40)
    drift -= np.polyval(np.polyfit(height, drift, 1), height)
    waves = gaussian_filter1d(random.normal(size=len(height)), 10)
    return height, 0.01 * drift / drift.std() + 0.004 * waves / waves.std()


@pytest.mark.parametrize("lasts", [2, 3])
def test_scatter_that_a_few_rows_share_is_no_noise_of_a_tracker(lasts):
    """A reflector that is seated anew every few rows, four times as far off as the noise that is stated."""
    random, mechanism = np.random.default_rng(lasts), build_mechanism(MACHINE.machine)
    targets = random.uniform(-60.0, 60.0, (120, 3))
    command = mechanism.inverse(torch.as_tensor(targets)).numpy()
    seat = np.repeat(random.normal(0.0, 0.016, (120 // lasts, 3)), lasts, axis=0)
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"sigma_mm": 0.004}))
    measured = targets + seat + random.normal(0.0, 0.004, targets.shape)
    table = make_table(targets, command, measured=measured, time_s=5.0 * np.arange(120))
    assert diagnose(Model(file), build_problem(file, table)).verdict == "unknown"


def told_of_screws(off) -> Diagnosis:
    """What is said of 240 poses of a machine whose screws are off by a function of their heights (n, 3), mm."""
    random, mechanism = np.random.default_rng(4), build_mechanism(MACHINE.machine)
    targets = random.uniform(-60.0, 60.0, (240, 3))
    command = mechanism.inverse(torch.as_tensor(targets)).numpy()
    reached = mechanism.forward(torch.as_tensor(command + off(command))).numpy()
    measured = reached + random.normal(0.0, 0.003, (240, 3))
    return diagnose(Model(MACHINE), build_problem(MACHINE, make_table(targets, command, measured=measured)))


def test_a_rough_screw_is_a_screw_and_nothing_else():
    found = told_of_screws(lambda q: np.stack([np.interp(q[:, i], *rough_screw(i)) for i in range(3)], axis=1))
    assert found.verdict == "missing" and found.suggested == (("screw-error-map",),)


def test_one_screw_ground_in_stretches_is_a_rough_screw_and_no_unknown_of_its_own():
    """Leads that differ from stretch to stretch by some mm a metre, as a thread that was ground in several passes."""
    random = np.random.default_rng(5)
    ends = np.concatenate([[180.0], np.sort(random.uniform(200.0, 360.0, 6)), [380.0]])
    off = np.concatenate([[0.0], np.cumsum(random.normal(0.0, 2e-3, 7) * np.diff(ends))])
    off -= np.polyval(np.polyfit(ends, off, 1), ends)
    found = told_of_screws(lambda q: np.interp(q, ends, off) * [1.0, 0.0, 0.0])
    assert found.verdict == "missing" and found.suggested == (("screw-error-map",),)
    assert found.rms_um["after"]["total"] < 1.05 * 3.0 * np.sqrt(3.0) < 0.1 * found.rms_um["before"]["total"]


@pytest.mark.parametrize(
    ("damage", "shape"),
    [
        (lambda q: 0.02 * (q > 290.0), "step"),
        pytest.param(lambda q: 0.04 * np.exp(-np.square((q - 300.0) / 3.0)), "bump", marks=pytest.mark.long),
    ],
)
def test_a_splice_or_a_spot_of_one_screw_is_no_rough_screw(damage, shape):
    found = told_of_screws(lambda q: damage(q) * [1.0, 0.0, 0.0])
    assert found.verdict == "unknown" and found.suggested == ()
    first = found.depends_on[0]
    assert (first.residual, first.on, first.shape) == ("slider 1", "b1", shape)


def test_a_period_that_is_no_turn_of_the_screw_is_no_rough_screw():
    found = told_of_screws(lambda q: 0.012 * np.sin(2.0 * np.pi * q / 7.0) * [1.0, 0.0, 0.0])
    assert found.verdict == "unknown" and found.suggested == ()
    assert found.depends_on[0].residual == "slider 1" and found.depends_on[0].period_mm == pytest.approx(7.0, abs=0.1)
