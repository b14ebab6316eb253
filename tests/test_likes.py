"""An effect is named beside a law that would do its work in its place: hidden readings cannot choose between them."""

import numpy as np
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis import turn as turn_of_search
from ptt.diagnosis.verdict import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table


def test_a_slider_that_errs_by_its_direction_at_once_has_lost_motion_and_something_else(monkeypatch) -> None:
    """Play takes up its gap first, a few rows a turn: where those count, a law of the direction stands beside it."""
    monkeypatch.setattr(turn_of_search, "unwaited_rows", lambda terms, problem, noise, left: np.zeros(300, dtype=bool))
    file = bench_machine()
    mechanism = build_mechanism(file.machine)
    turn = np.linspace(0.0, 8.0 * np.pi, 300)
    target = np.column_stack([60.0 * np.cos(turn), 60.0 * np.sin(turn), np.linspace(-40.0, 40.0, 300)])
    sent = mechanism.inverse(torch.as_tensor(target)).numpy()
    way = np.concatenate([-np.ones((1, 3)), np.sign(np.diff(sent, axis=0))])
    err = -0.02 * np.array([1.0, 1.5, 0.7]) * way
    actual = mechanism.forward(torch.as_tensor(sent + err)).numpy()
    read = actual + np.random.default_rng(2).normal(0.0, 0.003, target.shape)
    part = np.linspace(0.0, 1.0, 300)
    table = make_table(target, sent, measured=read, time_s=1800.0 * part, temp_c=20.0 + 2.0 * np.sqrt(part))
    found = diagnose(Model(file), build_problem(file, table))
    assert (found.verdict, found.suggested) == ("unknown", (("backlash",),))
    assert found.candidates[0].heldout_after < 0.3 * found.candidates[0].heldout_before
