"""A fit and its limits: values, what is known of them, what only a prior holds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.fitting.layout import Layout
from ptt.fitting.prior import Prior
from ptt.fitting.unnamed import Unnamed
from ptt.model.chain import Prediction
from ptt.model.model import Model
from ptt.run.noise import Noise

MOST_UNSEEN = 0.02  # share in unseen directions above which a parameter is not measured
MEASURED_SHARE = 0.5  # share of its prior variance below which a value counts as measured


@dataclass(frozen=True)
class FitResult:
    """A fit and its limits.

    Attributes:
        model: the model with fitted parameters.
        layout: order of the unknowns.
        unknowns: (u,) fitted values in usual sizes.
        covariance: (u, u) of the unknowns in their own units; what the prior holds has the prior's. Wider than the
            noise says where the fit leaves more than noise.
        information: what is known of the unknowns in usual sizes, (u, u): by the rows, and by what an effect is
            defined without; no prior on unseen directions.
        prediction: of all rows, masked ones included.
        residual: measured less predicted in the base frame, (n, 3) mm; NaN where not observed.
        outliers: rows left out as gross errors, (n,) bool.
        noise: the noise floor that weighted the fit.
        chi2: weighted sum of squares over the rows used.
        freedom: degrees of freedom.
        rank: number of directions that the data see.
        unseen: (u, m) directions, in units of `sizes`, that only the prior holds.
        prior: how large the unknowns may be, and how much wider than stated the rows scatter.
        iterations: evaluations of the derivative.
        status: 'converged' or what kept it from converging.
        doubt: (u, r) how the unknowns go with what base reflectors leave open of the frames that they held, in usual
            sizes, the root of a covariance; None where none was held. The covariance is without it.
        unnamed: sizes of the drawing that the model does not have, and how far they leave the unknowns open; None where
            nobody asked. The covariance is without them: where the run went the values make good for them.
        turns: travel of a wind-up of each joint that the readings cannot tell from the play that the model has, mm or
            rad; () where nobody asked, or it has none.
        least: names of unknowns of which the readings tell only that they are no smaller.
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
        """How large each unknown may be, (u,) in usual sizes: those, or more where the rows ask for it."""
        return self.prior.sizes(self.layout)

    @property
    def scatter(self) -> float:
        """Mean square of what is left of the rows in units of their noise, one where that is less."""
        return max(1.0, self.chi2 / max(self.freedom, 1))

    @property
    def std(self) -> np.ndarray:
        """Standard errors of the unknowns in their own units, (u,)."""
        more = 0.0
        if self.doubt is not None:
            more = np.square(self.doubt).sum(axis=1) * self.layout.scale**2
        return np.asarray(np.sqrt(np.diag(self.covariance) + more + self.open))

    @property
    def open(self) -> np.ndarray:
        """Mean squares by which what is not named may move the unknowns, (u,) in their own units; zero if not asked."""
        if self.unnamed is None:
            return np.zeros(len(self.unknowns))
        return np.asarray(np.square(self.unnamed.root[: len(self.unknowns)]).sum(axis=1) * self.layout.scale**2)

    def apart(self, own: np.ndarray) -> np.ndarray:
        """Standard errors of what some unknowns are more than their mean, in their own units.

        Where a frame takes what all of them have in common, that is all that is known of them.

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
        """What else leaves the unknowns open, in usual sizes, each the root of a covariance."""
        beside = None if self.unnamed is None else self.unnamed.root[: len(self.unknowns)]
        return [root for root in (self.doubt, beside) if root is not None]

    def unnamed_covariance(self, names: Sequence[str]) -> np.ndarray:
        """Mean squares and products by which what is not named may move some unknowns, by name, in usual sizes, (v, v).

        Zero where nobody asked, and of what is no unknown.
        """
        place = {name: number for number, name in enumerate(self.layout.names)}
        rows = np.zeros((len(names), 0 if self.unnamed is None else self.unnamed.root.shape[1]))
        for number, name in enumerate(names):
            if self.unnamed is not None and name in place:
                rows[number] = self.unnamed.root[place[name]]
        return np.asarray(rows @ rows.T)

    @property
    def measured(self) -> np.ndarray:
        """Unknowns that the data, not the prior, decide, (u,) bool."""
        own = np.diag(self.covariance) / self.layout.scale**2
        told = ((self.unseen**2).sum(axis=1) <= MOST_UNSEEN) & ~(self.layout.held & (own > MEASURED_SHARE))
        told &= ~np.isin(self.layout.names, self.least)
        if self.unnamed is None:
            return told
        return told & (self.open <= MEASURED_SHARE * (self.sizes * self.layout.scale) ** 2)
