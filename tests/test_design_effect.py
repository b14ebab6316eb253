"""What a model misses alike at every repeat is one witness, and calls for no absurd sizes of what imitates it."""

from pathlib import Path

import numpy as np
import pytest

from ptt.effects.registry import library
from ptt.fitting.prior import design_effect_of
from ptt.fitting.solve import fit
from ptt.fleet.shares import BUCKETS, Share, buckets_of
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.reading import read_table

DATA = Path(__file__).parents[1] / "data"
NAMES = ("homing-offset", "lead-scale", "once-per-rev", "tower-position", "tower-tilt", "link-length", "windup")


def test_independent_rows_count_as_themselves() -> None:
    block = np.repeat(np.arange(10), 40)
    for seed in range(20):
        residual = np.random.default_rng(seed).normal(size=(400, 3))
        assert design_effect_of(residual, np.ones(400, dtype=bool), block) == 1.0


@pytest.mark.parametrize("sizes", [[40] * 10 + [0] * 4000, [200] * 2 + [10] * 20], ids=["most empty", "two large"])
def test_groups_that_are_empty_or_small_make_independent_rows_no_crowd(sizes: list[int]) -> None:
    block = np.repeat(np.arange(len(sizes)), sizes)
    block[-1] = len(sizes) - 1
    clustered = 0
    for seed in range(200):
        residual = np.random.default_rng(seed).normal(size=(len(block), 3))
        clustered += design_effect_of(residual, np.ones(len(block), dtype=bool), block) > 1.0
    assert clustered <= 10  # of three standard deviations, with the long tail of a chi-squared


def test_a_log_of_a_few_poses_is_no_crowd_because_most_buckets_are_empty() -> None:
    place, clustered = np.random.default_rng(1).uniform(-80.0, 80.0, (50, 3)).round(3), 0
    at = buckets_of(place)[np.arange(1000) % 50]
    nothing = (np.zeros((0, 0)), np.zeros(0), 0.0, 0), np.zeros(0)
    for seed in range(200):
        residual = np.random.default_rng(seed).normal(size=(1000, 3))
        columns = (*residual.T, np.square(residual).sum(axis=1), np.ones(1000))
        poses = np.stack([np.bincount(at, column, BUCKETS) for column in columns], axis=1)
        clustered += Share(*nothing, poses, np.zeros(3), 1000, (np.zeros(0, int), np.zeros(0))).design_effect > 1.0
    assert clustered <= 10


def test_a_miss_that_all_rows_of_a_block_share_counts_once() -> None:
    block = np.repeat(np.arange(10), 40)
    miss = np.random.default_rng(1).normal(size=(10, 3))[block]
    np.testing.assert_allclose(design_effect_of(miss, np.ones(400, dtype=bool), block), 40.0)


def test_rounds_of_one_path_that_miss_alike_are_few_witnesses() -> None:
    """Five kilograms bend the sample machine in ways that these effects are not; the path was driven seven times.

    Taken as seven times as many witnesses, the readings called for towers that stand 4.7 mm off (true: 0.25 at most).
    """
    file, known = load_machine(DATA / "machine_compensated.toml"), library()
    model = Model(file)
    for name in NAMES:
        model = model + known[name]()
    found = fit(model, build_problem(file, read_table(DATA / "experiment5.csv")))
    assert 2.0 < found.prior.design_effect < 7.0
    values = {term.effect.key: term.theta for term in found.model.terms}
    assert float(values["tower-position"].abs().max()) < 2.0
