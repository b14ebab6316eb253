"""What is worked out once is not again: sums that are there, what hidden rows say, steps that lead nowhere."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ptt.diagnosis.evidence import held_out as held_out_module
from ptt.diagnosis.evidence import memories
from ptt.diagnosis.evidence.atoms import BLOCK_ODDS, MEMORY_ODDS, Atom
from ptt.diagnosis.evidence.held_out import cross_validate, held_out_rms
from ptt.diagnosis.evidence.memories import prior_of
from ptt.diagnosis.evidence.row_sums import SumsOfRows
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.system import whitened
from ptt.diagnosis.noise.memory import WHITE, Memory, entries
from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.noise.wander import Clock, Wander
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.places import Place
from ptt.run.noise import Noise

ROWS, WIDTH, POSES = 40, 36, 8  # columns enough that sums are only worked out as they are asked for
MEMORIES = (WHITE, Memory(None, 3.0), Memory(Wander(2.0, 12.0)), Memory(Wander(0.5, 6.0), 1.0))


def system_of(values: np.ndarray | None = None) -> RowSystem:
    """Rows of eight poses in blocks of ten, a frame of three columns, three atoms of two."""
    random, rows = np.random.default_rng(3), ROWS if values is None else len(values)
    columns = random.normal(size=(rows, 3, WIDTH))
    base, told = random.normal(size=(2, 3, WIDTH)), random.normal(size=(2, 3))
    atoms = {name: _atom(name, np.arange(3 + 2 * i, 5 + 2 * i)) for i, name in enumerate("abc")}
    clock = Clock(np.arange(rows, dtype=float), np.arange(rows) == 0)
    read = columns @ random.normal(size=WIDTH) + random.normal(size=(rows, 3)) if values is None else values
    return RowSystem(
        np.arange(rows), np.arange(3), atoms, clock, Noise(np.eye(3), "first guess"), 0.0, np.ones(WIDTH), columns,
        read, poses_of(np.arange(rows) % POSES), np.arange(rows) // 10, {}, SimpleNamespace(), base, told,
    )  # fmt: skip


def _atom(name: str, columns: np.ndarray) -> Atom:
    return Atom(name, name, columns, np.zeros(2, int), np.full(1, 1e4), 5.0, np.zeros(2, bool), block=SimpleNamespace())


@pytest.mark.parametrize(("known", "width"), [(False, 3), (True, 3), (True, 0)])
def test_combinations_of_columns_have_the_sums_of_their_rows_whatever_is_known_before(known: bool, width: int) -> None:
    system, random = system_of(), np.random.default_rng(4)
    chosen, ways = np.array([1, 4, 8, 6]), random.normal(size=(4, width))
    if known:
        system.sums(MEMORIES[1])  # with the means of poses, and white sums
    of = system.among(chosen, ways)
    for memory in MEMORIES:
        anew, sums = system_of().sums_of(chosen, memory), of(memory)
        np.testing.assert_allclose(sums.gram, ways.T @ anew.gram @ ways, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(sums.side, ways.T @ anew.side, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose((sums.square, sums.log_noise), (anew.square, anew.log_noise), rtol=1e-10)


def test_sums_beside_errors_of_poses_stay_when_columns_come() -> None:
    system, more = system_of(), np.random.default_rng(5).normal(size=(ROWS, 3, 2))
    some, every = np.array([0, 5, 7]), np.arange(WIDTH + 2)
    for memory in MEMORIES:
        system.sums(memory).across(some, np.arange(WIDTH))
    further = {"d": _atom("d", np.array([WIDTH, WIDTH + 1]))}
    wider = system.widened(further, more, np.ones(2))
    assert set(wider._sums) == {*MEMORIES, Memory(MEMORIES[3].wander)}  # on which those of both rest
    assert np.array_equal(np.flatnonzero(wider._sums[MEMORIES[1]].there), some)
    anew = system_of().widened(further, more, np.ones(2))
    for memory in MEMORIES:
        mine, theirs = wider.sums(memory), anew.sums(memory)
        for chosen in (some, np.array([WIDTH + 1, 2, 5])):
            np.testing.assert_allclose(mine.across(chosen, every), theirs.across(chosen, every), rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(mine.of(chosen).gram, theirs.of(chosen).gram, rtol=1e-9, atol=1e-9)
        pair = np.array([[3, 4], [WIDTH, 10]])
        np.testing.assert_allclose(mine.own(pair), theirs.own(pair), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(mine.side, theirs.side, rtol=1e-9, atol=1e-9)


def test_a_system_that_is_asked_little_works_no_sums_out_before_somebody_asks() -> None:
    """Rows are many for so few columns: a system that is searched has the sums of all of them at once."""
    whole = system_of(np.random.default_rng(5).normal(size=(200, 3)))
    few = whole.only(["b", "a"])
    assert not isinstance(whole.sums(WHITE), SumsOfRows) and few.flat.shape[0] == 7
    for memory in MEMORIES[:2]:
        sums = few.sums(memory)
        assert isinstance(few.sums(WHITE), SumsOfRows) and not few.sums(WHITE).there.any()
        own = np.array([0, few.atoms["b"].columns[0], few.atoms["a"].columns[1]])
        all_ = np.array([0, whole.atoms["b"].columns[0], whole.atoms["a"].columns[1]])
        np.testing.assert_allclose(sums.of(own).gram, whole.sums(memory).of(all_).gram, rtol=1e-9, atol=1e-9)


def test_entries_of_a_matrix_are_the_same_however_many_are_asked_for_and_however_it_lies() -> None:
    matrix, random = np.arange(42.0).reshape(6, 7), np.random.default_rng(6)
    for there in (matrix, np.asfortranarray(matrix), np.arange(96.0).reshape(8, 12)[:6, 2:9]):
        for count in (0, 1, 2, 5):
            rows, columns = random.integers(0, 6, 4), random.integers(0, 7, count)
            np.testing.assert_array_equal(entries(there, rows, columns), there[np.ix_(rows, columns)])


def test_columns_of_blocks_are_their_features_in_units_of_noise() -> None:
    random = np.random.default_rng(6)
    noise = Noise(np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 2.0], [0.0, 2.0, 1.0]]) * 1e-5, "machine file")
    tool, rail = (Place(kind, kind, random.normal(size=(ROWS, 3, ways))) for kind, ways in (("tool", 3), ("rail", 2)))
    blocks = [
        Block(str(n), place, ("x",), random.normal(size=(ROWS, n))) for n, place in ((4, tool), (1, rail), (3, rail))
    ]
    rows = np.arange(ROWS) % 3 > 0
    found = whitened(blocks, noise, rows)
    assert found.transpose(2, 1, 0).flags.c_contiguous
    wanted = np.concatenate([noise.whitener @ block.features for block in blocks], axis=2)[rows]
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-12)


def test_what_hidden_rows_say_is_asked_of_them_once(monkeypatch: pytest.MonkeyPatch) -> None:
    scorer = Scorer(system_of())
    first, error = cross_validate(scorer, ("a", "b"), "a"), held_out_rms(scorer, ("a", "b"))
    told = np.array([_left_out(("a", "b"), block) for block in range(4)])
    np.testing.assert_allclose(error, np.sqrt(told.sum() / ROWS), rtol=1e-6)
    fewer = cross_validate(scorer, ("a", "b"), "b")
    monkeypatch.setattr(held_out_module, "_predicted", None)
    assert cross_validate(scorer, ("b", "a"), "a") is first and held_out_rms(scorer, ("b", "a")) == error
    np.testing.assert_allclose(fewer.with_it, first.with_it, rtol=1e-12)  # of the same set
    assert not np.allclose(fewer.without, first.without)


def _left_out(keys: tuple[str, ...], block: int) -> float:
    """Sum of squares on one block of travel that a set leaves which never saw it."""
    system = system_of()
    scorer, here = Scorer(system), system.block == block
    state = scorer.score(keys, WHITE)
    values = next(scorer.without_rows(state, [list(system.held_out_blocks(state.columns))[block]])).values
    return float(np.square(system.values[here] - system.columns[here][:, :, state.columns] @ values).sum())


def _both(one_memory: bool) -> Scorer:
    """Readings of few poses, each with an error to itself, of a tracker that wanders."""
    random, pose = np.random.default_rng(9), np.arange(300) % POSES
    slow = 0.3 * np.cumsum(random.normal(size=(300, 3)), axis=0)
    system = system_of(random.normal(size=(300, 3)) + slow + 30.0 * random.normal(size=(POSES, 3))[pose])
    return Scorer(replace(system, one_memory=one_memory))


def test_a_wander_is_told_beside_errors_of_poses() -> None:
    scorer = _both(one_memory=False)
    found, _ = scorer.best_memory(scorer.score((), WHITE))
    assert found.wander is not None and found.wander.constant > 20.0 and found.pose > 100.0
    totals = [scorer.score((), memory).total for memory in (found, replace(found, pose=0.0), Memory(None, found.pose))]
    assert totals[0] > max(totals[1:]) + 100.0


def test_no_step_is_taken_from_a_wander_that_lies_far_behind_errors_of_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    scorer = _both(one_memory=True)
    monkeypatch.setattr(memories, "_uphill", None)
    found, _ = scorer.best_memory(scorer.score((), WHITE))
    assert found.pose and found.wander is None
    memory, _ = scorer.best_memory(scorer.score((), found))
    assert memory == found


def test_errors_of_poses_cost_what_an_unknown_costs_unless_they_are_of_visits() -> None:
    system = system_of()
    assert prior_of(Memory(None, 1.0), system) == -BLOCK_ODDS
    assert prior_of(Memory(None, 1.0), replace(system, by_visit=True)) == -MEMORY_ODDS
