"""Posterior: what is known of the unknowns of a linear problem, their values as well as how wide they are."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ptt.fitting.factor import factor_of, invert


@dataclass(frozen=True)
class Posterior:
    """Unknowns of a linear problem at the prior variances that make the data most probable.

    Attributes:
        values: (P,) posterior mean, in units of the columns.
        cholesky: (P, P) lower L with L L^T = X^T X + diag(1 / prior), rows and columns in `order`.
        order: (P,) the unknowns, group by group.
        prior: (P,) variance of each unknown before the data, in units of `phi`.
        scales: (G,) learned variance of each group, in units of `phi`.
        curvature: (G, G) minus the second derivative of `total` by the logarithms of `scales`, where the last step
            began.
        total: what is maximised, nats: log marginal likelihood at these scales, up to a constant of the data alone, and
            log prior density of the scales over its peak.
        left: Q = |y - X values|^2 + values^T diag(1 / prior) values.
        phi: white variance, (freedom + Q) / (freedom + count).
        steps: evaluations of the evidence.
        ended: whether it ended because it would not reach the total that was asked for.
    """

    values: np.ndarray
    cholesky: np.ndarray
    order: np.ndarray
    prior: np.ndarray
    scales: np.ndarray
    curvature: np.ndarray
    total: float
    left: float
    phi: float
    steps: int
    ended: bool = False

    @property
    def inverse(self) -> np.ndarray:
        """(X^T X + diag(1 / prior))^-1, (P, P)."""
        place = np.argsort(self.order)
        return invert(self.cholesky)[np.ix_(place, place)]

    @property
    def precision(self) -> np.ndarray:
        """X^T X + diag(1 / prior), (P, P)."""
        place = np.argsort(self.order)
        return np.asarray((self.cholesky @ self.cholesky.T)[np.ix_(place, place)])

    def inverse_of(self, some: np.ndarray) -> np.ndarray:
        """What `inverse` has of (m,) unknowns, (m, m)."""
        place = np.argsort(self.order)[some]
        unit = np.zeros((len(self.order), len(some)))
        unit[place, np.arange(len(some))] = 1.0
        along = lapack.dtrtrs(self.cholesky, unit, lower=1)[0]
        return np.asarray(along.T @ along)

    def zeroed(self, some: np.ndarray) -> float:
        """Log evidence that is gained where some of the unknowns are zero, at these scales, nats.

        What they are believed to be at zero after the data over what they were before (Savage and Dickey).

        Args:
            some: (m,) which.
        """
        return nats_of_zero(self.values[some], self.inverse_of(some), self.prior[some], self.phi)

    @property
    def covariance(self) -> np.ndarray:
        """Of the unknowns given the scales, (P, P)."""
        return self.phi * self.inverse


def nats_of_zero(values: np.ndarray, inverse: np.ndarray, prior: np.ndarray, phi: float) -> float:
    """Log of what some unknowns are believed to be at zero after the data over what they were before.

    Args:
        values: posterior means, (m,).
        inverse: their covariance in units of `phi`, (m, m).
        prior: variance of each before the data, in units of `phi`, (m,).
        phi: white variance.
    """
    factor = factor_of(inverse, 0.0)
    along = lapack.dtrtrs(factor, values, lower=1)[0]
    width = 0.5 * float(np.log(prior).sum()) - float(np.log(factor.diagonal()).sum())
    return width - 0.5 * float(along @ along) / phi
