"""Rows that err alike because they were read one soon after the other tell less than as many independent ones."""

import numpy as np
import pytest

from ptt.effects import library
from ptt.fitting.autocorrelation import Times, autocorrelation_of, excess_scatter
from ptt.fitting.solve import fit
from ptt.machine import MachineFile
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table

ROWS, STEP, CONSTANT = 160, 10.0, 150.0
SWAY = np.array([0.004, -0.002])  # mm/kg, x and y
KNOWN = library()


def wander(random: np.random.Generator, rows: int = ROWS, step: float = STEP) -> np.ndarray:
    """An Ornstein-Uhlenbeck walk of variance 1 in each axis."""
    keep, walk = np.exp(-step / CONSTANT), np.empty((rows, 3))
    walk[0] = random.normal(size=3)
    for row in range(1, rows):
        walk[row] = keep * walk[row - 1] + np.sqrt(1.0 - keep**2) * random.normal(size=3)
    return walk


def pulls(bench: MachineFile, seed: int, slow: float) -> np.ndarray:
    """(fitted - true)/stated of the sway of a column whose load changes every 40 rows."""
    random = np.random.default_rng(seed)
    target, load = random.uniform(-60.0, 60.0, (ROWS, 3)), np.repeat([0.0, 4.0, 0.0, 4.0], ROWS // 4)
    noise = 0.004 * (slow * wander(random) + np.sqrt(1.0 - slow**2) * random.normal(size=(ROWS, 3)))
    bent = np.column_stack([load[:, None] * SWAY, np.zeros(ROWS)])
    table = make_table(target, None, target + bent + noise, payload_kg=load, time_s=STEP * np.arange(ROWS))
    found = fit(
        Model(bench) + KNOWN["column-bend"](), build_problem(bench, table), noise=Noise(np.eye(3) * 0.004**2, "told")
    )
    (term,) = found.model.terms
    return np.asarray((term.theta[:2].numpy() - SWAY) / term.std[:2].numpy())


@pytest.mark.parametrize("slow", [0.0, 0.8])
def test_stated_errors_hold_whether_the_tracker_wanders_or_not(bench: MachineFile, slow: float) -> None:
    """Taken as independent, rows under this wander state pulls of 2.4 rms, four in ten beyond two standard errors."""
    size = np.abs(np.concatenate([pulls(bench, seed, slow) for seed in range(20)]))
    assert 0.7 < np.sqrt(np.mean(size**2)) < 1.5
    assert np.mean(size <= 2.0) >= 0.85


def test_independent_rows_are_left_alone() -> None:
    times = Times(STEP * np.arange(ROWS), np.zeros(ROWS))
    heard = [autocorrelation_of(np.random.default_rng(seed).normal(size=(ROWS, 3)), times) for seed in range(100)]
    assert sum(told is not None for told in heard) <= 3


def test_what_lasts_is_found_in_the_axis_that_has_it_and_not_across_runs() -> None:
    random = np.random.default_rng(3)
    left = random.normal(size=(600, 3))
    left[:, 2] += 2.0 * wander(random, 600)[:, 2]
    told = autocorrelation_of(left, Times(STEP * np.arange(600), np.zeros(600)))
    assert told is not None and CONSTANT / 3.0 < told.constant < 3.0 * CONSTANT
    assert 2.0 < told.variance[2] < 6.0 and told.variance[:2].max() < 0.5
    assert autocorrelation_of(left, Times(STEP * np.arange(600), np.arange(600))) is None


def test_the_excess_is_that_of_the_whole_covariance_matrix() -> None:
    random = np.random.default_rng(5)
    left, columns = random.normal(size=(80, 3)) + 2.0 * wander(random, 80), random.normal(size=(80, 3, 4))
    times = Times(np.sort(random.uniform(0.0, 800.0, 80)), np.repeat([0, 1], 40))
    told, more = autocorrelation_of(left, times), excess_scatter(columns, left, times, np.zeros((4, 4)), 100.0)
    assert told is not None and more is not None
    gap = np.abs(times.time[:, None] - times.time)
    alike = np.exp(-gap / told.constant) * (times.run[:, None] == times.run) - np.eye(80)
    whole = sum(told.variance[axis] * columns[:, axis].T @ alike @ columns[:, axis] for axis in range(3))
    np.testing.assert_allclose(more, whole, rtol=1e-9, atol=1e-9)


def test_an_axis_that_alone_scatters_widely_leaves_a_covariance() -> None:
    """What is taken off as counted is never more than was: a parameter of alternating signs had no variance left."""
    random = np.random.default_rng(7)
    left = random.normal(size=(200, 3)) * [1.0, 1.0, 0.1]
    left[:, 2] += 6.0 * wander(random, 200)[:, 2]
    columns = np.zeros((200, 3, 1))
    columns[::2, 2], columns[1::2, 2] = 1.0, -1.0
    solved, scatter = np.array([[1.0 / 200.0]]), float((left**2).mean())
    more = excess_scatter(columns, left, Times(STEP * np.arange(200), np.zeros(200)), solved, scatter)
    assert more is not None
    assert (scatter * solved + solved @ more @ solved)[0, 0] > 0.0
