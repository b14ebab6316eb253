"""Absent: what an effect that is not named would do just as one that is, and how far that leaves stated values open."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dtrtrs
from scipy.special import expit

from ptt.diagnosis.atoms import is_drawn, is_effect
from ptt.diagnosis.probability import LIKELY, TEMPER
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.screen import left_beside
from ptt.diagnosis.state import State
from ptt.fitting.factor import inverse

BARELY = TEMPER * float(np.log(LIKELY))  # nats below which an effect has no odds that matter


@dataclass(frozen=True)
class Absent:
    """An effect that a set does without, as far as no reading excludes it.

    Attributes:
        key: of its atom.
        odds: of the set with it beside the set without; zero of what has a chance.
        moved: mean squares and products by which it would move the values of the set's columns, (p, p).
        chance: that it is there, whatever else is, of a size of the drawing once one is off; zero of all others.
    """

    key: str
    odds: float
    moved: np.ndarray
    chance: float = 0.0


def absent_effects(scorer: Scorer, state: State) -> tuple[Absent, ...]:
    """Effects that may be there beside a set, since they would do next to nothing that the set does not do.

    Zeros that make good for leaning towers, in a frame that is fitted: nothing asks for them, so they are not named,
    but little speaks against them beyond the odds against one more effect. Were they there, the values of the set would
    be others. Those odds keep names few and are weighed as probabilities are; what the readings themselves say against
    an effect counts in full, or each of a score that they know well would make all values a little worse. Of a machine
    of which one size of the drawing is off it is even whether the next one is, however small: of these the readings
    alone decide.

    Args:
        scorer: of the system.
        state: the set that is told.

    Returns:
        Those of odds that matter.
    """
    if not state.keys:
        return ()
    system, told = scorer.system, {scorer.system.atoms[key].name for key in state.keys}
    off = any(is_drawn(system.atoms[key]) for key in state.keys)
    every = [gain for gain in scorer.screen(state, is_effect) if system.atoms[gain.key].name not in told]
    gains = [gain for gain in every if gain.nats > BARELY or (off and is_drawn(system.atoms[gain.key]))]
    atoms = [system.atoms[gain.key] for gain in gains]
    columns = np.concatenate([state.columns, *(atom.columns for atom in atoms)]).astype(int)
    sums, width, found = system.sums_of(columns, state.memory), len(state.columns), list[Absent]()
    first, posterior = width, state.posterior
    for gain, atom in zip(gains, atoms, strict=True):
        own = slice(first, first + len(atom.columns))
        first = own.stop
        half = dtrtrs(posterior.cholesky, sums.gram[posterior.order, own], lower=1)[0]
        follow = np.empty_like(half)  # how the values of the set go with those of the effect
        follow[posterior.order] = -dtrtrs(posterior.cholesky, half, lower=1, trans=1)[0]
        left = _seen(left_beside(sums.gram[own, own][None], half.T[None])[0])
        spread = inverse(left + np.diag(1.0 / gain.scales[atom.group]))
        values = spread @ (sums.side[own] + follow.T @ sums.side[:width])
        squares = posterior.phi * spread + np.outer(values, values)
        asked = gain.nats + atom.odds  # by the readings, before any odds against one more effect
        odds, chance = float(np.exp(min(asked, 0.0) - atom.odds / TEMPER)), 0.0
        if off and is_drawn(atom):
            odds, chance = 0.0, float(expit(asked))
        found.append(Absent(atom.key, odds, follow @ squares @ follow.T, chance))
    return tuple(found)


def _seen(gram: np.ndarray) -> np.ndarray:
    """What is left of some columns, less what rounding left of those that the set spans, (w, w)."""
    strength, ways = np.linalg.eigh(gram)
    return np.asarray(ways * np.where(strength > max(-strength[0], 0.0), strength, 0.0) @ ways.T)
