"""A position loop followed through time: nothing here knows what the program takes for a speed at a corner."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.correct.compensate import compensate
from ptt.diagnosis.verdict import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

BENCH = bench_machine()
MECHANISM = build_mechanism(BENCH.machine)
LAG = np.array([0.02, 0.03, 0.012])  # s, the reciprocal of each loop's gain
PIECES = 200  # of a move, along each of which the command runs evenly


def arrive(sent: np.ndarray, feed: np.ndarray, moves: str) -> np.ndarray:
    """Where the sliders are at the instant in which the last command of each move is given, (n, 3) mm.

    A move takes as long as the tool's way at its feed. Either all sliders run from pose to pose at an even speed, or
    the tool does. Each slider closes its distance to its command as a proportional loop does, q' = (b - q) / tau, which
    has this solution while the command runs evenly.
    """
    place = MECHANISM.forward(torch.as_tensor(sent)).numpy()
    part = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    at, reached = sent[0], [sent[0]]
    for index in range(1, len(sent)):
        lasts = np.linalg.norm(place[index] - place[index - 1]) / feed[index] / PIECES
        way = sent[index - 1] + part * (sent[index] - sent[index - 1])
        if moves == "straight":
            tool = place[index - 1] + part * (place[index] - place[index - 1])
            way = MECHANISM.inverse(torch.as_tensor(tool)).numpy()
        for begin, end in pairwise(way):
            behind = (end - begin) / lasts * LAG
            at = end - behind + (at - begin + behind) * np.exp(-lasts / LAG)
        reached.append(at)
    return np.array(reached)


@pytest.mark.parametrize("moves", ["sliders", "straight"])
def test_a_loop_that_lags_is_told_and_led_though_every_row_is_a_corner(moves: str) -> None:
    file = replace(BENCH, machine=BENCH.machine.model_copy(update={"moves": moves}))
    random, rows = np.random.default_rng(3), 90
    target = random.uniform(-60.0, 60.0, (rows, 3))
    feed = random.choice([8.0, 16.0, 30.0], rows)
    sent = MECHANISM.inverse(torch.as_tensor(target)).numpy()
    table = make_table(target, sent, feed_mm_s=feed)
    actual = MECHANISM.forward(torch.as_tensor(arrive(sent, feed, moves))).numpy()
    read = actual + random.normal(0.0, 0.004, target.shape)
    found = diagnose(Model(file), build_problem(file, replace(table, measured=read)))
    assert (found.verdict, found.suggested) == ("missing", (("following-error",),))
    lags = np.array([one.value for one in found.candidates[0].parameters])
    np.testing.assert_allclose(lags, LAG, rtol=0.02)
    commands = compensate(found.model, make_table(target, feed_mm_s=feed)).q
    assert np.isfinite(commands).all()
    there = MECHANISM.forward(torch.as_tensor(arrive(commands, feed, moves))).numpy()
    before, after = (np.linalg.norm(place - target, axis=1)[1:].mean() for place in (actual, there))
    assert before > 0.2
    assert after < 0.03 * before
