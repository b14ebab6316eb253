"""Swaps: which atoms may do the work of one of a set, told beside the whole set, before any is screened without it.

Without an atom a of a set S, its values held at b_a and the variances of the others as they are, the others move so
that what is left grows by X u,

    u = Sigma[:, a] Sigma_aa^-1 b_a,

X the columns of the set and Sigma its covariance. An atom of columns Z that is screened beside S has Z^T r in the sums
of what is left; beside S less a it has Z^T r + Z^T X u, and its Schur complement is larger. So it takes at most

    (Z^T r + h)^T M (Z^T r + h) - (Z^T r)^T M (Z^T r),   h = Z^T X u,   M = (complement beside S + 1 / variance)^-1,

more of the sum of squares than it does beside S, at the largest variance that it may have: an upper bound of what the
screen beside S less a would say. Hardly any atom passes it, so hardly any is screened.
"""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.screen import Allowed

if TYPE_CHECKING:
    from ptt.diagnosis.evidence.score import Scorer
    from ptt.diagnosis.evidence.state import State


def replacements(
    scorer: "Scorer", state: "State", keys: Sequence[str], allowed: Allowed, near: float
) -> dict[str, set[str]]:
    """Atoms that may be worth a look in the place of each atom of a set.

    Args:
        scorer: of the system.
        state: the set.
        keys: of its atoms that may go.
        allowed: atoms that may come.
        near: nats by which one may be worth less than the atom that goes.

    Returns:
        For each key those that may do as well, and those that it alone keeps out.
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


def _worth(scorer: "Scorer", state: "State", key: str) -> float:
    """What the screen would say of an atom of a set beside the others, their variances as they are, and its form."""
    own, posterior, atom = state.of(key), state.posterior, scorer.system.atoms[key]
    spread = state.inverse[np.ix_(own, own)]
    values = posterior.values[own]
    left, nats = posterior.penalised_square, scorer.system.nats_of_noise
    taken = float(values @ np.linalg.solve(spread, values))
    volume = np.linalg.slogdet(spread)[1] - np.log(posterior.prior_variance[own]).sum()
    return float(nats(left) - nats(left + taken) + 0.5 * volume) - atom.odds + state.forms.get(key, 0.0)


def _pull(state: "State", key: str) -> np.ndarray:
    """How the values of a set and of an atom of it, held, move what is left when the atom goes, (p,)."""
    own = state.of(key)
    rows = state.inverse[:, own]
    return np.asarray(rows @ np.linalg.solve(rows[own], state.posterior.values[own]))


def _more(
    scorer: "Scorer", state: "State", atoms: Collection[Atom], columns: np.ndarray, pulls: np.ndarray
) -> np.ndarray:
    """Nats that atoms of one width w may take beyond those that they take beside the whole set, (atoms, keys)."""
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
