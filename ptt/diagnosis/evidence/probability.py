"""Probabilities of names and verdicts, from all sets of atoms that the search scored."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.noise_level import wanders_beyond
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.noise.memory import Memory

TEMPER = 4.0  # nats of the score that count as one, because effects, blocks and noise have only approximate forms
# Odds against the reported set from which another counts: a value one sigma away then moves sigma by 1 %
LEAST_ODDS = 0.02
MOST_SETS = 12  # of these, at most so many of the likeliest
VERDICTS = ("missing", "nothing-missing", "unknown")
# Probability that the truth is none of the scored sets: of the statements at 90 % and more 1.2 % are wrong, and no
# score can tell which.
LAPSE = 0.01


@dataclass(frozen=True)
class Probability:
    """Posterior probabilities over the scored sets.

    Attributes:
        effects: name of an effect -> probability that it is part of the explanation.
        verdict: verdict -> its probability.
    """

    effects: dict[str, float]
    verdict: dict[str, float]


def with_lapse(probability: float, ways: int = 2) -> float:
    """A probability that allows for the truth being none of the scored sets.

    Source: the lapse rate of psychometric functions, Wichmann and Hill, Perception & Psychophysics 63, 2001.

    Args:
        probability: over the scored sets.
        ways: how many outcomes there are; all are as likely where no set holds the truth.
    """
    return (1.0 - LAPSE) * probability + LAPSE / ways


def weigh_sets(scorer: Scorer) -> Probability:
    """Weigh every scored set by exp(score / `TEMPER`).

    Args:
        scorer: after the last search.

    Returns:
        The probabilities; of sets that differ only in shapes or values of the memory, the best one counts.
    """
    best: dict[tuple[frozenset[str], bool, bool], State] = {}
    for state in sorted(scorer.scored.values(), key=lambda state: -state.total):
        names, memory = _names(state, scorer), state.memory
        if np.isfinite(state.total):
            best.setdefault((names, memory.wander is None, memory.pose > 0.0), state)
    states = list(best.values())
    beyond = _faulty_memories(scorer, states)
    effects: defaultdict[str, float] = defaultdict(float)
    verdict = dict.fromkeys(VERDICTS, 0.0)
    for (names, *_), state in best.items():
        weight = float(np.exp((state.total - states[0].total) / TEMPER))
        verdict[verdict_of(state, scorer, beyond)] += weight
        for name in names:
            effects[name] += weight
    whole = sum(verdict.values())
    return Probability(
        {name: value / whole for name, value in effects.items()},
        {name: value / whole for name, value in verdict.items()},
    )


def near_sets(scorer: Scorer, state: State) -> Iterator[tuple[float, State]]:
    """Sets that do nearly as well as the reported one.

    Args:
        scorer: that has scored them.
        state: the reported set.

    Yields:
        Tempered odds of another set against it, at most one, and that set with its Cholesky factor.
    """
    least = state.total + TEMPER * np.log(LEAST_ODDS)
    near = [other for other in scorer.scored.values() if other is not state and least < other.total < np.inf]
    for other in sorted(near, key=lambda other: -other.total)[:MOST_SETS]:
        if (other.keys, other.memory) != (state.keys, state.memory):
            odds = float(np.exp(min(other.total - state.total, 0.0) / TEMPER))
            yield odds, scorer.score(other.keys, other.memory, other.variances)


def _names(state: State, scorer: Scorer) -> frozenset[str]:
    """Names that a set adds to the model as given; a second of a kind without a first counts as the first."""
    names = {scorer.system.atoms[key].name for key in state.keys}
    return frozenset(first_of(name, names) for name in names - set(scorer.given))


def _faulty_memories(scorer: Scorer, states: Sequence[State]) -> frozenset[Memory]:
    """Memories of the noise that are more than a tracker's; of each, the first of the states (best first) is tested."""
    first: dict[Memory, State] = {}
    for state in states:
        first.setdefault(state.memory, state)
    return frozenset(memory for memory, state in first.items() if wanders_beyond(scorer.system, state))


def verdict_of(state: State, scorer: Scorer, beyond: Collection[Memory]) -> str:
    """The verdict that a set implies; `beyond` are memories of the noise that are more than a tracker's."""
    atoms = [scorer.system.atoms[key] for key in state.keys if key not in scorer.given]
    if holds_unknown(scorer.system, state.keys, state.memory) or state.memory in beyond:
        return "unknown"
    return "missing" if atoms else "nothing-missing"
