"""Probability of every statement, from all sets of atoms that the search looked at."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.score import Scorer, State

TEMPER = 4.0  # nats of the score that are worth one: the form of effects, blocks and noise is itself only approximate
VERDICTS = ("missing", "nothing-missing", "unknown")


@dataclass(frozen=True)
class Probability:
    """What the explored sets say together.

    Attributes:
        effects: name -> probability that it is part of the explanation.
        verdict: of each verdict.
    """

    effects: dict[str, float]
    verdict: dict[str, float]


def weigh_sets(scorer: Scorer) -> Probability:
    """Weigh every set that was scored by its tempered posterior odds.

    Args:
        scorer: after the last search.

    Returns:
        The probabilities; shapes of one effect count as one.
    """
    best: dict[frozenset[str], tuple[float, State]] = {}
    for state in scorer.scored.values():
        names = frozenset({scorer.system.atoms[key].name for key in state.keys} | {str(state.memory)})
        if np.isfinite(state.total) and (names not in best or state.total > best[names][0]):
            best[names] = state.total, state
    top = max(total for total, _ in best.values())
    effects: defaultdict[str, float] = defaultdict(float)
    verdict = dict.fromkeys(VERDICTS, 0.0)
    for total, state in best.values():
        weight = float(np.exp((total - top) / TEMPER))
        verdict[kind_of(state, scorer)] += weight
        for key in state.keys:
            if scorer.system.atoms[key].effect is not None and key not in scorer.given:
                effects[scorer.system.atoms[key].name] += weight
    whole = sum(verdict.values())
    return Probability(
        {name: value / whole for name, value in effects.items()},
        {name: value / whole for name, value in verdict.items()},
    )


def kind_of(state: State, scorer: Scorer) -> str:
    """Which verdict a set of atoms is."""
    atoms = [scorer.system.atoms[key] for key in state.keys if key not in scorer.given]
    odd = any(atom.block is not None for atom in atoms) or state.memory.pose > 0.0
    if odd or scorer.system.clock.is_fault(state.memory.wander):
        return "unknown"
    return "missing" if atoms else "nothing-missing"
