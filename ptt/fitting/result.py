"""The result of a fit: values, their covariance, and the directions that only the prior determines."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ptt.fitting.layout import Layout
from ptt.fitting.prior import Prior
from ptt.fitting.unnamed import Unnamed
from ptt.model.chain import Prediction
from ptt.model.model import Model
from ptt.run.axes import rms
from ptt.run.noise import Noise
from ptt.run.problem import Problem

MOST_UNSEEN = 0.02  # share in unseen directions above which a parameter is not measured
UNMEASURED = 0.98  # share in them above which nothing of it is: below it, combinations with others are
MEASURED_SHARE = 0.5  # share of its prior variance below which a value counts as measured


@dataclass(frozen=True)
class FitResult:
    """The result of a fit.

    Attributes:
        model: the model with fitted parameters.
        layout: order of the unknowns.
        unknowns: (u,) fitted values in usual sizes.
        covariance: posterior covariance of the unknowns in their own units, (u, u), scaled up where the fit leaves more
            than noise.
        information: information on the unknowns in usual sizes, (u, u): of the rows, and of the prior of `held` values,
            but of no other prior.
        prediction: of all rows, masked ones included.
        residual: measured less predicted in the base frame, (n, 3) mm; NaN where not observed.
        outliers: rows left out as gross errors, (n,) bool.
        noise: the noise floor that weighted the fit.
        chi2: weighted sum of squares over the rows used.
        freedom: degrees of freedom.
        rank: number of directions that the data see.
        unseen: (u, m) directions, in units of `sizes`, that only the prior determines.
        prior: prior variances, and how much more than stated the rows scatter.
        iterations: evaluations of the derivative.
        status: 'converged' or what kept it from converging.
        doubt: (u, r) root of the further covariance by frames that base reflectors held, in usual sizes; None where
            none was held. Not part of `covariance`.
        unnamed: sizes of the drawing that the model does not have, and the further covariance by them; None where not
            computed. Not part of `covariance`, as the values make up for them where the run went.
        turns: travel of a wind-up of each joint that the readings cannot tell from the model's play, mm or rad; ()
            where not computed, or where there is no play.
        least: names of unknowns for which the readings give only a lower bound.
    """

    model: Model
    layout: Layout
    unknowns: np.ndarray
    covariance: np.ndarray
    information: np.ndarray
    prediction: Prediction
    residual: np.ndarray
    outliers: np.ndarray
    noise: Noise
    chi2: float
    freedom: int
    rank: int
    unseen: np.ndarray
    prior: Prior
    iterations: int
    status: str
    doubt: np.ndarray | None = None
    unnamed: Unnamed | None = None
    turns: tuple[float, ...] = ()
    least: tuple[str, ...] = ()

    @property
    def values(self) -> np.ndarray:
        """Fitted unknowns in their own units, (u,)."""
        return self.unknowns * self.layout.scale

    @property
    def sizes(self) -> np.ndarray:
        """How large each unknown may be, (u,) in usual sizes (`Prior.sizes`)."""
        return self.prior.sizes(self.layout)

    @property
    def scatter(self) -> float:
        """Reduced chi-squared, at least one."""
        return max(1.0, self.chi2 / max(self.freedom, 1))

    @property
    def std(self) -> np.ndarray:
        """Standard errors of the unknowns in their own units, (u,)."""
        more = sum(self._variances(root) for root in self._roots)
        return np.asarray(np.sqrt(np.diag(self.covariance) + more))

    @property
    def open(self) -> np.ndarray:
        """Further variances by sizes of the drawing not in the model, (u,) in own units squared; else zero."""
        if self.unnamed is None:
            return np.zeros(len(self.unknowns))
        return self._variances(self.unnamed.root[: len(self.unknowns)])

    def apart(self, own: np.ndarray) -> np.ndarray:
        """Standard errors of the differences of some unknowns from their mean, in their own units.

        Where a frame takes what all of them have in common, the differences are all that is known of them.

        Args:
            own: indices of the unknowns, (k,).

        Returns:
            (k,).
        """
        less = np.eye(len(own)) - 1.0 / len(own)
        roots = [self.layout.scale[own, None] * root[own] for root in self._roots]
        parts = [self.covariance[np.ix_(own, own)], *(root @ root.T for root in roots)]
        return np.asarray(np.sqrt(np.maximum(np.diag(less @ sum(parts) @ less), 0.0)))

    @property
    def _roots(self) -> list[np.ndarray]:
        """Roots of the further covariances, in usual sizes: `doubt` and `unnamed`."""
        beside = None if self.unnamed is None else self.unnamed.root[: len(self.unknowns)]
        return [root for root in (self.doubt, beside) if root is not None]

    def _variances(self, root: np.ndarray) -> np.ndarray:
        """Variances of the unknowns by the root of a covariance in usual sizes, (u,) in own units squared."""
        return np.asarray(np.square(root).sum(axis=1) * self.layout.scale**2)

    def unnamed_covariance(self, names: Sequence[str]) -> np.ndarray:
        """Further covariance of v unknowns by name, by sizes of the drawing not in the model, in usual sizes, (v, v).

        Zero where not computed, and for names that are no unknowns.
        """
        place = {name: number for number, name in enumerate(self.layout.names)}
        rows = np.zeros((len(names), 0 if self.unnamed is None else self.unnamed.root.shape[1]))
        for number, name in enumerate(names):
            if self.unnamed is not None and name in place:
                rows[number] = self.unnamed.root[place[name]]
        return np.asarray(rows @ rows.T)

    @property
    def measured(self) -> np.ndarray:
        """Unknowns that the data, not the prior, determine, (u,) bool."""
        own = np.diag(self.covariance) / self.layout.scale**2
        told = ((self.unseen**2).sum(axis=1) <= MOST_UNSEEN) & ~(self.layout.held & (own > MEASURED_SHARE))
        told &= ~np.isin(self.layout.names, self.least)
        if self.unnamed is None:
            return told
        return told & (self.open <= MEASURED_SHARE * (self.sizes * self.layout.scale) ** 2)


class Fitted(Protocol):
    """What a fit says of each row: its residual, (n, 3) mm, and whether it is a gross error, (n,) bool."""

    @property
    def residual(self) -> np.ndarray:
        """Measured less predicted in the base frame, (n, 3) mm; NaN where not observed."""

    @property
    def outliers(self) -> np.ndarray:
        """Rows left out as gross errors, (n,) bool."""


def sound_rows(problem: Problem, fitted: Fitted) -> np.ndarray:
    """Rows that count after a fit: observed, not masked, no gross error; (n,) bool."""
    return np.asarray(problem.used & ~fitted.outliers & np.isfinite(fitted.residual).all(axis=1))


def left_um(fitted: Fitted, problem: Problem) -> float:
    """Root mean square length of the residual over the rows that count, um."""
    return rms(fitted.residual, sound_rows(problem, fitted))["total"]
