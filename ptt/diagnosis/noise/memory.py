"""Memory of the noise: what makes readings alike beside the model, and normal sums under it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from scipy import linalg

from ptt.diagnosis.noise.wander import Clock, Wander, innovations
from ptt.run.noise import Noise


@dataclass(frozen=True)
class Memory:
    """What makes readings alike beside the model: the tracker's wander, and errors that belong to a pose.

    Attributes:
        wander: None for none.
        pose: variance of what each pose has to itself, over that of the white noise.
    """

    wander: Wander | None = None
    pose: float = 0.0


WHITE = Memory()
COPY_RATIO = 3  # columns of a matrix per wanted column from which copying whole rows first is slower


def entries(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray | slice) -> np.ndarray:
    """Some rows and columns of a matrix, (r, c): number by number where they are few, else rows first."""
    width = matrix.shape[1]
    if isinstance(columns, slice):
        return np.asarray(matrix[rows][:, columns])
    if COPY_RATIO * len(columns) < width and matrix.flags.c_contiguous:
        return np.asarray(matrix.ravel().take(rows[:, None] * width + columns))
    return np.asarray(matrix[rows].take(columns, axis=1))


def run_of(columns: np.ndarray) -> np.ndarray | slice:
    """Indices as a slice where they follow each other: what they stand for is read as it lies in memory."""
    first, last = int(columns[0]), int(columns[-1])
    return slice(first, last + 1) if last - first + 1 == len(columns) else columns


@dataclass(frozen=True)
class MemorySums:
    """Normal sums of columns under one memory of the noise.

    Attributes:
        gram: (P, P).
        side: (P,).
        square: of the readings.
        log_noise: half the log-determinant of the noise's covariance.
    """

    gram: np.ndarray
    side: np.ndarray
    square: float
    log_noise: float
    _own: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False)

    def across(self, chosen: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Entries of the gram, (p, o), the caller's own."""
        return entries(self.gram, chosen, others)

    def of(self, chosen: np.ndarray) -> "MemorySums":
        """Normal sums of chosen columns."""
        return MemorySums(entries(self.gram, chosen, chosen), self.side[chosen], self.square, self.log_noise)

    def own(self, columns: np.ndarray) -> np.ndarray:
        """Each atom's own gram, (a, w, w), of the columns of atoms (a, w); they are kept."""
        key = columns.tobytes()
        if key not in self._own:
            self._own[key] = self._blocks(columns)
        return self._own[key]

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        return np.asarray(self.gram[columns[:, :, None], columns[:, None, :]])


@dataclass(frozen=True)
class Hidden(ABC):
    """Normal sums of one held-out block of travel, for some columns.

    Attributes:
        gram: (p, p) whitened.
        side: (p,).
        energy: sum of squares of the readings, in units of noise.
        rows: of the block.
    """

    gram: np.ndarray
    side: np.ndarray
    energy: float
    rows: int

    @abstractmethod
    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""

    def left(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, in units of noise."""
        return self.energy - float(values @ (2.0 * self.side - self.gram @ values))

    def misfits(self, values: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Sums of squares that solutions leave in the block, each way counted as far as other rows can tell it.

        The readings have the covariance I + X K^-1 X^T where K is what the other rows know of the columns: what hangs
        on something that no other row shows, as the few rows of an approach do, says nothing of who predicts better.

        Args:
            values: (p, s) the solutions.
            known: K, (p, p), in units of noise.

        Returns:
            (s,).
        """
        side = self.side[:, None] - self.gram @ values
        factor = linalg.cholesky(known + self.gram, lower=True, check_finite=False)
        along = linalg.solve_triangular(factor, side, lower=True, check_finite=False)
        return np.array([self.left(one) for one in values.T]) - np.square(along).sum(axis=0)


@dataclass(frozen=True)
class HiddenSums(Hidden):
    """Of a block whose rows are gone.

    Attributes:
        error: sums of the columns and the readings as the last, in mm, (p + 1, p + 1).
    """

    error: np.ndarray

    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""
        ways = np.append(-values, 1.0)
        return max(float(ways @ self.error @ ways), 0.0)


def sum_rows(joined: np.ndarray, memory: Memory, clock: Clock, pose: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal sums of some rows, which say nothing of rows before or after them.

    Args:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        memory: of the noise, a wander or errors of poses.
        clock: of the rows.
        pose: (m,) int, equal for visits of one pose.

    Returns:
        (P + 1, P + 1), and half the log-determinant of the noise's covariance.
    """
    white, log_noise = innovations(joined, memory.wander, clock)
    flat = white.reshape(-1, joined.shape[2])
    gram = flat.T @ flat
    if not memory.pose:
        return gram, log_noise
    taken, more = of_poses(pose_parts(flat, pose), memory)
    return gram - taken, log_noise + more


def block_sums(joined: np.ndarray, noise: Noise) -> tuple[np.ndarray, np.ndarray, int]:
    """Normal sums of some rows in units of noise and in mm, (P + 1, P + 1), and how many rows they are.

    Args:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        noise: that whitened them.
    """
    unit = np.linalg.inv(noise.whitener)
    squares, ways = np.linalg.eigh(unit.T @ unit)  # turned that way, each axis has one figure for a unit in mm
    white, in_mm = np.zeros((2, joined.shape[2], joined.shape[2]))
    for axis, square in zip(np.moveaxis(ways.T @ joined, 1, 0), squares, strict=True):
        gram = axis.T @ axis
        white += gram
        in_mm += square * gram
    return white, in_mm, len(joined)


def base_sums(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Normal sums of base reflectors, (P + 1, P + 1)."""
    flat = np.concatenate([columns, values[:, :, None]], axis=2).reshape(-1, columns.shape[2] + 1)
    return np.asarray(flat.T @ flat)


def as_sums(gram: np.ndarray, log_noise: float) -> MemorySums:
    """Joined sums of columns and readings, apart."""
    return MemorySums(gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), log_noise)


def as_joined(sums: MemorySums) -> np.ndarray:
    """The other way round, (P + 1, P + 1)."""
    return np.block([[sums.gram, sums.side[:, None]], [sums.side, np.full(1, sums.square)]])


PoseParts = list[tuple[int, int, np.ndarray]]  # visits of a pose, poses of so many visits, sums of their totals


def pose_parts(flat: np.ndarray, pose: np.ndarray) -> PoseParts:
    """What any memory of poses needs of some rows.

    Args:
        flat: columns, and the readings as the last, (3 m, P + 1) whitened.
        pose: (m,) int, equal for visits of one pose.
    """
    order = np.argsort(pose, kind="stable")
    first = np.flatnonzero(np.diff(pose[order], prepend=pose[order[:1]] - 1))
    visits = np.diff(np.append(first, len(order)))
    cross = np.add.reduceat(flat.reshape(len(order), -1)[order], first, axis=0)
    parts = []
    for count in np.unique(visits):
        own = cross[visits == count].reshape(-1, flat.shape[1])
        parts.append((int(count), len(own) // 3, own.T @ own))
    return parts


def of_poses(parts: PoseParts, memory: Memory) -> tuple[np.ndarray, float]:
    """What free errors of each pose take off the sums, and half the log-determinant that they cost."""
    taken = sum(gram / (visits + 1.0 / memory.pose) for visits, _, gram in parts)
    return np.asarray(taken), 1.5 * float(sum(poses * np.log1p(memory.pose * visits) for visits, poses, _ in parts))
