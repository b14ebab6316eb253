"""One set of atoms with its posterior: what a score leaves behind."""

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
        total: log evidence plus log prior odds, nats.
        posterior: of the frame and the atoms.
        columns: indices of the posterior's columns in the system.
        owner: (p,) number of the atom of each column, -1 for the frame.
        variances: learned variances of each atom, by key.
        forms: nats that the form of an atom's values is worth beside that of a linear prior, by key; none by default.
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
        """Whether its factor is there, so that something can be set beside it."""
        return len(self.posterior.cholesky) == len(self.columns)

    def without_factor(self) -> "State":
        """The same without the Cholesky factor of its posterior, nearly all of what it takes to keep."""
        return replace(self, posterior=replace(self.posterior, cholesky=np.empty((0, 0))))

    def of(self, key: str) -> np.ndarray:
        """Places of an atom's columns among the posterior's."""
        return np.flatnonzero(self.owner == self.keys.index(key))

    def worth(self, key: str) -> float:
        """About what an atom is worth: half of Wald's statistic of its values, nats."""
        own = self.of(key)
        values, spread = self.posterior.values[own], self.posterior.phi * self.inverse[np.ix_(own, own)]
        factor, failed = lapack.dpotrf(spread, lower=1)
        if failed:
            return 0.5 * float(values @ np.linalg.lstsq(spread, values, rcond=1e-12)[0])
        return 0.5 * float(values @ lapack.dpotrs(factor, values, lower=1)[0])

    @cached_property
    def inverse(self) -> np.ndarray:
        """(X^T X + diag(1 / prior))^-1, (p, p)."""
        return self.posterior.inverse

    @property
    def covariance(self) -> np.ndarray:
        """Of the posterior, (p, p)."""
        return self.posterior.phi * self.inverse

    @property
    def decided(self) -> float:
        """Degrees of freedom that the readings decide."""
        return len(self.columns) - float((np.diag(self.inverse) / self.posterior.prior_variance).sum())

    @property
    def std(self) -> np.ndarray:
        """Posterior standard deviations, (p,)."""
        return np.sqrt(self.posterior.phi * self.inverse.diagonal())

    def amounts(self, atoms: Sequence[Atom], scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linear values of some atoms, one behind the other, and their covariance, in their units, (w,) and (w, w).

        What the rows do not show of them is as wide as before the data.

        Args:
            atoms: of the set.
            scale: (P,) of all columns of the system.
        """
        own, phi = np.concatenate([self.of(atom.key) for atom in atoms]), self.posterior.phi
        values = [atom.amplitudes(self.posterior.values[self.of(atom.key)], scale) for atom in atoms]
        size = np.concatenate([atom.sizes(scale) for atom in atoms])
        ways = linalg.block_diag(*(np.eye(len(a.columns)) if a.turned is None else a.turned.ways for a in atoms))
        groups = [
            (atom.group if atom.turned is None else atom.turned.group, self.variances[atom.key]) for atom in atoms
        ]
        before = np.sqrt(phi * np.concatenate([variances[group] for group, variances in groups]))
        unseen = before[:, None] * (np.eye(len(ways)) - ways @ ways.T) * before
        spread = ways @ self.covariance[np.ix_(own, own)] @ ways.T + unseen
        return np.concatenate(values), size[:, None] * spread * size

    def errors(self, atom: Atom, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of an atom's linear values after and before the data, in their units, (w,) each.

        Args:
            atom: the atom.
            scale: (P,) of all columns of the system.
        """
        own, phi, size = self.of(atom.key), self.posterior.phi, atom.sizes(scale)
        if atom.turned is None:
            return self.std[own] * size, np.sqrt(self.posterior.prior_variance[own] * phi) * size
        ways, before = atom.turned.ways, self.variances[atom.key][atom.turned.group] * phi
        unseen = before * np.maximum(1.0 - np.square(ways).sum(axis=1), 0.0)
        after = np.einsum("ij,jk,ik->i", ways, phi * self.inverse[np.ix_(own, own)], ways, optimize=True) + unseen
        return np.sqrt(after) * size, np.sqrt(before) * size


def without(state: State, *keys: str) -> tuple[str, ...]:
    """The keys of a state less some."""
    return tuple(key for key in state.keys if key not in keys)
