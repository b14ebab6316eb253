"""A screen says the whole evidence of an atom; rows are white under any memory; sums come as they are asked for."""

from functools import partial
from math import comb
from types import SimpleNamespace

import numpy as np
import pytest

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.row_sums import sums_of_rows
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import TRIDIAGONAL_COLUMNS, Basis, Screen
from ptt.diagnosis.evidence.swap import replacements
from ptt.diagnosis.noise.memory import WHITE, Memory, MemorySums
from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.noise.wander import Clock
from ptt.diagnosis.search.spectrum import FREQUENCY_STEP, JointWave, _pose_weight
from ptt.fitting.evidence import maximise, profile_noise
from ptt.run.noise import Noise

ROWS, FREEDOM = 40, 60.0


def white(count: int) -> dict[str, object]:
    """What a system says of its noise: white, of so many coordinates, as fine as any."""
    return {
        "freedom": FREEDOM, "restricted_count": float(count), "least_phi": 0.0,
        "nats_of_noise": lambda left: profile_noise(left, float(count), FREEDOM)[1],
    }  # fmt: skip


def evidence(columns: np.ndarray, prior: np.ndarray, values: np.ndarray) -> float:
    """Log of the multivariate t density of readings whose white variance is known with some degrees of freedom."""
    covariance = np.eye(len(values)) + (columns * prior) @ columns.T
    square = values @ np.linalg.solve(covariance, values)
    known = FREEDOM + len(values)
    return float(-0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * known * np.log((FREEDOM + square) / known))


def _same(sums: MemorySums, memory: Memory) -> MemorySums:
    return sums


@pytest.mark.parametrize("width", [4, TRIDIAGONAL_COLUMNS + 3])
def test_a_gain_is_the_evidence_of_both_together_less_that_of_the_set(width: int) -> None:
    random = np.random.default_rng(5)
    columns = random.normal(size=(3 * ROWS, 12 + width))
    columns[:, 9:16] += columns[:, 2:9]
    values = columns @ random.normal(0.0, 0.4, columns.shape[1]) + random.normal(size=3 * ROWS)
    own, group = np.array([4, 0, 2, 7]), np.array([1, 0, 0, 1])  # not in the order of their groups
    sums = sums_of_rows(columns.T, values, 0.0)
    part = sums.of(own)
    fixed = np.array([0.3, 5.0])
    posterior = maximise(part.gram, part.side, part.square, len(values), group, freedom=FREEDOM, start=fixed,
                         floor=fixed, ceiling=fixed)  # fmt: skip
    atoms = tuple(
        SimpleNamespace(
            key=str(i), name=str(i), groups=1, effect=None, odds=0.0, columns=np.arange(i, i + width), joint=None
        )
        for i in (8, 10, 12)
    )
    families = [(atoms, np.array([atom.columns for atom in atoms]))]
    system = SimpleNamespace(**white(len(values)), families=families, sums=partial(_same, sums))
    screen = Screen(system, Basis(own, posterior, WHITE), lambda atom: True, {})
    alone = evidence(columns[:, own], fixed[group], values)
    first = screen.best(lambda atom: atom.key == "10")
    assert [gain.key for gain in first] == ["10"] and list(screen.gains) == ["10"]
    for gain in screen.best(lambda atom: True):
        both = np.concatenate([own, np.arange(int(gain.key), int(gain.key) + width)])
        prior = np.concatenate([fixed[group], np.full(width, gain.variances[0])])
        np.testing.assert_allclose(gain.nats, evidence(columns[:, both], prior, values) - alone, atol=1e-7)


@pytest.mark.parametrize("busy", [1, 2, 7])
def test_an_effect_of_one_joint_of_seven_adds_no_less_than_that_joint_alone(busy: int) -> None:
    random = np.random.default_rng(8)
    columns = 20.0 * random.normal(size=(3 * ROWS, 7))
    values = columns[:, :busy] @ np.full(busy, 0.03) + random.normal(size=3 * ROWS)
    sums = sums_of_rows(columns.T, values, 0.0)
    none = np.zeros(0, dtype=int)
    posterior = maximise(np.zeros((0, 0)), np.zeros(0), float(values @ values), len(values), none, freedom=FREEDOM)
    part = {"groups": 1, "effect": object(), "odds": 0.0}
    every, few = np.arange(7), np.arange(busy)
    kinds = [("all", every, None), ("joints", every, every), ("few", few, None)]
    atoms = [SimpleNamespace(key=key, name=key, columns=chosen, joint=joint, **part) for key, chosen, joint in kinds]
    families = [((atom,), atom.columns[None]) for atom in atoms]
    system = SimpleNamespace(**white(len(values)), families=families, sums=partial(_same, sums))
    screen = Screen(system, Basis(none, posterior, WHITE), lambda atom: True, {})
    nats = {gain.key: gain.nats for gain in screen.best(lambda atom: True)}
    if busy == 7:
        assert nats["joints"] == nats["all"]
    else:
        assert nats["joints"] == pytest.approx(nats["few"] - np.log(comb(7, busy) * 7)) and nats["joints"] > nats["all"]


