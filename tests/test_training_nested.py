"""The held-out error of a training is that of the network that ships, judged on rows that had no part in any choice."""

import numpy as np
import pytest

from nets import RbfSettings
from ptt.correct.training.nested import hold_out
from ptt.correct.training.physics import fit_physics
from ptt.correct.training.protocols import random_protocol
from ptt.correct.training.rest import learn_rest
from ptt.correct.training.train import train
from ptt.fitting.result import sound_rows
from ptt.machine import MachineFile, parse_machine
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

SMALL = RbfSettings(centre_counts=(16, 32), spreads=(2.0, 4.0), restarts=1, folds=5)
RANDOM = np.random.default_rng(11)
PLACES = RANDOM.uniform(-40.0, 40.0, (260, 3))


@pytest.fixture(scope="module")
def trusted() -> MachineFile:
    text = (
        '[machine]\nkind = "three-ptt"\nbase_radius_mm = 200\nplatform_radius_mm = 100\nlink_length_mm = 300\n'
        'slider_travel_mm = [100, 480]\n[tracker]\nframe = "trusted"\nsigma_mm = 0.005\n'
    )
    return parse_machine(text, "m.toml")


def field(place: np.ndarray) -> np.ndarray:
    """What the machine does at a place, mm: smooth, on every axis."""
    x, y, z = place.T / 40.0
    return 0.2 * np.column_stack([np.sin(2.0 * x) * y, np.cos(2.0 * y) * x, np.sin(x + y + z)])


def run_of(
    file: MachineFile, sigma: tuple[float, float, float], seed: int = 0, turned: np.ndarray | None = None
) -> Problem:
    error = field(PLACES) + np.random.default_rng(seed).normal(0.0, sigma, PLACES.shape)
    if turned is not None:
        error[turned] *= -1.0
    return build_problem(file, make_table(PLACES, measured=PLACES + error))


def test_an_axis_read_worse_than_the_others_does_not_spoil_their_figures(trusted: MachineFile) -> None:
    """The tracker reads y forty times worse, so y needs a far stronger penalty than x and z."""
    sigma = (0.002, 0.08, 0.002)
    problem = run_of(trusted, sigma)
    trained = train(Model(trusted), problem, settings=SMALL, protocol=random_protocol(problem, folds=4))
    assert trained.rbf.ridges[1] > 100.0 * trained.rbf.ridges[0]
    fresh = np.random.default_rng(99).uniform(-38.0, 38.0, (2000, 3))
    fresh = fresh[trained.rbf.network.inside(fresh)]
    missed = field(fresh) + trained.rbf.network.predict(fresh)
    told = trained.heldout_um["rbf"]
    for index, axis in ((0, "x"), (2, "z")):
        true = 1e3 * np.sqrt(np.mean(missed[:, index] ** 2) + sigma[index] ** 2)
        assert 0.5 * true < told[axis] < 2.0 * true, axis
    assert told["x"] < 0.3 * trained.heldout_um["physics"]["x"]


def test_rows_that_are_judged_have_no_part_in_any_choice(trusted: MachineFile) -> None:
    """Whatever the hidden rows read, the network that is judged on them is the same."""
    one = run_of(trusted, (0.003, 0.003, 0.003))
    protocol = random_protocol(one)
    two = run_of(trusted, (0.003, 0.003, 0.003), turned=protocol.folds[0])
    steps = []
    for problem in (one, two):
        fitted = fit_physics(Model(trusted), problem)
        network = learn_rest(problem, fitted, sound_rows(problem, fitted), protocol.groups, SMALL)
        assert network.learned.all()
        held = hold_out(Model(trusted), problem, protocol, {"tool": network}, SMALL)
        steps.append((held.whole - held.physics)[protocol.folds[0]])
        assert np.abs(steps[-1]).max() > 0.05
    np.testing.assert_allclose(steps[0], steps[1], rtol=0.0, atol=1e-12)


def test_settings_tried_in_plenty_do_not_flatter_noise(trusted: MachineFile) -> None:
    """Of pure noise nothing can be held out: the figure must not fall below the noise itself."""
    wide = RbfSettings(
        centre_counts=(4, 8, 16, 32), spreads=(0.5, 1.0, 2.0, 4.0), restarts=1, folds=5, null_candidate=False
    )
    gains = []
    for seed in range(4):
        error = np.random.default_rng(seed).normal(0.0, 0.01, PLACES.shape)
        problem = build_problem(trusted, make_table(PLACES, measured=PLACES + error))
        protocol = random_protocol(problem, folds=3)
        fitted = fit_physics(Model(trusted), problem)
        network = learn_rest(problem, fitted, sound_rows(problem, fitted), protocol.groups, wide)
        figures = hold_out(Model(trusted), problem, protocol, {"tool": network}, wide).rms_um()
        gains.append(figures["rbf"]["total"] / figures["physics"]["total"])
    assert np.mean(gains) > 0.995


@pytest.mark.parametrize("seed", [2, 7])
def test_what_helps_no_row_that_was_held_out_is_not_delivered(trusted: MachineFile, seed: int) -> None:
    """A slow wander of the readings looks like something to learn wherever the path lingers, and helps nowhere else."""
    random = np.random.default_rng(seed)
    steps = random.normal(0.0, 1.0, (len(PLACES), 3))
    wander = np.zeros_like(steps)
    for row in range(1, len(steps)):
        wander[row] = 0.97 * wander[row - 1] + 0.004 * steps[row]
    path = PLACES[np.lexsort((PLACES[:, 1], np.round(PLACES[:, 0] / 12.0)))]
    problem = build_problem(trusted, make_table(path, measured=path + wander + random.normal(0.0, 0.003, path.shape)))
    trained = train(Model(trusted), problem, settings=SMALL)
    assert not trained.rbf.learned.any() and not trained.rbf.network.predict(path).any()
    assert trained.heldout_um["rbf"] == trained.heldout_um["physics"]
