"""Memory of the noise: its covariance beyond independent readings, and normal sums (X^T X, X^T y, y^T y) under it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from scipy import linalg

from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.noise.wander import Clock, Wander, innovations
from ptt.run.noise import Noise


@dataclass(frozen=True)
class Memory:
    """Covariance of the noise beside the white part: a wander of the tracker, and a random error of each pose.

    Attributes:
        wander: Ornstein-Uhlenbeck process in time; None for none.
        pose: variance of a random effect shared by all visits of a pose, over the white variance; zero for none.
    """

    wander: Wander | None = None
    pose: float = 0.0


WHITE = Memory()
COPY_RATIO = 3  # columns of a matrix per wanted column from which copying whole rows first is slower


def entries(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray | slice) -> np.ndarray:
    """Some rows and columns of a matrix, (r, c): entry by entry where they are few, else whole rows first."""
    width = matrix.shape[1]
    if isinstance(columns, slice):
        return np.asarray(matrix[rows][:, columns])
    if COPY_RATIO * len(columns) < width and matrix.flags.c_contiguous:
        return np.asarray(matrix.ravel().take(rows[:, None] * width + columns))
    return np.asarray(matrix[rows].take(columns, axis=1))


def run_of(columns: np.ndarray) -> np.ndarray | slice:
    """Indices as a slice where they are consecutive, so that indexing with them makes a view and no copy."""
    first, last = int(columns[0]), int(columns[-1])
    return slice(first, last + 1) if last - first + 1 == len(columns) else columns


@dataclass(frozen=True)
class MemorySums:
    """Normal sums of columns X and readings y, whitened under one memory of the noise.

    Attributes:
        gram: X^T X, (P, P).
        side: X^T y, (P,).
        square: y^T y.
        log_noise: half the log-determinant of the noise's covariance, relative to white noise of unit variance.
    """

    gram: np.ndarray
    side: np.ndarray
    square: float
    log_noise: float
    _own: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False)

    def across(self, chosen: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Rows `chosen` and columns `others` of the Gram matrix, (p, o); a copy that the caller may change."""
        return entries(self.gram, chosen, others)

    def of(self, chosen: np.ndarray) -> "MemorySums":
        """Normal sums of chosen columns."""
        return MemorySums(entries(self.gram, chosen, chosen), self.side[chosen], self.square, self.log_noise)

    def own(self, columns: np.ndarray) -> np.ndarray:
        """Gram matrix of each atom's own columns, (a, w, w), for the column indices of a atoms, (a, w); cached."""
        key = columns.tobytes()
        if key not in self._own:
            self._own[key] = self._blocks(columns)
        return self._own[key]

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        return np.asarray(self.gram[columns[:, :, None], columns[:, None, :]])


@dataclass(frozen=True)
class HeldOutBlock(ABC):
    """Normal sums of the rows of one held-out block of travel, for some columns X, under white noise.

    Attributes:
        gram: X^T X, (p, p) whitened.
        side: X^T y, (p,).
        energy: y^T y, in units of noise squared.
        rows: number of rows.
    """

    gram: np.ndarray
    side: np.ndarray
    energy: float
    rows: int

    @abstractmethod
    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""

    def residual_square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, in units of noise squared."""
        return self.energy - float(values @ (2.0 * self.side - self.gram @ values))

    def predictive_squares(self, values: np.ndarray, precision: np.ndarray) -> np.ndarray:
        """Squared Mahalanobis distances of the block from predictions, under the predictive covariance I + X K^-1 X^T.

        K is the posterior precision of the columns from the other rows. What depends on something that no other row
        shows, as the few rows of an approach do, then says nothing about which solution predicts better.

        Args:
            values: (p, s) the solutions.
            precision: K, (p, p), in units of the white variance.

        Returns:
            r^T (I + X K^-1 X^T)^-1 r of each residual r = y - X b, (s,).
        """
        side = self.side[:, None] - self.gram @ values
        factor = linalg.cholesky(precision + self.gram, lower=True, check_finite=False)
        along = linalg.solve_triangular(factor, side, lower=True, check_finite=False)
        return np.array([self.residual_square(one) for one in values.T]) - np.square(along).sum(axis=0)


@dataclass(frozen=True)
class HeldOutSums(HeldOutBlock):
    """A block of which only sums are kept.

    Attributes:
        error: products of the columns and, as the last, the readings, not whitened, mm^2, (p + 1, p + 1).
    """

    error: np.ndarray

    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""
        weights = np.append(-values, 1.0)
        return max(float(weights @ self.error @ weights), 0.0)


def sum_rows(joined: np.ndarray, memory: Memory, clock: Clock, pose: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal sums of a stretch of rows that is independent of the rows before and after it.

    Args:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        memory: of the noise, a wander or errors of poses but not both.
        clock: of the rows.
        pose: (m,) int, equal for visits of one pose.

    Returns:
        Products of columns and readings, (P + 1, P + 1), and half the log-determinant of the noise's covariance.
    """
    white, log_noise = innovations(joined, memory.wander, clock)
    flat = white.reshape(-1, joined.shape[2])
    gram = flat.T @ flat
    if not memory.pose:
        return gram, log_noise
    taken, more = of_poses(pose_parts(flat, pose), memory)
    return gram - taken, log_noise + more


