"""Chunks: sums over them, the state of the travel handed on, are the sums of the whole."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ptt.correct.training.nested import hold_out
from ptt.correct.training.physics import fit_physics
from ptt.correct.training.protocols import block_protocol
from ptt.effects.memory import gradual_reversal, play
from ptt.effects.registry import library, make_effect
from ptt.fitting.chunks import cut, enter, map_chunks, stretches, take
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.turns import remember

MACHINE = Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml"
GAP = torch.tensor([0.04, 3.0, 0.3], dtype=torch.float64)
LENGTH = torch.tensor([0.5, 4.0, 20.0], dtype=torch.float64)


def _problem(rows: int = 900, runs: int = 2, seed: int = 3) -> Problem:
    """Small steps, standstills, runs, and a joint that moves within its play for long."""
    random = np.random.default_rng(seed)
    way = np.cumsum(random.normal(size=(rows, 3)) * [1.0, 0.15, 0.6] * (random.random((rows, 1)) > 0.2), axis=0)
    command = 283.0 + 30.0 * np.sin(way / 30.0)
    run = np.sort(random.integers(0, runs, rows))
    file = load_machine(MACHINE)
    measured = np.zeros((rows, 3))
    problem = build_problem(file, make_table(None, command, measured, run=run, time_s=np.arange(rows) * 2.0))
    assert problem.view.mechanism.joints == 3
    return problem


@pytest.mark.parametrize("size", [1, 7, 100, 450, 2000])
@pytest.mark.parametrize("operator", ["play", "reversal", "slope"])
def test_memory_is_handed_on(size: int, operator: str) -> None:
    problem = _problem(100 if size == 1 else 480)
    functions = {
        "play": lambda view: play(view, GAP),
        "reversal": lambda view: gradual_reversal(view, LENGTH),
        "slope": lambda view: torch.func.jacfwd(lambda gap: play(view, gap))(GAP),
    }
    whole = functions[operator](problem.view)
    parts = torch.cat([functions[operator](make().view) for make in cut(problem, size)])
    torch.testing.assert_close(parts, whole, rtol=0, atol=1e-10)
    assert float(whole.abs().max()) > 0


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3, 3).map(lambda x: round(x, 2)), min_size=1, max_size=40), st.sampled_from([1.0, -1.0]))
def test_a_shortened_way_leaves_play_as_the_whole_way_does(steps: list[float], sign: float) -> None:
    way = torch.tensor(np.cumsum(steps), dtype=torch.float64)[:, None]
    short = remember(way, torch.tensor([sign], dtype=torch.float64), reach=1.0)
    assert len(short.way) <= len(way)
    for gap in (0.01, 0.5, 2.0, 10.0):
        assert _played(short.way[:, 0], gap, float(short.direction[0])) == pytest.approx(
            _played(way[:, 0], gap, sign), abs=1e-12
        )


def _played(way: torch.Tensor, gap: float, sign: float) -> float:
    y = float(way[0]) - sign * gap / 2
    for q in way.tolist():
        y = min(max(y, q - gap / 2), q + gap / 2)
    return y


def test_stretches_taken_out_are_entered_as_in_the_whole_run() -> None:
    problem = _problem()
    kept = [(120, 170), (400, 401), (700, 860)]
    rows = np.concatenate([np.arange(*stretch) for stretch in kept])
    part = take(problem, kept)
    for operator, size in ((play, GAP), (gradual_reversal, LENGTH)):
        torch.testing.assert_close(operator(part.view, size), operator(problem.view, size)[rows], rtol=0, atol=1e-10)
    assert part.table.rows == len(rows) and (part.table.line == problem.table.line[rows]).all()


def test_an_entry_is_short() -> None:
    problem = _problem(4000, runs=1)
    (entry,) = enter(problem.view, [4000 - 1])
    assert entry is not None and len(entry.way) < 2000  # of 8000


def test_chunks_cover_all_rows_once() -> None:
    parts = stretches(1_000_003, 20_000)
    assert parts[0][0] == 0 and parts[-1][1] == 1_000_003
    assert all(a[1] == b[0] for a, b in pairwise(parts))
    assert max(last - first for first, last in parts) <= 20_001


def test_map_keeps_the_order() -> None:
    problem = _problem()
    lines = np.concatenate(list(map_chunks(lambda chunk: chunk.table.line, cut(problem, 100))))
    np.testing.assert_array_equal(lines, problem.table.line)


def test_a_long_run_is_held_out_one_step_away_from_the_fit_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, random = _problem(1200, 1), np.random.default_rng(8)
    tool = problem.view.mechanism.forward(problem.view.q - 0.5 * GAP[0] * problem.view.direction).numpy()
    read = replace(problem, measured=tool + 0.004 * random.normal(size=tool.shape))
    model, protocol = Model(problem.file) + make_effect(library(), "backlash"), block_protocol(problem)
    refitted = hold_out(model, read, protocol, {})
    monkeypatch.setattr("ptt.correct.training.nested.LONG", 1000)
    stepped = hold_out(model, read, protocol, {})
    assert np.array_equal(stepped.rows, refitted.rows) and stepped.rows.sum() > 1100
    apart = (stepped.physics - refitted.physics)[stepped.rows]
    fitted = (stepped.physics - fit_physics(model, read).residual)[stepped.rows]
    assert np.abs(apart).max() < 0.1 * np.abs(fitted).max()  # what it says of hiding is what hiding does


def test_a_reversal_is_followed_across_the_blocks_of_its_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = _problem(700, 3)
    whole = gradual_reversal(problem.view, LENGTH)
    monkeypatch.setattr("ptt.effects.memory.SCANNED", 64)  # standstills lie across the ends of blocks among others
    torch.testing.assert_close(gradual_reversal(problem.view, LENGTH), whole, rtol=0, atol=1e-14)
    slope = torch.func.jacfwd(lambda length: gradual_reversal(problem.view, length))(LENGTH)
    monkeypatch.setattr("ptt.effects.memory.SCANNED", 5000)
    alone = torch.func.jacfwd(lambda length: gradual_reversal(problem.view, length))(LENGTH)
    torch.testing.assert_close(slope, alone, rtol=0, atol=1e-13)
