"""One scored set of atoms with its posterior."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.noise.memory import Memory
from ptt.fitting.posterior import Posterior


@dataclass(frozen=True)
class State:
    """One set of atoms under one memory of the noise, with its posterior.

    Attributes:
        keys: of the atoms, sorted.
        memory: of the noise.
        total: the score: log evidence plus log prior odds, nats; minus infinity where physics excludes the set.
        posterior: of the frame and the atoms.
        columns: indices of the posterior's columns in the system.
        owner: (p,) number of the atom of each column, -1 for the frame.
        variances: key of an atom -> its learned prior variances, (g,), in units of the white variance.
        forms: key of an atom -> nats for or against the pattern of its values, beside the normal prior.
    """

    keys: tuple[str, ...]
    memory: Memory
    total: float
    posterior: Posterior
    columns: np.ndarray
    owner: np.ndarray
    variances: Mapping[str, np.ndarray]
    forms: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_whole(self) -> bool:
        """Whether its Cholesky factor is kept, so that atoms can be screened beside it."""
        return len(self.posterior.cholesky) == len(self.columns)

    def without_factor(self) -> "State":
        """The same without the Cholesky factor of its posterior, which takes nearly all of its memory."""
        return replace(self, posterior=replace(self.posterior, cholesky=np.empty((0, 0))))

    def of(self, key: str) -> np.ndarray:
        """Places of an atom's columns among the posterior's."""
        return np.flatnonzero(self.owner == self.keys.index(key))

    def worth(self, key: str) -> float:
        """Half of the Wald statistic of an atom's values, nats: about what the set loses without it."""
        own = self.of(key)
        values, covariance = self.posterior.values[own], self.posterior.phi * self.inverse[np.ix_(own, own)]
        factor, failed = lapack.dpotrf(covariance, lower=1)
        if failed:
            return 0.5 * float(values @ np.linalg.lstsq(covariance, values, rcond=1e-12)[0])
        return 0.5 * float(values @ lapack.dpotrs(factor, values, lower=1)[0])

    @cached_property
    def inverse(self) -> np.ndarray:
        """(X^T X + diag(1 / prior variance))^-1, (p, p): posterior covariance in units of the white variance."""
        return self.posterior.inverse

    @property
    def covariance(self) -> np.ndarray:
        """Posterior covariance, (p, p)."""
        return self.posterior.phi * self.inverse

    @property
    def effective_parameters(self) -> float:
        """Effective number of parameters that the readings determine (MacKay's gamma, frame included)."""
        return len(self.columns) - float((np.diag(self.inverse) / self.posterior.prior_variance).sum())

    @property
    def std(self) -> np.ndarray:
        """Posterior standard deviations, (p,)."""
        return np.sqrt(self.posterior.phi * self.inverse.diagonal())

    def amounts(self, atoms: Sequence[Atom], scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linear values of some atoms, concatenated, and their posterior covariance, in their units, (w,) and (w, w).

        Directions that were dropped because the rows do not show them keep their prior variance.

        Args:
            atoms: of the set.
            scale: (P,) of all columns of the system.
        """
        own, phi = np.concatenate([self.of(atom.key) for atom in atoms]), self.posterior.phi
        values = [atom.amplitudes(self.posterior.values[self.of(atom.key)], scale) for atom in atoms]
        size = np.concatenate([atom.sizes(scale) for atom in atoms])
        bases = (np.eye(len(a.columns)) if a.reduction is None else a.reduction.basis for a in atoms)
        basis = linalg.block_diag(*bases)
        groups = [
            (atom.group if atom.reduction is None else atom.reduction.group, self.variances[atom.key]) for atom in atoms
        ]
        prior_std = np.sqrt(phi * np.concatenate([variances[group] for group, variances in groups]))
        unseen = prior_std[:, None] * (np.eye(len(basis)) - basis @ basis.T) * prior_std
        covariance = basis @ self.covariance[np.ix_(own, own)] @ basis.T + unseen
        return np.concatenate(values), size[:, None] * covariance * size

    def errors(self, atom: Atom, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Posterior and prior standard deviations of an atom's linear values, in their units, (w,) each.

        Args:
            atom: the atom.
            scale: (P,) of all columns of the system.
        """
        own, phi, size = self.of(atom.key), self.posterior.phi, atom.sizes(scale)
        if atom.reduction is None:
            return self.std[own] * size, np.sqrt(self.posterior.prior_variance[own] * phi) * size
        basis, prior = atom.reduction.basis, self.variances[atom.key][atom.reduction.group] * phi
        unseen = prior * np.maximum(1.0 - np.square(basis).sum(axis=1), 0.0)
        seen = np.einsum("ij,jk,ik->i", basis, phi * self.inverse[np.ix_(own, own)], basis, optimize=True)
        return np.sqrt(seen + unseen) * size, np.sqrt(prior) * size


def without(state: State, *keys: str) -> tuple[str, ...]:
    """The keys of a state less some."""
    return tuple(key for key in state.keys if key not in keys)
