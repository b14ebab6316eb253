"""Stated standard errors: posterior, learned prior variances, sets that score nearly as well, effects not named."""

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
    """Standard errors of the linear values of an atom, averaged over sets by their odds, in their units, (w,).

    Args:
        scorer: that has scored the sets.
        state: the reported set.
        key: of one of its atoms.
        absent: effects that may be present beside it.
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
    """Linear values of an atom of a set in their units, (w,); `scale`: of all columns of the system, (P,)."""
    return atom.amplitudes(state.posterior.values[state.of(atom.key)], scale)


def square_errors(scorer: Scorer, state: State, atom: Atom) -> np.ndarray:
    """Variances of the linear values of an atom in one set, in their units squared, (w,).

    The prior variance of each kind of value is itself learned, from the effective number of them that the readings
    determine. Directions that they do not determine, such as what all sliders have in common, follow Student's t with
    that many degrees of freedom; and all values shift with the prior variances (first-order correction).

    Source: Kass and Steffey, Approximate Bayesian inference in conditionally independent hierarchical models, Journal
    of the American Statistical Association 84 (1989).
    """
    own, phi, inverse = state.of(atom.key), state.posterior.phi, state.inverse
    covariance, prior = phi * inverse[np.ix_(own, own)], state.posterior.prior_variance
    inflation = {}
    for name, group in _groups(scorer, state):
        across = inverse[np.ix_(own, group)]
        effective = float((1.0 - inverse[group, group] / prior[group]).sum())
        inflation[name] = _inflation(effective)
        moved = across @ (state.posterior.values[group] / prior[group])
        unseen = phi * (across / prior[group]) @ across.T
        covariance = (
            covariance
            + (inflation[name] - 1.0) * unseen
            + np.outer(moved, moved) * (2.0 / max(effective, LEAST_VALUES))
        )
    known = _of_values(atom, covariance, scorer.system.scale)
    if atom.reduction is None:
        return known
    basis, before = atom.reduction.basis, state.variances[atom.key][atom.reduction.group] * phi
    before = before * np.array(
        [inflation.get((atom.key, group), _inflation(0.0)) for group in atom.reduction.group.tolist()]
    )
    unseen = before * np.maximum(1.0 - np.square(basis).sum(axis=1), 0.0)
    return np.asarray(known + unseen * atom.sizes(scorer.system.scale) ** 2)


def _of_values(atom: Atom, covariance: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Variances of an atom's linear values in their units squared, (w,), from a covariance of its columns."""
    if atom.reduction is None:
        return np.asarray(np.diag(covariance) * atom.sizes(scale) ** 2)
    basis = atom.reduction.basis
    return np.asarray(np.einsum("ij,jk,ik->i", basis, covariance, basis, optimize=True) * atom.sizes(scale) ** 2)


def _groups(scorer: Scorer, state: State) -> Iterator[tuple[tuple[str, int], np.ndarray]]:
    """(Atom key, group) -> indices of the columns that share a learned prior variance, for all atoms of a set."""
    for key in state.keys:
        atom, places = scorer.system.atoms[key], state.of(key)
        for group in np.unique(atom.group).tolist():
            yield (key, group), places[atom.group == group]


def _inflation(effective: float) -> float:
    """Variance factor that gives a normal 95 % interval the width of Student's t with so many degrees of freedom."""
    return float((t_ppf(TWO_SIDED, max(effective, LEAST_VALUES)) / t_ppf(TWO_SIDED, np.inf)) ** 2)