def test_a_line_in_the_spectrum_takes_what_least_squares_take() -> None:
    """Five visits of ten poses, each with an error to itself of twice the variance of the readings."""
    random = np.random.default_rng(9)
    q, slope = (np.tile(part, (5, 1)) for part in (random.uniform(5.0, 90.0, (10, 1)), random.normal(size=(10, 3))))
    left, pose = random.normal(size=(50, 3)), np.tile(np.arange(10), 5)
    system = SimpleNamespace(rows=np.arange(50), poses=poses_of(pose))
    for size in (0.0, 2.0):
        told = _pose_weight(system, size)
        along = JointWave(0, q[:, 0], told * (slope * left).sum(axis=1), told * np.square(slope).sum(axis=1))
        turns = np.arange(8.0, 100.0, FREQUENCY_STEP)
        gain = along.over(turns[0], FREQUENCY_STEP, len(turns))
        inverse = np.linalg.inv(np.eye(50) + size * (pose[:, None] == pose))
        for place in (0, 7, len(turns) - 1):
            phase = 2.0 * np.pi * turns[place] / along.span * q
            pair = np.stack([slope * np.cos(phase), slope * np.sin(phase)], axis=2)
            side = np.einsum("map,mn,na->p", pair, inverse, left)
            gram = np.einsum("map,mn,naq->pq", pair, inverse, pair)
            np.testing.assert_allclose(gain[place], side @ np.linalg.solve(gram, side), rtol=1e-9)


def test_no_atom_does_more_in_the_place_of_another_than_it_is_predicted() -> None:
    random, passed = np.random.default_rng(13), 0
    flat = random.normal(size=(15, 3, ROWS))
    flat[9:12] = flat[0:3] + 0.02 * flat[9:12]  # nearly what the first of the set is
    values = np.tensordot(random.normal(0.0, 1.5, 9), flat[:9], 1) + random.normal(size=(3, ROWS))
    atoms = {
        str(i): Atom(str(i), str(i), np.arange(3 * i, 3 * i + 3), np.zeros(3, int), np.full(1, 1e4), 9.0,
                     np.zeros(3, bool)) for i in range(5)
    }  # fmt: skip
    clock, none = Clock(np.arange(float(ROWS)), np.arange(ROWS) == 0), np.zeros((0, 3))
    system = RowSystem(
        np.arange(ROWS), np.zeros(0, int), atoms, clock, Noise(np.eye(3), "first guess"), FREEDOM, np.ones(15),
        flat.transpose(2, 1, 0), values.T, poses_of(np.arange(ROWS)), np.zeros(ROWS, int), {}, SimpleNamespace(),
        np.zeros((0, 3, 15)), none,
    )  # fmt: skip
    scorer = Scorer(system)
    state = scorer.score(("0", "1", "2"), WHITE)
    here = {gain.key: gain.nats for gain in scorer.screen(state)}
    found = replacements(scorer, state, state.keys, lambda atom: True, 5.0)
    assert replacements(scorer, scorer.score((), WHITE), (), lambda atom: True, 5.0) == {}
    for key in state.keys:
        chosen = [other for other in state.keys if other != key]
        prior = {other: state.variances[other] for other in chosen}
        own = np.concatenate([atoms[other].columns for other in chosen])
        sums = system.sums_of(own, WHITE)
        fixed = np.concatenate([prior[other] for other in chosen])
        posterior = maximise(sums.gram, sums.side, sums.square, system.restricted_count, np.repeat(np.arange(2), 3),
                             freedom=FREEDOM, start=fixed, floor=fixed, ceiling=fixed)  # fmt: skip
        screen = Screen(system, Basis(own, posterior, WHITE), scorer.opens(chosen), {})
        gains = {gain.key: gain.nats for gain in screen.best(lambda atom: True)}
        for other in ("3", "4"):
            if gains[other] > gains[key] - 4.0:
                assert other in found[key]
                passed += 1
    assert passed == 1 and "4" not in found["0"] and here["3"] < 0.0


def test_what_a_set_spans_already_has_nothing_left_but_rounding_of_either_sign() -> None:
    for seed in range(20):  # as of a run of copies of one row
        random = np.random.default_rng(seed)
        columns = 1e7 * random.normal(size=(3, 14))[[0, 1, 2] * ROWS]
        values = random.normal(size=3)[[0, 1, 2] * ROWS]
        own, group, fixed = np.arange(6), np.zeros(6, int), np.array([1e9])
        sums = sums_of_rows(columns.T, values, 0.0)
        part = sums.of(own)
        given = {"freedom": FREEDOM, "start": fixed, "floor": fixed, "ceiling": fixed}
        posterior = maximise(part.gram, part.side, part.square, len(values), group, **given)
        atom = SimpleNamespace(key="a", name="a", groups=2, effect=None, odds=0.0, columns=np.arange(6, 14),
                               group=np.arange(8) // 4, most=np.full(2, 1e5), joint=None)  # fmt: skip
        system = SimpleNamespace(**white(len(values)), families=[((atom,), atom.columns[None])],
                                 sums=partial(_same, sums))  # fmt: skip
        (gain,) = Screen(system, Basis(own, posterior, WHITE), lambda atom: True, {}).best(lambda atom: True)
        assert gain.nats < 1.0
