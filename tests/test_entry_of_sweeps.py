"""One joint moved after another: how each was left before the run is unknown until it has turned over."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.effects.registry import library, make_effect
from ptt.fitting.opening import entering_rows
from ptt.judge.ladder.climb import climb
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import Table, make_table

IIWA = Path(__file__).resolve().parents[1] / "data" / "machines" / "kuka_iiwa.toml"
HEIGHT = np.array([0.5, 2.1, 0.7, 0.8, 1.7, 1.1, 0.0]) * 1e-3  # rad
LENGTH, SIGMA = 0.15, 0.017  # rad; mm


def sweeps(cycles: int) -> np.ndarray:
    """Each joint out and back in turn, the others standing, cycle by cycle, (49 cycles, 7) rad."""
    out = np.array([0.2, 0.45, 0.7, 0.3, -0.1, -0.5, 0.0])
    home = np.array([0.3, 0.5, -0.2, 1.1, 0.4, 0.8, 0.1])
    cycle = np.repeat(home[None], 49, axis=0)
    for joint in range(7):
        cycle[7 * joint : 7 * joint + 7, joint] += out
    return np.tile(cycle, (cycles, 1)) + np.random.default_rng(2).uniform(-0.02, 0.02, (cycles, 7)).repeat(49, axis=0)


def wound_up(q: np.ndarray, first: np.ndarray) -> np.ndarray:
    """By how much each joint lags, as shares of its height, from a first state.

    Source: P. R. Dahl, AIAA J. 14 (1976) 1675, solved over each step.
    """
    state = np.empty_like(q)
    held = first
    for row, move in enumerate(np.diff(q, axis=0, prepend=q[:1])):
        way = np.sign(move)
        held = np.where(way == 0.0, held, way + (held - way) * np.exp(-np.abs(move) / LENGTH))
        state[row] = held
    return state


def made(file: MachineFile, q: np.ndarray) -> Table:
    """A run without errors."""
    return make_table(None, q, build_mechanism(file.machine).forward(torch.as_tensor(q)).numpy(), joint_prefix="q")


@pytest.mark.parametrize(("first", "cycles"), [(-1.0, 3), (1.0, 4)])
def test_wind_up_of_joints_swept_in_turn_is_fitted_without_rows_that_remember_how_they_were_left(first, cycles):
    file = load_machine(IIWA)
    tracker = file.tracker.model_copy(update={"frame": "trusted", "tool": "trusted", "sigma_mm": SIGMA})
    machine = file.machine.model_copy(update={"tool_mm": (60.0, 30.0, 150.0)})
    file = dataclasses.replace(file, machine=machine, tracker=tracker)
    q = sweeps(cycles)
    sent = q - HEIGHT * wound_up(q, first * np.where(np.arange(7) % 2, 1.0, -1.0))
    there = build_mechanism(file.machine).forward(torch.as_tensor(sent)).numpy()
    there += np.random.default_rng(5).normal(0.0, SIGMA, there.shape)
    problem = build_problem(file, make_table(None, q, there, joint_prefix="q"))
    ladder = climb(Model(file), problem, [make_effect(library(), "windup")])
    assert "set aside" in " ".join(ladder.notes)
    assert ladder.steps[-1].heldout_rms_um["total"] < 1.5e3 * SIGMA * np.sqrt(3.0)
    (term,) = ladder.steps[-1].fitted.model.terms
    np.testing.assert_allclose(term.theta[1:6].numpy(), HEIGHT[1:6], rtol=0.1)


def test_rows_of_a_first_fit_are_those_where_some_joints_have_moved_and_others_will():
    file = load_machine(IIWA)
    q = sweeps(3)
    entering = np.flatnonzero(entering_rows(build_problem(file, made(file, q))))
    np.testing.assert_array_equal(entering, np.arange(42))  # joint 7 arrives from a known side in row 42
    together = np.random.default_rng(1).uniform(-0.5, 0.5, (60, 7))
    assert not entering_rows(build_problem(file, made(file, together))).any()
    assert not entering_rows(build_problem(file, made(file, sweeps(1)))).any()  # most of the run
    between = np.repeat(np.random.default_rng(1).uniform(-0.5, 0.5, (10, 7)), 22, axis=0)  # all joints, then one again
    for place in range(10):
        between[22 * place : 22 * place + 22, place % 7] += np.linspace(0.0, 0.3, 22)
    found = entering_rows(build_problem(file, made(file, between)))
    np.testing.assert_array_equal(np.flatnonzero(found), np.arange(22))


def test_joints_that_differ_between_runs_or_stand_for_one_move_are_not_moved_in_turn():
    file, random = load_machine(IIWA), np.random.default_rng(4)
    whole, three = random.uniform(-0.5, 0.5, (40, 7)), np.tile(random.uniform(-0.5, 0.5, 7), (40, 1))
    three[:, :3] += random.uniform(-0.3, 0.3, (40, 3))
    both = make_table(None, np.concatenate([whole, three]), made(file, np.concatenate([whole, three])).measured,
                      joint_prefix="q", run=np.repeat([0, 1], 40))  # fmt: skip
    assert not entering_rows(build_problem(file, both)).any()
    whole[1, 6] = whole[0, 6]
    assert not entering_rows(build_problem(file, made(file, whole))).any()