def block_sums(joined: np.ndarray, noise: Noise) -> tuple[np.ndarray, np.ndarray, int]:
    """Normal sums of some rows in units of noise and in mm, (P + 1, P + 1) each, and the number of rows.

    Args:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        noise: that whitened them.
    """
    unit = np.linalg.inv(noise.whitener)
    squares, axes = np.linalg.eigh(unit.T @ unit)  # along the noise's principal axes both sums differ by one factor
    white, in_mm = np.zeros((2, joined.shape[2], joined.shape[2]))
    for axis, square in zip(np.moveaxis(axes.T @ joined, 1, 0), squares, strict=True):
        gram = axis.T @ axis
        white += gram
        in_mm += square * gram
    return white, in_mm, len(joined)


def base_sums(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Products of columns (b, 3, P) and readings (b, 3) of base reflectors, (P + 1, P + 1)."""
    flat = np.concatenate([columns, values[:, :, None]], axis=2).reshape(-1, columns.shape[2] + 1)
    return np.asarray(flat.T @ flat)


def as_sums(gram: np.ndarray, log_noise: float) -> MemorySums:
    """Products of columns and, as the last, readings (P + 1, P + 1), as normal sums."""
    return MemorySums(gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), log_noise)


def as_joined(sums: MemorySums) -> np.ndarray:
    """Normal sums as one matrix of products of columns and readings, (P + 1, P + 1)."""
    return np.block([[sums.gram, sums.side[:, None]], [sums.side, np.full(1, sums.square)]])


# For each number of visits: that number, how many poses have it, and products of their totals over visits.
PoseParts = list[tuple[int, int, np.ndarray]]


def pose_parts(flat: np.ndarray, pose: np.ndarray) -> PoseParts:
    """Products of totals over the visits of each pose, from which sums under any variance of pose errors follow.

    Args:
        flat: columns, and the readings as the last, (3 m, P + 1) whitened.
        pose: (m,) int, equal for visits of one pose.
    """
    poses = poses_of(pose)
    cross = np.add.reduceat(flat.reshape(len(pose), -1)[poses.order], poses.first, axis=0)
    parts = []
    for count in np.unique(poses.visits):
        own = cross[poses.visits == count].reshape(-1, flat.shape[1])
        parts.append((int(count), len(own) // 3, own.T @ own))
    return parts


def of_poses(parts: PoseParts, memory: Memory) -> tuple[np.ndarray, float]:
    """What random errors of poses take off the sums, and half the log-determinant that they add (Woodbury identity)."""
    taken = sum(gram / (visits + 1.0 / memory.pose) for visits, _, gram in parts)
    return np.asarray(taken), 1.5 * float(sum(poses * np.log1p(memory.pose * visits) for visits, poses, _ in parts))
