"""Hysteresis that no effect describes: told by the way back to former reversals, and written as a law of it."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import torch
from made_runs import SIGMA, empty_run, machine, measure

from ptt.dependence.said import say_size
from ptt.dependence.size import Size
from ptt.dependence.way import since_reversal
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling import sizes
from ptt.diagnosis.unknown.span import span_of
from ptt.effects.hysterons import hysterons, initial_memory
from ptt.effects.prefilled import prefilled
from ptt.effects.registry import library, make_effect
from ptt.fitting.chunks import take
from ptt.judge.ladder.climb import climb
from ptt.machine import MachineFile
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table

TRAVEL = torch.tensor([120.0, 100.0, 140.0], dtype=torch.float64)


def lines(rows: int = 240) -> Table:
    """Lines out and back over the workspace, as a program of work drives them."""
    random = np.random.default_rng(4)
    corners = random.uniform(-60.0, 60.0, (rows // 12 + 1, 3))
    share = np.linspace(0.0, 1.0, 12, endpoint=False)[:, None]
    return make_table(np.concatenate([a + share * (b - a) for a, b in itertools.pairwise(corners)])[:rows])


def bouc_wen(q: np.ndarray, length: float, first: float = 0.0) -> np.ndarray:
    """State z of dz = (dx - 0.6 |dx| |z| z - 0.4 dx z^2) / l, in steps of a hundredth of a move.

    Source: Y. K. Wen, J. Eng. Mech. Div. 102 (1976) 249.
    """
    state, z = np.zeros(len(q)), first
    for row, move in enumerate(np.diff(q, prepend=q[0])):
        for step in np.full(100, move / 100.0):
            z += (step - 0.6 * abs(step) * abs(z) * z - 0.4 * step * z * z) / length
        state[row] = z
    return state


def stiff(table: Table, file: MachineFile, joint: int, size: float, *firsts: float) -> Problem:
    """Readings of a machine of which one slider hangs back by a hysteresis that turns over within some 12 mm."""
    sound = build_problem(file, measure(table, file, []))
    q, runs = sound.view.q.numpy()[:, joint], np.split(np.arange(table.rows), np.flatnonzero(np.diff(table.run)) + 1)
    back = size * np.concatenate([bouc_wen(q[own], 12.0, first) for own, first in zip(runs, firsts, strict=True)])
    moved = measure(table, file, [], noise=0.0).measured  # in the tracker's frame
    there = torch.as_tensor(back)[:, None] * sound.view.jacobian[:, :, joint]
    turned = there.numpy() @ sound.rotation[0].T
    noise = np.random.default_rng(6).normal(0.0, SIGMA, moved.shape)
    return build_problem(file, table.replace(measured=moved + turned + noise))


def test_a_hysteresis_is_told_by_its_slider_and_written_as_a_law(tmp_path: Path) -> None:
    file = machine()
    problem = stiff(lines(), file, 1, 0.05, 0.5)
    found = diagnose(Model(file), problem)
    first = found.depends_on[0]
    assert found.verdict == "unknown" and not found.suggested
    assert (first.residual, first.on, first.shape, first.with_) == ("slider 2", "direction2", "gradual", "reversal")
    assert "turns over gradually" in found.words and first.size is not None
    assert first.size.value == pytest.approx(0.1, rel=0.15)  # from one end of the loop to the other, up for up
    curve = first.curve[np.argsort(first.curve[:, 0]), 1]  # signed by the way, it turns from one end to the other
    assert (curve[0] > 0.02 and curve[-1] < -0.03) or (curve[0] < -0.02 and curve[-1] > 0.03)
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [first.to_dict()]).text)
    ladder = climb(Model(file), problem, [make_effect(library(path), "own-cause")])
    before, after = (step.heldout_rms_um["total"] for step in (ladder.steps[0], ladder.steps[-1]))
    assert after < 0.4 * before


@pytest.mark.long
def test_a_hysteresis_whose_blocks_cancel_has_the_size_of_its_two_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm's blocks did, and the diagnosis ended in an error: the travel since a reversal is no context of rows."""
    monkeypatch.setattr(sizes, "LARGER_FACTOR", 0.0)
    first = diagnose(Model(machine()), stiff(lines(), machine(), 1, 0.05, 0.5)).depends_on[0]
    assert first.shape == "gradual" and first.size is not None
    assert (first.size.kind, first.size.on) == ("side", "direction2")
    assert 0.02 < first.size.value < 0.1  # the loop turns over for 12 mm after each reversal


def test_travel_since_a_reversal_begins_anew_with_each_and_with_each_run() -> None:
    q = np.array([0.0, 2.0, 5.0, 5.0, 4.0, 1.0, 3.0, 9.0, 9.0, 8.0])
    starts = np.isin(np.arange(10), (0, 7))
    np.testing.assert_array_equal(since_reversal(q, starts), [0.0, 2.0, 5.0, 5.0, 1.0, 4.0, 2.0, 0.0, 0.0, 1.0])


@pytest.mark.long
def test_runs_that_were_come_to_from_opposite_sides_are_one_hysteresis() -> None:
    file, table = machine(), lines()
    problem = stiff(table.replace(run=np.repeat([0, 1], table.rows // 2)), file, 1, 0.05, 0.9, -0.9)
    found = diagnose(Model(file), problem)
    assert [(one.residual, one.on, one.shape) for one in found.depends_on] == [("slider 2", "direction2", "gradual")]


def test_a_part_of_a_run_has_turned_over_as_the_whole_has() -> None:
    file = machine()
    problem = build_problem(file, measure(empty_run(300), file, []))
    part = take(problem, [(100, 180), (220, 260)])
    rows = np.r_[100:180, 220:260]
    torch.testing.assert_close(hysterons(part.view, TRAVEL), hysterons(problem.view, TRAVEL)[rows], atol=1e-4, rtol=0.0)
    whole, span = initial_memory(problem.view, TRAVEL), span_of(problem)
    assert (whole[0] == 1.0).all() and (whole.diff(dim=0) <= 0.0).all()
    np.testing.assert_array_equal(span.of(rows).begun, span.begun[rows])


def test_a_joint_that_stands_still_has_turned_over_nowhere() -> None:
    file = machine()
    target = np.random.default_rng(2).uniform(-60.0, 60.0, (50, 3))
    still = build_problem(file, measure(make_table(np.repeat(target[:1], 50, axis=0)), file, []))
    assert torch.isfinite(hysterons(still.view, torch.zeros(3, dtype=torch.float64))).all()
    assert np.isfinite(span_of(still).begun).all()


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.1, "by 100 +- 3 um, higher after moving up than after moving down"), (0.003, "by at most 9.0 um, either way")],
)
def test_what_turns_over_is_said_with_its_side_where_that_is_known(value: float, said: str) -> None:
    size = Size("slider 2", "turn", value, 0.003, -1.0, 1.0, on="direction2", along="direction2")
    assert say_size(size) == f"After a reversal slider 2 turns over gradually {said}."
