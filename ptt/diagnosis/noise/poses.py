"""Poses: which rows are visits of which, and what errors that belong to a pose share."""

from dataclasses import dataclass, field

import numpy as np

from ptt.diagnosis.noise.gains import filter_rows
from ptt.diagnosis.noise.wander import Clock, Wander

# Numbers of weights that are kept, 160 MB: those of all wanders that one search tries, of most runs
MOST_WEIGHT_NUMBERS = 20_000_000


@dataclass(frozen=True)
class Poses:
    """Which rows of one clock are visits of which pose.

    Attributes:
        order: the rows, pose by pose, (m,) int.
        first: place of the first visit of each pose in this order.
        visits: of each pose.
    """

    order: np.ndarray
    first: np.ndarray
    visits: np.ndarray
    _ways: dict[tuple[float, float], tuple[np.ndarray, np.ndarray]] = field(
        default_factory=dict, compare=False, repr=False
    )

    def means(self, rows: np.ndarray) -> np.ndarray:
        """Root of the visits times the mean of each pose, (.., poses) of rows (.., m)."""
        ordered = np.take(rows, self.order, axis=-1)  # twice as fast as an index behind an ellipsis
        return np.asarray(np.add.reduceat(ordered, self.first, axis=-1) / np.sqrt(self.visits))

    def shrunk(self, rows: np.ndarray, size: float) -> np.ndarray:
        """What rows (.., m) say of the errors of their poses, where these are of a size, (.., m)."""
        told, times = np.empty_like(rows), size * self.visits
        each = self.means(rows) / np.sqrt(self.visits) * times / (1.0 + times)
        told[..., self.order] = np.repeat(each, self.visits, axis=-1)
        return told

    def share(self, size: float) -> tuple[np.ndarray, float]:
        """What errors of a size take off three coordinates' means, (3 poses,); half the log-determinant they cost."""
        times = size * self.visits
        return np.tile(times / (1.0 + times), 3), 1.5 * float(np.log1p(times).sum())

    def beside(self, wander: Wander | None, clock: Clock) -> "Poses | PosesBeside":
        """The same for rows that are white beside a wander."""
        if wander is None:
            return self
        weights, visits = list[tuple[slice, np.ndarray]](), np.empty((3, len(self.visits)))
        for axes, share in wander.parts:
            visits[axes], ways = self._beside(share, wander.constant, clock)
            weights.append((axes, ways))
        return PosesBeside(tuple(weights), visits)

    def _beside(self, share: float, constant: float, clock: Clock) -> tuple[np.ndarray, np.ndarray]:
        """Visits and weights of the combinations along one axis; what was worked out once is kept."""
        if (share, constant) not in self._ways:
            if len(self._ways) * len(self.visits) * len(self.order) > MOST_WEIGHT_NUMBERS:
                self._ways.clear()
            own = np.zeros((len(self.visits), len(self.order)))
            own[np.repeat(np.arange(len(own)), self.visits), self.order] = 1.0
            white = np.empty_like(own)
            filter_rows(own, clock.gains(share, constant), white)
            counts, ways = np.linalg.eigh(white @ white.T)
            self._ways[share, constant] = counts, (ways.T @ white) / np.sqrt(counts)[:, None]
        return self._ways[share, constant]


@dataclass(frozen=True)
class PosesBeside:
    """Combinations of poses whose errors, beside a wander, are told one by one.

    With Z the visits of the poses and L the filter of the wander, errors of variance v have the covariance
    v (L Z) (L Z)^T among innovations. Along its eigenvectors it is what the means of poses are among white readings.

    Attributes:
        weights: of the rows in each combination, (poses, m), by the axes that wander alike.
        visits: that each combination counts for, (3, poses).
    """

    weights: tuple[tuple[slice, np.ndarray], ...]
    visits: np.ndarray

    def means(self, rows: np.ndarray) -> np.ndarray:
        """What stands for means of poses, (.., 3, poses) of rows (.., 3, m) that are white beside the wander."""
        means = np.empty((*rows.shape[:-1], self.visits.shape[1]))
        for axes, weights in self.weights:
            own = rows[..., axes, :]
            means[..., axes, :] = (own.reshape(-1, own.shape[-1]) @ weights.T).reshape(*own.shape[:-1], len(weights))
        return means

    def share(self, size: float) -> tuple[np.ndarray, float]:
        """As of `Poses`."""
        times = size * self.visits
        return (times / (1.0 + times)).ravel(), 0.5 * float(np.log1p(times).sum())


def poses_of(pose: np.ndarray) -> Poses:
    """Poses of rows (m,) int, equal for visits of one pose."""
    order = np.argsort(pose, kind="stable")
    first = np.flatnonzero(np.diff(pose[order], prepend=pose[order[:1]] - 1))
    return Poses(order, first, np.diff(np.append(first, len(order))))
