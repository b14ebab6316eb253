"""Poses: which rows are visits of which pose, and sums for a random error common to the visits of each pose."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ptt.diagnosis.noise.gains import Gains, filter_back, filter_rows
from ptt.diagnosis.noise.wander import Clock, Wander

# Numbers of weights that are kept, 160 MB: those of all wanders that one diagnosis tries, of most runs
MOST_WAY_NUMBERS = 20_000_000
Filter = tuple[slice, Gains, np.ndarray]  # axes with the same gains, these, and weights (`PosesBeside.filters`)


@dataclass(frozen=True)
class Poses:
    """Which rows of one clock are visits of which pose.

    Attributes:
        order: the rows sorted by pose, (m,) int.
        first: place of the first visit of each pose in this order, (poses,).
        visits: number of visits of each pose, (poses,).
    """

    order: np.ndarray
    first: np.ndarray
    visits: np.ndarray

    def means(self, rows: np.ndarray) -> np.ndarray:
        """Mean over the visits of each pose, times the root of their number, (.., poses), from rows (.., m)."""
        return self.totals(rows) / np.sqrt(self.visits)

    def totals(self, rows: np.ndarray) -> np.ndarray:
        """Sum over the visits of each pose, (.., poses), from rows (.., m)."""
        ordered = np.take(rows, self.order, axis=-1)  # twice as fast as an index behind an ellipsis
        return np.asarray(np.add.reduceat(ordered, self.first, axis=-1))

    def shrunk(self, rows: np.ndarray, size: float) -> np.ndarray:
        """Posterior mean of the pose error at each row, (.., m), from rows (.., m).

        Args:
            rows: residuals in noise units.
            size: variance of pose errors over the white variance.
        """
        errors, times = np.empty_like(rows), size * self.visits
        each = self.means(rows) / np.sqrt(self.visits) * times / (1.0 + times)
        errors[..., self.order] = np.repeat(each, self.visits, axis=-1)
        return errors

    def share(self, size: float) -> tuple[np.ndarray, float]:
        """Shares k v / (1 + k v) of each axis and pose, (3 poses,), and half the log-determinant that pose errors add.

        Args:
            size: v, variance of pose errors over the white variance; k is the number of visits.
        """
        times = size * self.visits
        return np.tile(times / (1.0 + times), 3), 1.5 * float(np.log1p(times).sum())

    def beside(self, wander: Wander | None, clock: Clock) -> "Poses | PosesBeside":
        """The counterpart for rows that were filtered by a wander."""
        if wander is None:
            return self
        filters, visits = list[Filter](), np.empty((3, len(self.visits)))
        for axes, share in wander.parts:
            visits[axes], ways = self._beside(share, wander.constant, clock)
            filters.append((axes, clock.gains(share, wander.constant), ways))
        return PosesBeside(self, tuple(filters), visits)

    def _beside(self, share: float, constant: float, clock: Clock) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues and scaled eigenvectors of the filtered visits along one axis; cached."""
        kept = _kept(self.order.tobytes(), self.first.tobytes(), clock.time.tobytes(), clock.starts.tobytes(),
                     clock.registered)  # fmt: skip
        if (share, constant) not in kept:
            if len(kept) * len(self.visits) ** 2 > MOST_WAY_NUMBERS:
                del kept[next(iter(kept))]  # the one found first: a search moves on along the grid
            own = np.zeros((len(self.visits), len(self.order)))
            own[np.repeat(np.arange(len(own)), self.visits), self.order] = 1.0
            white = np.empty_like(own)
            filter_rows(own, clock.gains(share, constant), white)
            counts, ways = np.linalg.eigh(white @ white.T)
            kept[share, constant] = counts, ways / np.sqrt(counts)
        return kept[share, constant]


@lru_cache(maxsize=2)
def _kept(*rows: bytes | bool) -> dict[tuple[float, float], tuple[np.ndarray, np.ndarray]]:
    """What is cached for rows of these poses and times: every system that a search linearises has the same ones."""
    return {}


@dataclass(frozen=True)
class PosesBeside:
    """Independent combinations of poses beside a wander.

    With Z the incidence matrix of visits and L the filter of the wander, pose errors of variance v have the covariance
    v (L Z)(L Z)^T among innovations. Along its eigenvectors they are independent, as pose means are among white rows.

    Attributes:
        poses: those of the rows.
        filters: axes with the same gains, these, and the weights of each pose in each combination, (poses, poses).
        visits: eigenvalue of each combination, in place of a number of visits, (3, poses).
    """

    poses: Poses
    filters: tuple[Filter, ...]
    visits: np.ndarray

    def means(self, rows: np.ndarray) -> np.ndarray:
        """Counterpart of `Poses.means`, (.., 3, poses), from rows filtered by the wander, (.., 3, m)."""
        means = np.empty((*rows.shape[:-1], self.visits.shape[1]))
        for axes, gains, ways in self.filters:
            own = rows[..., axes, :]
            totals = self.poses.totals(filter_back(own.reshape(-1, own.shape[-1]), gains))
            means[..., axes, :] = (totals @ ways).reshape(*own.shape[:-1], len(ways))
        return means

    def share(self, size: float) -> tuple[np.ndarray, float]:
        """As `Poses.share`."""
        times = size * self.visits
        return (times / (1.0 + times)).ravel(), 0.5 * float(np.log1p(times).sum())


def poses_of(pose: np.ndarray) -> Poses:
    """Poses from a label of each row, (m,) int, equal for visits of one pose."""
    order = np.argsort(pose, kind="stable")
    first = np.flatnonzero(np.diff(pose[order], prepend=pose[order[:1]] - 1))
    return Poses(order, first, np.diff(np.append(first, len(order))))
