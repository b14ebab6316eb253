"""Posterior of a linear problem: means and covariance of the unknowns, and the prior variances that were learned."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ptt.fitting.factor import factor_of, invert


@dataclass(frozen=True)
class Posterior:
    """Unknowns b of y = X b + e at the prior variances with the largest evidence (marginal likelihood).

    Prior variances and covariances are in units of the white variance `phi` where it is said.

    Attributes:
        values: (P,) posterior means, in units of the columns.
        cholesky: (P, P) lower L with L L^T = X^T X + diag(1 / prior_variance), rows and columns in `order`.
        order: (P,) the unknowns, sorted by group.
        prior_variance: (P,) of each unknown, in units of `phi`.
        group_variances: (G,) learned prior variance of each group, in units of `phi`.
        curvature: (G, G) minus the Hessian of `total` in the logarithms of `group_variances`, where the last step
            began.
        total: the maximised objective in nats: log evidence at these variances, up to a constant of the data alone,
            plus the log prior density of the variances over its peak.
        penalised_square: Q = |y - X b|^2 + b^T diag(1 / prior_variance) b.
        phi: white variance, (freedom + Q) / (freedom + count).
        evaluations: of the evidence, until it ended.
        stopped_early: whether the ascent was given up, as `total` would not reach what was asked for.
    """

    values: np.ndarray
    cholesky: np.ndarray
    order: np.ndarray
    prior_variance: np.ndarray
    group_variances: np.ndarray
    curvature: np.ndarray
    total: float
    penalised_square: float
    phi: float
    evaluations: int
    stopped_early: bool = False

    @property
    def inverse(self) -> np.ndarray:
        """(X^T X + diag(1 / prior_variance))^-1, (P, P): the covariance in units of `phi`."""
        place = np.argsort(self.order)
        return invert(self.cholesky)[np.ix_(place, place)]

    @property
    def precision(self) -> np.ndarray:
        """X^T X + diag(1 / prior_variance), (P, P)."""
        place = np.argsort(self.order)
        return np.asarray((self.cholesky @ self.cholesky.T)[np.ix_(place, place)])

    def inverse_of(self, some: np.ndarray) -> np.ndarray:
        """The block of `inverse` that belongs to some unknowns, (m,) indices -> (m, m)."""
        place = np.argsort(self.order)[some]
        unit = np.zeros((len(self.order), len(some)))
        unit[place, np.arange(len(some))] = 1.0
        along = lapack.dtrtrs(self.cholesky, unit, lower=1)[0]
        return np.asarray(along.T @ along)

    def savage_dickey(self, some: np.ndarray) -> float:
        """Log evidence gained by setting some unknowns to zero, the prior variances held, nats.

        Args:
            some: (m,) indices.
        """
        return savage_dickey_nats(self.values[some], self.inverse_of(some), self.prior_variance[some], self.phi)

    @property
    def covariance(self) -> np.ndarray:
        """Of the unknowns given the prior variances, (P, P)."""
        return self.phi * self.inverse


def savage_dickey_nats(values: np.ndarray, inverse: np.ndarray, prior_variance: np.ndarray, phi: float) -> float:
    """Savage-Dickey ratio: log of the posterior density of some unknowns at zero over their prior density there.

    Args:
        values: posterior means, (m,).
        inverse: posterior covariance in units of `phi`, (m, m).
        prior_variance: of each, in units of `phi`, (m,).
        phi: white variance.

    Returns:
        Nats.

    Source: Dickey, The weighted likelihood ratio, Annals of Mathematical Statistics 42 (1971).
    """
    factor = factor_of(inverse, 0.0)
    along = lapack.dtrtrs(factor, values, lower=1)[0]
    log_ratio = 0.5 * float(np.log(prior_variance).sum()) - float(np.log(factor.diagonal()).sum())
    return log_ratio - 0.5 * float(along @ along) / phi
