"""Absent: what an effect that is not named would do just as one that is, and how far that leaves stated values open."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dtrtrs

from ptt.diagnosis.evidence.atoms import Atom, is_drawn, is_effect
from ptt.diagnosis.evidence.probability import LEAST_ODDS, TEMPER
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import schur_complement
from ptt.diagnosis.evidence.state import State
from ptt.fitting.factor import inverse


@dataclass(frozen=True)
class Absent:
    """An effect that a set does without, as far as no reading excludes it.

    Attributes:
        key: of its atom.
        odds: of the set with it beside the set without.
        moved: mean squares and products by which it would move the values of the set's columns, (p, p).
    """

    key: str
    odds: float
    moved: np.ndarray


def absent_effects(scorer: Scorer, state: State, *, drawn: bool = False) -> tuple[Absent, ...]:
    """Effects that may be there beside a set, since they would do next to nothing that the set does not do.

    A spring that gives way as another does: nothing asks for it, so it is not named, but little speaks against it
    beyond the odds against one more effect. Were it there, the values of the set would be others. Those odds keep names
    few and are weighed as probabilities are; what the readings themselves say against an effect counts in full, or each
    of a score that they know well would make all values a little worse. Sizes of the drawing are off on every machine,
    and are learned with all others (`ptt.fitting.beside_unnamed`).

    Args:
        scorer: of the system.
        state: the set that is told.
        drawn: whether sizes of the drawing are asked as well, because nothing else does.

    Returns:
        Those of odds that matter.
    """
    if not state.keys:
        return ()
    system, told = scorer.system, {scorer.system.atoms[key].name for key in state.keys}
    asked = scorer.screen(state, is_effect if drawn else _is_rare)
    gains = [gain for gain in asked if gain.nats > TEMPER * np.log(LEAST_ODDS)]
    atoms = [system.atoms[gain.key] for gain in gains]
    every = np.concatenate([state.columns, *(atom.columns for atom in atoms)]).astype(int)
    sums, width, found = system.sums_of(every, state.memory), len(state.columns), list[Absent]()
    first, posterior = width, state.posterior
    for gain, atom in zip(gains, atoms, strict=True):
        own = slice(first, first + len(atom.columns))
        first = own.stop
        if atom.name in told:
            continue
        half = dtrtrs(posterior.cholesky, sums.gram[posterior.order, own], lower=1)[0]
        follow = np.empty_like(half)  # how the values of the set go with those of the effect
        follow[posterior.order] = -dtrtrs(posterior.cholesky, half, lower=1, trans=1)[0]
        left = _seen(schur_complement(sums.gram[own, own][None], half.T[None])[0])
        spread = inverse(left + np.diag(1.0 / gain.variances[atom.group]))
        values = spread @ (sums.side[own] + follow.T @ sums.side[:width])
        squares = posterior.phi * spread + np.outer(values, values)
        odds = float(np.exp(min(gain.nats + atom.odds, 0.0) - atom.odds / TEMPER))
        found.append(Absent(atom.key, odds, follow @ squares @ follow.T))
    return tuple(found)


def _is_rare(atom: Atom) -> bool:
    """Whether an atom is an effect that most machines do not have."""
    return is_effect(atom) and not is_drawn(atom)


def _seen(gram: np.ndarray) -> np.ndarray:
    """What is left of some columns, less what rounding left of those that the set spans, (w, w)."""
    strength, ways = np.linalg.eigh(gram)
    return np.asarray(ways * np.where(strength > max(-strength[0], 0.0), strength, 0.0) @ ways.T)
