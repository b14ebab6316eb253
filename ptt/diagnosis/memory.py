"""Memory of the noise: what makes readings alike beside the model, and normal sums under it."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ptt.diagnosis.wander import Clock, Wander, innovations
from ptt.run.noise import Noise


@dataclass(frozen=True)
class Memory:
    """What makes readings alike beside the model: the tracker's wander, or errors that belong to a pose.

    Attributes:
        wander: None for none.
        pose: variance of what each pose has to itself, over that of the white noise.
    """

    wander: Wander | None = None
    pose: float = 0.0


WHITE = Memory()
PLENTY = 4  # rows for each column from which the sums of all columns are worked out at once


@dataclass(frozen=True)
class Sums:
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

    def across(self, chosen: np.ndarray) -> np.ndarray:
        """Chosen rows of the gram, (p, P)."""
        self._need(chosen)
        return np.asarray(self.gram[chosen])

    def of(self, chosen: np.ndarray) -> "Sums":
        """Normal sums of chosen columns."""
        self._need(chosen)
        return Sums(self.gram[np.ix_(chosen, chosen)], self.side[chosen], self.square, self.log_noise)

    def _need(self, chosen: np.ndarray) -> None:
        """Work out chosen rows of the gram."""

    def own(self, columns: np.ndarray) -> np.ndarray:
        """Each atom's own gram, (a, w, w), of the columns of atoms (a, w); they are kept."""
        key = columns.tobytes()
        if key not in self._own:
            self._own[key] = self._blocks(columns)
        return self._own[key]

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        return np.asarray(self.gram[columns[:, :, None], columns[:, None, :]])


@dataclass(frozen=True)
class SumsOfRows(Sums):
    """The same worked out from the rows as it is asked for.

    Most columns never meet: a screen sets each atom against itself and against the few of an explanation.

    Attributes:
        white: (r, P) rows, white under the memory.
        there: which rows of the gram are worked out, (P,) bool.
    """

    white: np.ndarray = field(kw_only=True)
    there: np.ndarray = field(kw_only=True)

    def of(self, chosen: np.ndarray) -> "Sums":
        """Normal sums of chosen columns; what these lack is worked out among them alone: most sets lead no further."""
        gram, lack = self.gram[np.ix_(chosen, chosen)], ~self.there[chosen]
        if lack.any():
            own = self.white[:, chosen]
            gram[lack] = own[:, lack].T @ own
            gram[:, lack] = gram[lack].T
        return Sums(gram, self.side[chosen], self.square, self.log_noise)

    def _need(self, chosen: np.ndarray) -> None:
        """Work out chosen rows of the gram."""
        lack = chosen[~self.there[chosen]]
        if len(lack):
            self.gram[lack], self.there[lack] = self.white[:, lack].T @ self.white, True

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        flat = self.white[:, columns.ravel()].reshape(-1, *columns.shape)
        return np.asarray(flat.transpose(1, 2, 0) @ flat.transpose(1, 0, 2))


def sums_of_rows(white: np.ndarray, values: np.ndarray, log_noise: float) -> Sums:
    """Normal sums of white rows (r, P) and readings (r,); where these are many, sums of all take less room."""
    side, square, width = white.T @ values, float(values @ values), white.shape[1]
    if len(white) > PLENTY * width:
        return Sums(white.T @ white, side, square, log_noise)
    room, there = np.empty((width, width)), np.zeros(width, dtype=bool)
    return SumsOfRows(room, side, square, log_noise, white=white, there=there)


@dataclass(frozen=True)
class Hidden:
    """Normal sums of one held-out block of travel, for some columns.

    Attributes:
        gram: (p, p) whitened.
        side: (p,).
        error: of the columns and the readings as the last, in mm, (p + 1, p + 1).
        rows: of the block.
    """

    gram: np.ndarray
    side: np.ndarray
    error: np.ndarray
    rows: int

    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""
        ways = np.append(-values, 1.0)
        return max(float(ways @ self.error @ ways), 0.0)


