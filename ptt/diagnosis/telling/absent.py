"""Effects that are not named but may be present, and how they would change the stated values."""

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
    """An effect that is not in the set and that no reading excludes.

    Attributes:
        key: of its atom.
        odds: of the set with it against the set without it.
        moved: second moments of the shifts of the set's values that it would cause, (p, p).
    """

    key: str
    odds: float
    moved: np.ndarray


def absent_effects(scorer: Scorer, state: State, *, drawn: bool = False) -> tuple[Absent, ...]:
    """Effects that may be present beside a set because they do nearly the same as its effects.

    A spring that yields as another one does is not needed, so it is not named, but little speaks against it except the
    prior odds of one more effect. If present, the values of the set would be different. The prior odds are tempered as
    in probabilities. The evidence of the readings against an effect counts in full, or each of twenty well-determined
    effects would make all values a little less certain. Sizes of the drawing are off on every machine and are treated
    together (`ptt.fitting.beside_unnamed`).

    Args:
        scorer: of the system.
        state: the reported set.
        drawn: whether to include sizes of the drawing, because nothing else does.

    Returns:
        Those with odds that matter.
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
        follow = np.empty_like(half)  # shift of the set's values per unit of the effect's
        follow[posterior.order] = -dtrtrs(posterior.cholesky, half, lower=1, trans=1)[0]
        left = _positive_part(schur_complement(sums.gram[own, own][None], half.T[None])[0])
        covariance = inverse(left + np.diag(1.0 / gain.variances[atom.group]))
        values = covariance @ (sums.side[own] + follow.T @ sums.side[:width])
        squares = posterior.phi * covariance + np.outer(values, values)
        odds = float(np.exp(min(gain.nats + atom.odds, 0.0) - atom.odds / TEMPER))
        found.append(Absent(atom.key, odds, follow @ squares @ follow.T))
    return tuple(found)


def _is_rare(atom: Atom) -> bool:
    """Whether an atom is an effect that most machines do not have."""
    return is_effect(atom) and not is_drawn(atom)


def _positive_part(gram: np.ndarray) -> np.ndarray:
    """A symmetric matrix (w, w) less eigenvalues that are rounding: those not above minus the smallest one."""
    eigenvalues, vectors = np.linalg.eigh(gram)
    return np.asarray(vectors * np.where(eigenvalues > max(-eigenvalues[0], 0.0), eigenvalues, 0.0) @ vectors.T)
