"""Normal sums worked out lazily from rows. Each column is contiguous in memory, so a few of many are read quickly."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ptt.diagnosis.noise.memory import HeldOutBlock, Memory, MemorySums, PoseParts, as_sums, entries, of_poses, run_of
from ptt.diagnosis.noise.poses import Poses, PosesBeside
from ptt.diagnosis.noise.wander import Clock, filtered

WHOLE_GRAM_ROWS = 4  # rows per column from which the Gram matrix of all columns is worked out at once
WHOLE_SHARE = 0.3  # share of the columns from which whole rows of the Gram matrix are worked out and kept


@dataclass(frozen=True)
class LazySums(MemorySums):
    """Normal sums whose Gram matrix is filled in as it is asked for.

    Most of it never is: a screen needs the products of each atom with itself and with the few atoms of a set.

    Attributes:
        there: which rows of the Gram matrix are filled in, (P,) bool.
    """

    there: np.ndarray = field(kw_only=True)

    @abstractmethod
    def products(self, some: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Products of some columns with others, (s, o), from the rows."""

    def _room(self, more: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A Gram matrix with room for more columns, which of its rows are filled in, (P,) bool, and their indices."""
        before, known = len(self.there), np.flatnonzero(self.there)
        gram, there = np.empty((before + more,) * 2), np.concatenate([self.there, np.zeros(more, dtype=bool)])
        gram[known, :before] = self.gram[known]
        return gram, there, known

    def of(self, chosen: np.ndarray) -> MemorySums:
        """Normal sums of chosen columns; missing products are not kept, as most sets lead nowhere."""
        gram, there = entries(self.gram, chosen, chosen), self.there[chosen]
        if not there.all():
            lack = np.flatnonzero(~there)
            gram[np.ix_(lack, there)] = gram[np.ix_(there, lack)].T
            gram[np.ix_(lack, lack)] = self.products(chosen[lack], chosen[lack])
        return MemorySums(gram, self.side[chosen], self.square, self.log_noise)

    def across(self, chosen: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Entries of the Gram matrix, (p, o); where many others are asked for, whole rows are filled in and kept."""
        lack = chosen[~self.there[chosen]]
        if len(lack) and (isinstance(others, slice) or len(others) > WHOLE_SHARE * len(self.there)):
            self.gram[lack], self.there[lack] = self.products(lack, slice(None)), True
            lack = lack[:0]
        found = entries(self.gram, chosen, others)
        if len(lack):
            found[~self.there[chosen]] = self.products(lack, others)
        return found


@dataclass(frozen=True)
class SumsOfRows(LazySums):
    """Normal sums of rows with independent errors.

    Attributes:
        white: the whitened columns, each as a row, (P, r).
    """

    white: np.ndarray = field(kw_only=True)

    def products(self, some: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Products of some columns with others, (s, o)."""
        return np.asarray(self.white[some] @ self.white[others].T)

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        own = self.white[run_of(columns.ravel())].reshape(*columns.shape, -1)
        return np.asarray(own @ own.transpose(0, 2, 1))

    def widened(self, white: np.ndarray, values: np.ndarray) -> "SumsOfRows":
        """Sums with further columns (w, r) appended; what was filled in stays."""
        gram, there, known = self._room(len(white))
        gram[known, len(self.white) :] = self.white[known] @ white.T
        return SumsOfRows(
            gram, np.concatenate([self.side, white @ values]), self.square, self.log_noise, dict(self._own),
            there=there, white=np.concatenate([self.white, white]),
        )  # fmt: skip


@dataclass(frozen=True)
class SumsOfPoses(LazySums):
    """Normal sums of rows with a random error of each pose.

    The inverse of the covariance I + v 1 1^T of k visits of a pose is I - v / (1 + k v) 1 1^T (Sherman-Morrison), so
    the sums are those of white rows less a share of the sums over pose means.

    Attributes:
        plain: sums without those errors.
        means: mean of each column over the visits of each pose, times the root of k, (P, 3 poses).
        share: k v / (1 + k v) of each pose and axis, (3 poses,).
    """

    plain: MemorySums = field(kw_only=True)
    means: np.ndarray = field(kw_only=True)
    share: np.ndarray = field(kw_only=True)

    def products(self, some: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Products of some columns with others, (s, o)."""
        return self.plain.across(some, others) - (self.means[some] * self.share) @ self.means[others].T

    def widened(self, plain: MemorySums, means: np.ndarray, values: np.ndarray) -> "SumsOfPoses":
        """Sums with further columns appended.

        Args:
            plain: sums without errors of poses, of all columns.
            means: of all columns, as in the attributes.
            values: the same of the readings, (3 poses,).
        """
        before = len(self.there)
        gram, there, known = self._room(len(means) - before)
        wider = SumsOfPoses(
            gram, np.append(self.side, plain.side[before:] - means[before:] @ (self.share * values)), self.square,
            self.log_noise, dict(self._own), there=there, plain=plain, means=means, share=self.share,
        )  # fmt: skip
        gram[known, before:] = wider.products(known, np.arange(before, len(means)))
        return wider

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        own = self.means[run_of(columns.ravel())].reshape(*columns.shape, -1)
        return np.asarray(self.plain.own(columns) - (own * self.share) @ own.transpose(0, 2, 1))


def sums_of_rows(white: np.ndarray, values: np.ndarray, log_noise: float, *, all_of_them: bool = True) -> MemorySums:
    """Normal sums of whitened columns and readings, lazy unless rows are so many that the whole Gram matrix is cheap.

    Args:
        white: the columns, each as a row, (P, r).
        values: the readings, (r,).
        log_noise: half the log-determinant of the noise's covariance.
        all_of_them: whether the whole Gram matrix may be worked out at once.
    """
    side, square, width = white @ values, float(values @ values), len(white)
    if all_of_them and white.shape[1] > WHOLE_GRAM_ROWS * width:
        return MemorySums(white @ white.T, side, square, log_noise)
    room, there = np.empty((width, width)), np.zeros(width, dtype=bool)
    return SumsOfRows(room, side, square, log_noise, white=white, there=there)


def sums_of_poses(
    plain: MemorySums, means: np.ndarray, values: np.ndarray, poses: Poses | PosesBeside, size: float
) -> MemorySums:
    """Normal sums with a random error of each pose.

    Args:
        plain: sums without those errors.
        means: of the columns, as `Poses.means` has them, (P, 3 poses).
        values: of the readings, (3 poses,).
        poses: of the rows.
        size: variance of the errors over the white variance.
    """
    share, log_noise = poses.share(size)
    width = len(means)
    square = plain.square - float(values @ (share * values))
    return SumsOfPoses(
        np.empty((width, width)), plain.side - means @ (share * values), square, plain.log_noise + log_noise,
        there=np.zeros(width, dtype=bool), plain=plain, means=means, share=share,
    )  # fmt: skip


@dataclass
class FewSums:
    """Normal sums of a few columns under any memory of the noise, with what the memories share cached.

    Attributes:
        rows: gives the columns and, as the last, the readings, (P + 1, 3, m) whitened.
        base: products of the base reflectors, (P + 1, P + 1), or a single zero for none.
        clock: of the rows.
        poses: of the rows.
        white: products under white noise, base reflectors included, (P + 1, P + 1); None to be worked out.
        means: pose means of columns and readings (`Poses.means`), (P + 1, 3, poses); None to be worked out.
    """

    rows: Callable[[], np.ndarray]
    base: np.ndarray
    clock: Clock
    poses: Poses
    white: np.ndarray | None = None
    means: np.ndarray | None = None

    def of(self, memory: Memory) -> MemorySums:
        """Normal sums under a memory."""
        if memory.wander is None and not memory.pose:
            return as_sums(self._white, 0.0)
        if memory.wander is None:
            taken, log_noise = of_poses(self._parts, memory)
            return as_sums(self._white - taken, log_noise)
        white, log_noise = filtered(self._joined, memory.wander, self.clock)
        gram = _gram(white) + self.base
        if memory.pose:
            poses = self.poses.beside(memory.wander, self.clock)
            means, (share, more) = flattened(poses.means(white)), poses.share(memory.pose)
            gram, log_noise = gram - (means * share) @ means.T, log_noise + more
        return as_sums(gram, log_noise)

    @cached_property
    def _joined(self) -> np.ndarray:
        return self.rows()

    @cached_property
    def _white(self) -> np.ndarray:
        return self.white if self.white is not None else np.asarray(_gram(self._joined) + self.base)

    @cached_property
    def _parts(self) -> PoseParts:
        means, visits = self.poses.means(self._joined) if self.means is None else self.means, self.poses.visits
        every = [(int(count), np.flatnonzero(visits == count)) for count in np.unique(visits)]
        return [(count, len(own), count * _gram(means[:, :, own])) for count, own in every]


@dataclass(frozen=True)
class HeldOutRows(HeldOutBlock):
    """A held-out block of travel with its b rows.

    Attributes:
        columns: (p, 3, b) whitened.
        values: readings, (3, b) whitened.
        unit: inverse whitener, which takes whitened vectors to mm, (3, 3).
    """

    columns: np.ndarray
    values: np.ndarray
    unit: np.ndarray

    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""
        predicted = values @ flattened(self.columns)
        return float(np.square(self.unit @ (self.values - predicted.reshape(self.values.shape))).sum())


def held_out_rows(columns: np.ndarray, values: np.ndarray, unit: np.ndarray) -> HeldOutBlock:
    """A held-out block from its rows; arguments as the attributes of `HeldOutRows`."""
    flat = flattened(columns)
    energy = float(np.square(values).sum())
    return HeldOutRows(flat @ flat.T, flat @ values.ravel(), energy, values.shape[1], columns, values, unit)


def flattened(rows: np.ndarray) -> np.ndarray:
    """Columns (p, 3, m) as (p, 3 m), also where p is zero."""
    return rows.reshape(len(rows), rows.shape[1] * rows.shape[2])


def _gram(rows: np.ndarray) -> np.ndarray:
    flat = flattened(rows)
    return np.asarray(flat @ flat.T)
