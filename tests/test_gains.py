"""The filter of a wander and its adjoint, and errors of poses beside it, against dense matrices."""

import numpy as np
import pytest

from ptt.diagnosis.noise.gains import filter_back, filter_rows, gains_of
from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.noise.wander import Clock, Wander


@pytest.mark.parametrize("rows", [1, 16, 17, 75])
def test_the_adjoint_takes_a_product_to_the_other_side(rows: int) -> None:
    random = np.random.default_rng(rows)
    decay = np.exp(-random.uniform(0.0, 0.5, rows))
    decay[0] = 0.0
    gains = gains_of(3.0, decay, np.ones(rows))
    series, other = random.normal(size=(2, 4, rows))
    white = np.empty_like(series)
    filter_rows(series, gains, white)
    np.testing.assert_allclose((white * other).sum(axis=1), (series * filter_back(other, gains)).sum(axis=1), rtol=1e-9)


def test_errors_of_poses_beside_a_wander_have_the_covariance_of_both() -> None:
    """Their share of any series is what a dense covariance of wander, pose errors and white noise takes off."""
    random = np.random.default_rng(3)
    pose, time = np.repeat(np.arange(8), 3)[random.permutation(24)], np.cumsum(random.uniform(1.0, 3.0, 24))
    clock, wander, size = Clock(time, np.arange(24) == 0), Wander(2.0, 15.0), 1.7
    rows = random.normal(size=(3, 24))
    white = np.empty_like(rows)
    filter_rows(rows, clock.gains(wander.share, wander.constant), white)
    beside = poses_of(pose).beside(wander, clock)
    share, half_log_det = beside.share(size)
    left = np.square(white).sum() - (share * np.square(beside.means(white).ravel())).sum()
    drift = wander.share * np.exp(-np.abs(time[:, None] - time) / wander.constant) + np.eye(24)
    whole = drift + size * (pose[:, None] == pose)
    np.testing.assert_allclose(left, np.einsum("ai,ij,aj->", rows, np.linalg.inv(whole), rows), rtol=1e-9)
    grown = np.linalg.slogdet(whole)[1] - np.linalg.slogdet(drift)[1]
    np.testing.assert_allclose(half_log_det, 1.5 * grown, rtol=1e-9)
