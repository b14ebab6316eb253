"""Sums over the chunks of a run are those of the whole run."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from chunked_run import MODEL, ROWS
from chunked_run import problem as problem

from ptt.diagnosis.evidence.ansatz import Ansatz, open_long_run
from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.held_out import held_out_rms
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.row_system import RowSystem, rows_of
from ptt.diagnosis.evidence.sampled import spread
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.summed import sum_up
from ptt.diagnosis.evidence.summed_system import SummedSystem
from ptt.diagnosis.evidence.system import clock_of
from ptt.diagnosis.noise.memory import WHITE, Memory, block_sums
from ptt.diagnosis.noise.wander import Wander
from ptt.diagnosis.unknown.blocks import unknown_blocks
from ptt.diagnosis.unknown.span import span_of
from ptt.effects import library
from ptt.fitting.chunks import cut, numbers, take
from ptt.fitting.linear import assemble
from ptt.fitting.solve import fit
from ptt.run.noise import Noise
from ptt.run.problem import Problem

BLOCKS = (
    "tool on x and y and z", "slider 2 on b2", "rail 1 on b1", "slider 1 on memory of temperature and b1",
    "slider 3 on direction3 and temperature", "set-up on time", "slider 1 on b1 with period 7",
)  # fmt: skip
WANDERING = Memory(Wander(0.5, 60.0))


def both(problem: Problem, size: int, memory: Memory) -> tuple[RowSystem, SummedSystem, np.ndarray]:
    """The same columns with their rows and as sums, and the places of the sums' columns among those with rows."""
    noise = problem.noise or Noise(np.eye(3) * 2.5e-5, "machine file")
    known = library()
    fitted = fit(MODEL + known["backlash"]() + known["windup"](), problem, noise=noise, robust=False, coarse=True)
    candidates, _ = present_candidates(fitted, problem, known)
    trials = {effect.key: (effect, list(effect.search(problem.view))[:2]) for effect in candidates}
    shapes = {key: shapes for key, (_, shapes) in trials.items()}
    periods = ((0, 7.0),)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ptt.diagnosis.evidence.narrow.CHEAP_COLUMNS", np.inf)  # sums keep every column as it is
        patch.setattr("ptt.diagnosis.evidence.narrow.MAP_COLUMNS", np.inf)
        whole = build_row_system(fitted, problem, candidates, noise, 0.0, problem.used, periods, shapes)
    blocks = [atom for atom in whole.atoms.values() if atom.name in BLOCKS]
    levers = {atom.block.place.residual: atom.block.place.lever for atom in blocks if atom.block is not None}
    assert len(blocks) == len(BLOCKS)
    span = replace(span_of(problem), levers=levers)
    at = Ansatz(fitted, tuple(blocks), periods, noise, 0.0, memory)
    chunks = cut(problem, size)
    run = open_long_run(problem, chunks, span)
    summed, gross = sum_up(run, at, trials, problem, problem.used)
    other, _ = sum_up(replace(run, chunks=chunks[::-1]), at, trials, problem, problem.used)
    np.testing.assert_allclose(other.sums(memory).gram, summed.sums(memory).gram, rtol=1e-9, atol=1e-6)
    assert not gross.any()
    linear = min(atom.columns.min() for atom in whole.atoms.values() if atom.block is not None)
    return whole, summed, np.concatenate([np.arange(linear), *(atom.columns for atom in blocks)])