def sum_rows(joined: np.ndarray, memory: Memory, clock: Clock, pose: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal sums of some rows, which say nothing of rows before or after them.

    Args:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        memory: of the noise.
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


def whiten_rows(values: np.ndarray, memory: Memory, clock: Clock, pose: np.ndarray) -> tuple[np.ndarray, float]:
    """Rows as they are white under a memory of the noise.

    The covariance I + v 1 1^T of k visits of a pose has the inverse root I - c 1 1^T with c = (1 - 1/sqrt(1 + k v))/k.

    Args:
        values: (m, 3, ...) in noise units.
        memory: of the noise.
        clock: of the rows.
        pose: (m,) int, equal for visits of one pose.

    Returns:
        The same shape, and half the log-determinant of the noise's covariance.
    """
    white, log_noise = innovations(values, memory.wander, clock)
    if not memory.pose:
        return white, log_noise
    place, visits = np.unique(pose, return_inverse=True, return_counts=True)[1:]
    order = np.argsort(place, kind="stable")
    total = np.add.reduceat(white[order], np.cumsum(visits) - visits, axis=0)
    total *= ((1.0 - 1.0 / np.sqrt(1.0 + memory.pose * visits)) / visits).reshape(-1, *[1] * (values.ndim - 1))
    return white - total[place], log_noise + 1.5 * float(np.log1p(memory.pose * visits).sum())


def block_sums(joined: np.ndarray, noise: Noise) -> tuple[np.ndarray, np.ndarray, int]:
    """Normal sums of some rows in units of noise and in mm, (P + 1, P + 1), and how many rows they are.

    Args:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        noise: that whitened them.
    """
    flat = joined.reshape(-1, joined.shape[2])
    in_mm = np.zeros((joined.shape[2],) * 2)
    for way in np.linalg.inv(noise.whitener):
        axis = sum(weight * joined[:, other] for other, weight in enumerate(way) if weight)
        in_mm += axis.T @ axis
    return flat.T @ flat, in_mm, len(joined)


def hide(white: np.ndarray, in_mm: np.ndarray, rows: int) -> Hidden:
    """A held-out block from its normal sums."""
    return Hidden(white[:-1, :-1], white[:-1, -1], in_mm, rows)


def base_sums(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Normal sums of base reflectors, (P + 1, P + 1)."""
    flat = np.concatenate([columns, values[:, :, None]], axis=2).reshape(-1, columns.shape[2] + 1)
    return np.asarray(flat.T @ flat)


def as_sums(gram: np.ndarray, log_noise: float) -> Sums:
    """Joined sums of columns and readings, apart."""
    return Sums(gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), log_noise)


PoseParts = list[tuple[int, int, np.ndarray]]  # visits of a pose, poses of so many visits, sums of their totals


@dataclass
class RowSums:
    """Normal sums of some rows under any memory of the noise; what memories of poses share is kept.

    Attributes:
        joined: columns, and the readings as the last, (m, 3, P + 1) whitened.
        base: sums of the base reflectors, (P + 1, P + 1), or a single zero.
        clock: of the rows.
        pose: (m,) int, equal for visits of one pose.
    """

    joined: np.ndarray
    base: np.ndarray
    clock: Clock
    pose: np.ndarray

    def of(self, memory: Memory) -> Sums:
        """Normal sums under a memory."""
        if memory.wander is not None:
            gram, log_noise = sum_rows(self.joined, memory, self.clock, self.pose)
            return as_sums(gram + self.base, log_noise)
        if not memory.pose:
            return as_sums(self._white, 0.0)
        taken, log_noise = of_poses(self._parts, memory)
        return as_sums(self._white - taken, log_noise)

    @cached_property
    def _white(self) -> np.ndarray:
        flat = self.joined.reshape(-1, self.joined.shape[2])
        return np.asarray(flat.T @ flat + self.base)

    @cached_property
    def _parts(self) -> PoseParts:
        return pose_parts(self.joined.reshape(-1, self.joined.shape[2]), self.pose)


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
