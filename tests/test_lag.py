"""A position loop followed through time: nothing here knows what the program takes for a speed at a corner."""

from dataclasses import replace

import numpy as np
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.correct.compensate import compensate
from ptt.diagnosis.verdict import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

FILE = bench_machine()
MECHANISM = build_mechanism(FILE.machine)
LAG = np.array([0.02, 0.03, 0.012])  # s, the reciprocal of each loop's gain


def arrive(sent: np.ndarray, feed: np.ndarray) -> np.ndarray:
    """Where the sliders are at the instant in which the last command of each move is given, (n, 3) mm.

    All sliders run from pose to pose at an even speed, as long as the tool's way takes at the feed of the move; each
    closes its distance to its command as a proportional loop does, q' = (b - q) / tau, which has this solution.
    """
    place = MECHANISM.forward(torch.as_tensor(sent)).numpy()
    at, reached = sent[0], [sent[0]]
    for index in range(1, len(sent)):
        lasts = np.linalg.norm(place[index] - place[index - 1]) / feed[index]
        behind = (sent[index] - sent[index - 1]) / lasts * LAG
        at = sent[index] - behind + (at - sent[index - 1] + behind) * np.exp(-lasts / LAG)
        reached.append(at)
    return np.array(reached)


def test_a_loop_that_lags_is_told_and_led_though_every_row_is_a_corner() -> None:
    random, rows = np.random.default_rng(3), 90
    target = random.uniform(-60.0, 60.0, (rows, 3))
    feed = random.choice([8.0, 16.0, 30.0], rows)
    sent = MECHANISM.inverse(torch.as_tensor(target)).numpy()
    table = make_table(target, sent, feed_mm_s=feed)
    actual = MECHANISM.forward(torch.as_tensor(arrive(sent, feed))).numpy()
    read = actual + random.normal(0.0, 0.004, target.shape)
    found = diagnose(Model(FILE), build_problem(FILE, replace(table, measured=read)))
    assert (found.verdict, found.suggested) == ("missing", (("following-error",),))
    lags = np.array([one.value for one in found.candidates[0].parameters])
    np.testing.assert_allclose(lags, LAG, rtol=0.02)
    commands = compensate(found.model, make_table(target, feed_mm_s=feed)).q
    assert np.isfinite(commands).all()
    there = MECHANISM.forward(torch.as_tensor(arrive(commands, feed))).numpy()
    before, after = (np.linalg.norm(place - target, axis=1)[1:].mean() for place in (actual, there))
    assert before > 0.2
    assert after < 0.05 * before