def test_sums_of_a_stretch_are_those_of_its_rows_in_noise_and_in_mm() -> None:
    random = np.random.default_rng(3)
    spread = random.normal(size=(3, 3))
    noise = Noise(1e-5 * (spread @ spread.T + np.eye(3)), "repeats", 30.0)  # nothing alike along any axis
    joined = random.normal(size=(50, 3, 7))
    white, in_mm, rows = block_sums(joined, noise)
    unit = np.linalg.inv(noise.whitener)
    readings = np.einsum("ab,mbp->map", unit, joined).reshape(-1, 7)
    np.testing.assert_allclose(white, joined.reshape(-1, 7).T @ joined.reshape(-1, 7), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(in_mm, readings.T @ readings, rtol=1e-12, atol=1e-15)
    assert rows == 50


@pytest.mark.parametrize(
    ("size", "slab"),
    [pytest.param(ROWS, ROWS, marks=pytest.mark.long), pytest.param(700, ROWS, marks=pytest.mark.long), (ROWS, 450)],
)
def test_sums_over_chunks_are_those_of_the_whole(
    problem: Problem, size: int, slab: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ptt.diagnosis.evidence.summed.SLAB_ROWS", slab)
    whole, summed, places = both(problem, size, WHITE)
    mine, theirs = summed.sums(WHITE), whole.sums_of(places, WHITE)
    scale = np.sqrt(np.diag(theirs.gram))
    scale = np.maximum(scale, 1e-6 * scale.max())
    assert np.abs((mine.gram - theirs.gram) / np.outer(scale, scale)).max() < 1e-10
    assert np.abs((mine.side - theirs.side) / scale).max() < 1e-10 * np.sqrt(theirs.square)
    assert mine.square == pytest.approx(theirs.square, rel=1e-10)
    assert summed.count == whole.count and summed.repeats == whole.repeats
    assert rows_of(whole) is whole
    with pytest.raises(TypeError, match="only their sums"):
        rows_of(summed)
    keys = ("backlash", "windup", "slider 2 on b2")
    states = [Scorer(system).score(keys, WHITE) for system in (summed, whole)]
    assert states[0].total == pytest.approx(states[1].total, abs=1e-3)
    np.testing.assert_allclose(states[0].posterior.values, states[1].posterior.values, atol=1e-5)
    errors = [held_out_rms(Scorer(system), keys) for system in (summed, whole)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6) and 0.0 < errors[0] < 1.0
    left = [system.residual(s.columns, s.posterior.values) for system, s in zip((summed, whole), states, strict=True)]
    np.testing.assert_allclose(*left, atol=1e-4)


@pytest.mark.long
def test_candidates_of_a_share_of_the_rows_say_about_what_all_rows_say(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ptt.diagnosis.evidence.summed.SLAB_ROWS", 60)
    monkeypatch.setattr(sys.modules[__name__], "BLOCKS", ())  # a share of so few rows tells no curves
    clean = problem.masked(np.isin(np.arange(ROWS), [777, 2100]))
    every = both(clean, ROWS, WHITE)[1]
    monkeypatch.setattr("ptt.diagnosis.evidence.sampled.SHARED_ROWS", ROWS // 3)
    share = both(clean, ROWS, WHITE)[1]
    own = [key for key, atom in every.atoms.items() if atom.shape is None]
    places = np.concatenate([every.frame, *(every.atoms[key].columns for key in own)])
    few, all_ = share.sums(WHITE).of(places), every.sums(WHITE).of(places)
    np.testing.assert_allclose(few.gram, all_.gram, rtol=1e-9)
    np.testing.assert_allclose(few.side, all_.side, rtol=1e-9)
    assert np.linalg.eigvalsh(share.sums(WHITE).gram)[0] > -1e-9 * np.trace(all_.gram)
    told = [Scorer(system) for system in (share, every)]
    held = [held_out_rms(scorer, ("backlash", "windup")) for scorer in told]
    assert held[0] == pytest.approx(held[1], rel=1e-9)
    gains = [
        {
            gain.key: gain.nats
            for gain in scorer.all_gains(scorer.score(own, WHITE), lambda atom: len(atom.columns) < 12)
        }
        for scorer in told
    ]
    leaders = [max(found, key=lambda key: found[key]) for found in gains]  # type: ignore[arg-type, misc]
    assert leaders[0] == leaders[1] and every.atoms[leaders[0]].name == "once-per-rev"
    assert gains[0][leaders[0]] == pytest.approx(gains[1][leaders[1]], rel=0.1)


def test_sums_that_a_share_cannot_tell_are_spread_as_its_residual_is() -> None:
    random = np.random.default_rng(8)
    model = random.normal(size=(6000, 4))
    model[2000:, 3] = 0.0  # hardly any of the share shows it
    more = model @ random.normal(size=(4, 3)) + random.normal(size=(6000, 3))
    rows = np.concatenate([model, more], axis=1)
    own, block = np.arange(4), np.arange(6000) % 3
    share = np.r_[0:10, 2000:6000:4]

    def held(columns: np.ndarray, some: np.ndarray) -> dict[int, tuple[np.ndarray, np.ndarray, int]]:
        parts = {index: columns[some[block[some] == index]] for index in range(3)}
        return {index: (part.T @ part, 4.0 * part.T @ part, len(part)) for index, part in parts.items()}

    found = spread(held(model, np.arange(6000)), held(rows, share), own)
    truth = held(rows, np.arange(6000))
    for index in range(3):
        white, in_mm, count = found[index]
        np.testing.assert_allclose(white[:4, :4], truth[index][0][:4, :4])
        np.testing.assert_allclose(in_mm, 4.0 * white)
        assert count == truth[index][2]
    total, right = (sum(each[0] for each in sums.values()) for sums in (found, truth))
    assert np.linalg.eigvalsh(total)[0] > 0.0
    np.testing.assert_allclose(total[:3, 4:] / right[:3, 4:], 1.0, atol=0.1)
    np.testing.assert_allclose(total.diagonal() / right.diagonal(), 1.0, atol=0.5)


@pytest.mark.long
def test_a_wander_costs_next_to_nothing_at_the_seams(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, summed, places = both(problem, 700, WANDERING)
    mine, theirs, white = summed.sums(WANDERING), whole.sums_of(places, WANDERING), whole.sums_of(places, WHITE)
    assert mine.log_noise == pytest.approx(theirs.log_noise, rel=0.01) and theirs.log_noise > 100.0
    assert mine.square == pytest.approx(theirs.square, rel=0.02)
    assert theirs.square < 0.9 * white.square
    monkeypatch.setattr("ptt.diagnosis.evidence.summed.SLAB_ROWS", 900)  # the rows of one chunk have no seams
    one = both(problem, ROWS, WANDERING)[1].sums(WANDERING)
    assert one.square == pytest.approx(theirs.square, rel=1e-9) and one.log_noise == pytest.approx(theirs.log_noise)


def test_blocks_of_a_part_are_those_of_the_whole(problem: Problem) -> None:
    fitted = fit(MODEL, problem, robust=False, coarse=True)
    noise = fitted.noise
    parts = {}
    sample = take(problem, [(0, 300), (1500, 2000)])
    for name, part in (("whole", problem), ("sample", sample)):
        linear = assemble(fitted.layout, fitted.unknowns, part, noise)
        assert linear.at is not None
        parts[name] = linear.at.chain
    whole = unknown_blocks(problem, parts["whole"])
    levers = {block.place.residual: block.place.lever for block in whole}
    few = unknown_blocks(sample, parts["sample"], span=replace(span_of(problem), levers=levers))
    assert [block.name for block in few] == [block.name for block in whole] and len(few) > 30
    for mine, theirs in zip(few, whole, strict=True):
        forgotten = 1e-6 if mine.gradual else 1e-12  # of reversals before the part began
        np.testing.assert_allclose(mine.features, theirs.features[numbers(sample)], atol=forgotten, rtol=0.0)


def test_a_gap_between_stretches_is_as_long_as_it_took(problem: Problem) -> None:
    sample = take(problem, [(0, 300), (1500, 2000)])
    rows = np.ones(800, dtype=bool)
    rows[[0, 10, 300]] = False
    clock = clock_of(sample, rows)
    assert np.flatnonzero(clock.starts).tolist() == [0]
    assert clock.time[298] == problem.view.time[1501]
    number = clock_of(replace(sample, view=replace(sample.view, varies=frozenset())), rows)
    assert number.time[297:299].tolist() == [299.0, 1501.0]
