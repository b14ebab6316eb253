"""What a row's speed means is asked again once play is told: with play still in the readings another looks better."""

import numpy as np
import pytest
import torch
from scipy.interpolate import CubicSpline

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import Table, make_table

MACHINE = bench()
MECHANISM = build_mechanism(MACHINE.machine)
ROWS, FEEDS, RADIUS = 40, (50.0, 20.0, 8.0), 2.0


def circles(gap: np.ndarray, lag: np.ndarray, start: float) -> Table:
    """Three small circles, each slower than the one before: sliders lag behind smooth moves, nuts behind their screws.

    Args:
        gap: of each slider's play, (3,) mm.
        lag: of each slider, (3,) s.
        start: angle of the first row, rad.
    """
    angle = start + 2.0 * np.pi * np.arange(ROWS) / ROWS
    target = np.tile(RADIUS * np.stack([np.cos(angle), np.sin(angle), np.zeros(ROWS)], axis=1), (len(FEEDS), 1))
    sent, feed = MECHANISM.inverse(torch.as_tensor(target)).numpy(), np.repeat(FEEDS, ROWS)
    way = np.linalg.norm(np.diff(target, axis=0, prepend=target[:1]), axis=1)
    time = np.cumsum(np.maximum(way / feed, 1e-9))
    speed, nut = np.zeros_like(sent), np.zeros_like(sent)
    for number in range(len(FEEDS)):
        first = max(number * ROWS - 1, 0)
        rows = np.arange(first, (number + 1) * ROWS)
        own = CubicSpline(time[rows], sent[rows])(time[rows], 1)
        speed[rows[number > 0 :]] = own[number > 0 :]
    at = sent[0] - 5.0 * np.sign(sent[1] - sent[0])
    for row, screw in enumerate(sent):
        at = nut[row] = np.clip(at, screw - 0.5 * gap, screw + 0.5 * gap)
    there = MECHANISM.forward(torch.as_tensor(nut - lag * speed)).numpy()
    noise = np.random.default_rng(7).normal(0.0, 0.003, there.shape)
    return make_table(target, sent, measured=(there + noise).round(3), feed_mm_s=feed, time_s=time)


@pytest.mark.parametrize("start", [0.7, pytest.param(2.9, marks=pytest.mark.long)])
def test_play_and_a_lag_on_small_circles_are_all_that_is_told(start: float) -> None:
    gap, lag = np.array([0.0, 0.12, 0.12]), np.array([0.01, 0.0, 0.0])
    found = diagnose(Model(MACHINE), build_problem(MACHINE, circles(gap, lag, start)))
    assert found.verdict == "missing"
    assert {names for names in found.suggested} == {("backlash",), ("following-error",)}
    told = {one.name: one.value for each in found.candidates for one in each.parameters}
    assert [told[f"gap_mm {leg}"] for leg in (1, 2, 3)] == pytest.approx(gap, abs=0.003)
    assert [told[f"lag_s {leg}"] for leg in (1, 2, 3)] == pytest.approx(lag, abs=3e-4)
