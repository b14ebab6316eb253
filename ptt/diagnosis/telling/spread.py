"""How far stated values may be off: by widths that are learned, by sets that do as well, by what is not named."""

from collections.abc import Iterator, Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.probability import near_sets
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.telling.absent import Absent
from ptt.run.tails import t_ppf

TWO_SIDED = 0.975  # quantile of a two-sided interval of 95 %
LEAST_VALUES = 2.0  # degrees of freedom of a learned variance at the least: its own prior is worth no fewer


def spread_of(scorer: Scorer, state: State, key: str, absent: Sequence[Absent] = ()) -> np.ndarray:
    """Standard deviations of the linear values of an atom, in their units, (w,).

    Args:
        scorer: that has scored the sets.
        state: the one that is told.
        key: of one of its atoms.
        absent: effects that may be there beside it.
    """
    scale, atoms = scorer.system.scale, scorer.system.atoms
    told, own = values_of(state, atoms[key], scale), state.of(key)
    weights, squares = [1.0], [square_errors(scorer, state, atoms[key])]
    for each in absent:
        weights.append(each.odds)
        squares.append(squares[0] + _of_values(atoms[key], each.moved[np.ix_(own, own)], scale))
    for odds, rival in near_sets(scorer, state):
        there = next((other for other in rival.keys if atoms[other].name == atoms[key].name), None)
        if there is None:
            continue
        weights.append(odds)
        squares.append(square_errors(scorer, rival, atoms[there]) + (values_of(rival, atoms[there], scale) - told) ** 2)
    return np.asarray(np.sqrt(np.average(squares, axis=0, weights=weights)))


def values_of(state: State, atom: Atom, scale: np.ndarray) -> np.ndarray:
    """Linear values of an atom of a set in their units, (w,); `scale` of all columns of the system."""
    return atom.amplitudes(state.posterior.values[state.of(atom.key)], scale)


def square_errors(scorer: Scorer, state: State, atom: Atom) -> np.ndarray:
    """Mean squares by which the linear values of an atom may be off in one set, in their units squared, (w,).

    How wide the values of each kind are is itself learned, from as many of them as the readings decide. What they do
    not decide, such as what all sliders have in common, follows Student's law with so few degrees of freedom; and all
    values move with the widths.

    Source: Kass and Steffey, Approximate Bayesian inference in conditionally independent hierarchical models, Journal
    of the American Statistical Association 84 (1989).
    """
    own, phi, inverse = state.of(atom.key), state.posterior.phi, state.inverse
    covariance, prior = phi * inverse[np.ix_(own, own)], state.posterior.prior_variance
    wider = {}
    for name, group in _groups(scorer, state):
        across = inverse[np.ix_(own, group)]
        decided = float((1.0 - inverse[group, group] / prior[group]).sum())
        wider[name] = _wider(decided)
        moved = across @ (state.posterior.values[group] / prior[group])
        unseen = phi * (across / prior[group]) @ across.T
        covariance = (
            covariance + (wider[name] - 1.0) * unseen + np.outer(moved, moved) * (2.0 / max(decided, LEAST_VALUES))
        )
    known = _of_values(atom, covariance, scorer.system.scale)
    if atom.reduction is None:
        return known
    ways, before = atom.reduction.basis, state.variances[atom.key][atom.reduction.group] * phi
    before = before * np.array([wider.get((atom.key, group), _wider(0.0)) for group in atom.reduction.group.tolist()])
    unseen = before * np.maximum(1.0 - np.square(ways).sum(axis=1), 0.0)
    return np.asarray(known + unseen * atom.sizes(scorer.system.scale) ** 2)


def _of_values(atom: Atom, covariance: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Mean squares of an atom's linear values in their units, (w,), from a covariance of its columns."""
    if atom.reduction is None:
        return np.asarray(np.diag(covariance) * atom.sizes(scale) ** 2)
    ways = atom.reduction.basis
    return np.asarray(np.einsum("ij,jk,ik->i", ways, covariance, ways, optimize=True) * atom.sizes(scale) ** 2)


def _groups(scorer: Scorer, state: State) -> Iterator[tuple[tuple[str, int], np.ndarray]]:
    """Places of the columns that share a learned width, of every atom of a set."""
    for key in state.keys:
        atom, places = scorer.system.atoms[key], state.of(key)
        for group in np.unique(atom.group).tolist():
            yield (key, group), places[atom.group == group]


def _wider(decided: float) -> float:
    """By how much a variance of learned width exceeds that of a known one, where both hold 95 % within two of them."""
    return float((t_ppf(TWO_SIDED, max(decided, LEAST_VALUES)) / t_ppf(TWO_SIDED, np.inf)) ** 2)
