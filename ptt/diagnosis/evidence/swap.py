"""Swaps: which atoms may replace one of a set, bounded from the screen beside the whole set.

Take an atom a with values b_a out of a set S, the prior variances of the others held. The values of the others adjust,
and the residual grows by X u,

    u = Sigma[:, a] Sigma_aa^-1 b_a,

where X are the columns of the set and Sigma its posterior covariance. An atom with columns Z screened beside S has the
products Z^T r with the residual r; beside S less a it has Z^T r + Z^T X u, and a larger Schur complement. So it
explains at most

    (Z^T r + h)^T M (Z^T r + h) - (Z^T r)^T M (Z^T r),   h = Z^T X u,   M = (complement beside S + 1 / variance)^-1,

more of the sum of squares than it does beside S, at its largest allowed prior variance. Only atoms that this upper
bound lets through have to be screened beside S less a: hardly any.
"""

from collections.abc import Collection, Sequence

import numpy as np
from scipy.linalg import blas

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Allowed
from ptt.diagnosis.evidence.state import State


def replacements(
    scorer: Scorer, state: State, keys: Sequence[str], allowed: Allowed, near: float
) -> dict[str, set[str]]:
    """Atoms that may be worth a look in the place of each atom of a set.

    Args:
        scorer: of the system.
        state: the set.
        keys: of its atoms that may go.
        allowed: atoms that may come.
        near: nats by which one may be worth less than the atom that goes.

    Returns:
        Key of an atom of the set -> keys of atoms that may do as well, and of those that it alone excludes.
    """
    if not keys:
        return {}
    atoms = scorer.system.atoms
    gains = {gain.key: gain.nats for gain in scorer.all_gains(state, allowed)}
    found = {}
    worth = np.array([_worth(scorer, state, key) for key in keys])
    for key in keys:
        name, may_come = atoms[key].name, scorer.opens([other for other in state.keys if other != key])
        barred = (atom for atom in atoms.values() if atom.key not in gains and atom.name != name)
        found[key] = {atom.key for atom in barred if allowed(atom) and may_come(atom)}
    pulls = np.stack([_pull(state, key) for key in keys], axis=1)  # shape: (p, keys)
    for family, columns in scorer.system.families:
        some = [i for i, atom in enumerate(family) if atom.key in gains]
        if some:
            more = _more(scorer, state, [family[i] for i in some], columns[some], pulls)
            for i, row in zip(some, more, strict=True):
                for index in np.flatnonzero(gains[family[i].key] + row > worth - near).tolist():
                    found[keys[index]].add(family[i].key)
    return found


def _worth(scorer: Scorer, state: State, key: str) -> float:
    """The screen's gain of an atom of the set beside the others, all variances held, and the nats of its form."""
    own, posterior, atom = state.of(key), state.posterior, scorer.system.atoms[key]
    inverse = state.inverse[np.ix_(own, own)]
    values = posterior.values[own]
    square, nats = posterior.penalised_square, scorer.system.nats_of_noise
    explained = float(values @ np.linalg.solve(inverse, values))
    log_det = np.linalg.slogdet(inverse)[1] - np.log(posterior.prior_variance[own]).sum()
    return float(nats(square) - nats(square + explained) + 0.5 * log_det) - atom.odds + state.forms.get(key, 0.0)


def _pull(state: State, key: str) -> np.ndarray:
    """The vector u above, (p,), the atom's own values included: without it the residual grows by X u."""
    own = state.of(key)
    rows = state.inverse[:, own]
    return np.asarray(rows @ np.linalg.solve(rows[own], state.posterior.values[own]))


def _more(scorer: Scorer, state: State, atoms: Collection[Atom], columns: np.ndarray, pulls: np.ndarray) -> np.ndarray:
    """Upper bound of the nats that atoms of w columns gain beyond their gain beside the whole set, (atoms, keys)."""
    posterior, sums = state.posterior, scorer.system.sums(state.memory)
    count, width = columns.shape
    order, own = posterior.order, columns.ravel()
    across = sums.across(state.columns[order], own)  # shape: (p, atoms w)
    side = (sums.side[own] - posterior.values[order] @ across).reshape(count, width)
    moved = (across.T @ pulls[order]).reshape(count, width, -1)
    gram = sums.own(columns).copy()
    if len(order):
        half = blas.dtrsm(1.0, posterior.cholesky, across.T, side=1, lower=1, trans_a=1)  # shape: (atoms w, p)
        half = half.reshape(count, width, -1)
        gram -= half @ half.transpose(0, 2, 1)
    every = np.arange(width)
    gram[:, every, every] = gram[:, every, every] * (1.0 + 1e-12) + [1.0 / atom.most[atom.group] for atom in atoms]
    solved = np.linalg.solve(gram, np.concatenate([moved, side[:, :, None]], axis=2))
    more = (moved * (solved[:, :, :-1] + 2.0 * solved[:, :, -1:])).sum(axis=1)
    return np.maximum(more, 0.0) / (2.0 * posterior.phi)
