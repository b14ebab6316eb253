"""Joints that are best said to be sound: against the evidence of problems without them, and of all ways to choose."""

from itertools import combinations
from math import comb, log

import numpy as np
import pytest

from ptt.diagnosis.evidence.idle import idle_joints
from ptt.fitting.evidence import maximise
from ptt.fitting.posterior import Posterior

JOINTS, ROWS = 5, 60


def learned(seed: int, busy: int, each: int, alike: float) -> Posterior:
    """Columns of all joints, as like each other as asked for; so many of them have values."""
    random = np.random.default_rng(seed)
    common = random.normal(size=(ROWS, 1))
    columns = alike * common + random.normal(size=(ROWS, JOINTS * each))
    truth = np.repeat(random.permutation(JOINTS) < busy, each) * random.normal(0.0, 2.0, JOINTS * each)
    readings = columns @ truth + random.normal(size=ROWS)
    owner = np.zeros(JOINTS * each, dtype=int)
    return maximise(
        columns.T @ columns, columns.T @ readings, float(readings @ readings), float(ROWS), owner, freedom=1e6
    )


def nats_of(known: Posterior, joint: np.ndarray, sound: tuple[int, ...]) -> float:
    """What is gained where just these joints are sound, worked out as the posterior does."""
    some = np.flatnonzero(np.isin(joint, sound))
    return known.savage_dickey(some) - log(comb(JOINTS, len(sound)) * JOINTS)


@pytest.mark.parametrize("each", [1, 3])
@pytest.mark.parametrize("alike", [0.0, 3.0])
@pytest.mark.parametrize("busy", [1, 2, 5])
def test_sound_joints_are_those_of_all_ways_to_choose_that_gain_most(busy: int, alike: float, each: int) -> None:
    joint, best = np.repeat(np.arange(JOINTS), each), 0
    for seed in range(20):
        known = learned(seed, busy, each, alike)
        ways = [some for count in range(1, JOINTS) for some in combinations(range(JOINTS), count)]
        most = max(nats_of(known, joint, some) for some in ways)
        found = idle_joints(joint, known.values, known.inverse, known.prior_variance, known.phi)
        if found is None:
            assert most < 0.1
            best += 1
            continue
        sound = tuple(np.unique(joint[found.columns]).tolist())
        assert found.nats == pytest.approx(nats_of(known, joint, sound), rel=1e-6)
        assert found.nats > most - 1.0  # one after the other is not all at once
        best += found.nats > most - 1e-6
    assert best >= 18


def test_either_of_two_joints_that_look_alike_may_be_sound_but_not_both() -> None:
    random = np.random.default_rng(1)
    columns = random.normal(size=(ROWS, 4))
    columns[:, 1] = columns[:, 0] + 1e-3 * random.normal(size=ROWS)
    readings = 3.0 * columns[:, 0] + random.normal(size=ROWS)
    known = maximise(
        columns.T @ columns,
        columns.T @ readings,
        float(readings @ readings),
        float(ROWS),
        np.zeros(4, int),
        freedom=1e6,
    )
    found = idle_joints(np.arange(4), known.values, known.inverse, known.prior_variance, known.phi)
    assert found is not None and found.columns[2:].all() and not found.columns[:2].all()


def test_what_is_given_back_with_a_sound_joint_is_taken_off_the_odds() -> None:
    known, joint = learned(3, 1, 1, 0.0), np.arange(JOINTS)
    plain = idle_joints(joint, known.values, known.inverse, known.prior_variance, known.phi)
    given = idle_joints(joint, known.values, known.inverse, known.prior_variance, known.phi, np.full(JOINTS, 0.25))
    assert plain is not None and given is not None and (plain.columns == given.columns).all()
    assert given.nats - plain.nats == pytest.approx(0.25 * plain.columns.sum())
