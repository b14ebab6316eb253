"""The chances and spectra that a dependence is judged by."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ptt.dependence.chance import gumbel_tail, minus_log_p, slow_excess
from ptt.dependence.periods import periodogram, refine_frequency, trial_frequencies
from ptt.dependence.strata import find_poses, whiten

SIGMA = 0.005


def test_log_chances_agree_with_the_beta_distribution() -> None:
    from scipy import stats

    for dims, freedom in ((1, 40), (2, 290), (7, 120)):
        share = np.array([0.01, 0.05, 0.1, 0.5, 0.8])
        exact = -stats.beta(dims / 2, freedom / 2).logsf(share)
        np.testing.assert_allclose(minus_log_p(share, dims, freedom), exact, rtol=1e-3, atol=1e-3)
    deep = minus_log_p(np.array([0.99, 0.999]), 1, 3000)  # chance below what a float can hold
    assert np.isfinite(deep).all()
    assert deep[1] > deep[0] > 5000.0


@settings(max_examples=30, deadline=None)
@given(st.floats(0.5, 3.0), st.floats(0.0, 20.0))
def test_gumbel_tail_is_a_falling_chance(scale: float, place: float) -> None:
    largest = place + scale * np.random.default_rng(0).gumbel(size=200)
    tail = gumbel_tail(np.linspace(place - 5.0, place + 60.0, 40), largest)
    assert ((tail >= 0.0) & (tail <= 1.0)).all()
    assert (np.diff(tail) <= 0.0).all()


def test_white_noise_is_rarely_slow_and_drift_always() -> None:
    random = np.random.default_rng(1)
    white = [slow_excess(random.normal(size=300), 10).max() > 0 for _ in range(200)]
    drift = [slow_excess(np.cumsum(random.normal(size=300)), 10).max() > 5 for _ in range(50)]
    assert np.mean(white) < 0.06
    assert all(drift)


def test_whitening_gives_poses_the_weight_of_their_independent_rows() -> None:
    """Covariance of whitened nested errors is a multiple of the identity, by 2000 draws."""
    random = np.random.default_rng(8)
    group = np.repeat(np.arange(6), [1, 2, 3, 4, 1, 5])
    draws = 0.5 * random.normal(size=(16, 20000)) + 1.5 * random.normal(size=(6, 20000))[group]
    poses = find_poses(np.column_stack([draws[:, 0]]), group)
    true = type(poses)(poses.number, poses.first, poses.size, 9.0)
    covariance = np.cov(whiten(draws, true, means=False)) / 0.25
    np.testing.assert_allclose(covariance, np.eye(16), atol=0.06)


def test_a_few_rounded_repeats_say_nothing_of_what_poses_share() -> None:
    """A datum read five times to the same hundredth does not make every other row worth nothing beside its visits."""
    random = np.random.default_rng(2)
    readings = np.round(0.008 * random.normal(size=(70, 3)), 2)
    group = np.arange(70)
    group[[0, 16, 32, 48, 64]] = 0
    readings[[0, 16, 32, 48, 64]] = [
        [0.0, 0.0, 0.01],
        [0.0, 0.01, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
    ]
    assert find_poses(readings, group).ratio == 0.0
    shared = np.repeat(0.02 * random.normal(size=(35, 3)), 2, axis=0) + 0.002 * random.normal(size=(70, 3))
    assert find_poses(shared, np.arange(70) // 2).ratio > 10.0


def test_periodogram_finds_a_line_between_trials_and_knows_noise() -> None:
    random = np.random.default_rng(3)
    height = random.uniform(200.0, 340.0, 300)
    error = 0.008 * np.cos(2.0 * np.pi * height / 7.31 + 0.4) + SIGMA * random.normal(size=300)
    lines = periodogram(height, error)
    assert lines.share.max() > lines.chance
    assert 1.0 / refine_frequency(height, error, 1.0 / lines.best) == pytest.approx(7.31, rel=2e-3)
    quiet = [periodogram(height, random.normal(size=300)) for _ in range(60)]
    assert np.mean([item.share.max() > item.chance for item in quiet]) < 0.06
    assert not len(trial_frequencies(np.arange(10.0)))
