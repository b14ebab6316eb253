"""Sums of chunks, gains that are predicted, and innovations of a wander."""

import numpy as np
import pytest

from ptt.diagnosis.noise.wander import Clock, Wander, innovations
from ptt.fitting.projected import gain, project


def test_projected_gain_is_what_a_fit_gains():
    random = np.random.default_rng(2)
    columns, values = random.normal(size=(240, 7)), random.normal(size=240)
    first, second = np.arange(4), np.arange(4, 7)
    took = gain(project(columns.T @ columns, columns.T @ values, float(values @ values), first), second)
    left = [np.linalg.lstsq(columns[:, chosen], values)[1].item() for chosen in (first, np.arange(7))]
    assert took == pytest.approx(left[0] - left[1], rel=1e-9)


def test_innovations_of_no_columns_are_none_and_lapack_is_not_asked(monkeypatch):
    """Of zero columns LAPACK solves for the first one all the same, in memory that belongs to somebody else."""
    monkeypatch.setattr("ptt.diagnosis.noise.gains.lapack.dgtsv", lambda *args, **options: pytest.fail("asked"))
    clock = Clock(np.arange(40.0), np.arange(40) == 0)
    assert innovations(np.zeros((40, 3, 0)), Wander(0.5, 10.0), clock)[0].shape == (40, 3, 0)


def test_innovations_of_a_wander_are_white_and_cost_its_determinant():
    random = np.random.default_rng(4)
    time = np.cumsum(random.uniform(5.0, 40.0, 400))
    clock = Clock(time, np.arange(400) % 150 == 0)
    wander = Wander(4.0, 900.0)
    run = np.cumsum(clock.starts)
    alike = np.where(run[:, None] == run, 4.0 * np.exp(-np.abs(time[:, None] - time) / 900.0), 0.0)
    covariance = alike + np.eye(400)
    values = np.linalg.cholesky(covariance) @ random.normal(size=(400, 3))
    white, log_noise = innovations(values, wander, clock)
    assert np.square(white).sum() == pytest.approx(np.einsum("ia,ij,ja->", values, np.linalg.inv(covariance), values))
    assert log_noise == pytest.approx(1.5 * np.linalg.slogdet(covariance)[1])
    assert abs(np.mean(white[1:] * white[:-1])) < 0.08
