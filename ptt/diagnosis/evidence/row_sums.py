"""Normal sums worked out from rows as they are asked for; columns lie one behind the other, so few of many are near."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ptt.diagnosis.noise.memory import Hidden, Memory, MemorySums, PoseParts, as_sums, entries, of_poses, run_of
from ptt.diagnosis.noise.poses import Poses, PosesBeside
from ptt.diagnosis.noise.wander import Clock, filtered

WHOLE_GRAM_ROWS = 4  # rows per column from which the Gram matrix of all columns is worked out at once
WHOLE_SHARE = 0.3  # share of the columns from which whole rows of the Gram matrix are worked out and kept


@dataclass(frozen=True)
class LazySums(MemorySums):
    """Normal sums that are worked out as they are asked for.

    Most columns never meet: a screen sets each atom against itself and against the few of an explanation.

    Attributes:
        there: which rows of the gram are worked out, (P,) bool.
    """

    there: np.ndarray = field(kw_only=True)

    @abstractmethod
    def products(self, some: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Entries of the gram, (s, o), from the rows."""

    def _room(self, more: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gram with room for more columns behind those that are there, which rows are worked out, and their numbers."""
        before, known = len(self.there), np.flatnonzero(self.there)
        gram, there = np.empty((before + more,) * 2), np.concatenate([self.there, np.zeros(more, dtype=bool)])
        gram[known, :before] = self.gram[known]
        return gram, there, known

    def of(self, chosen: np.ndarray) -> MemorySums:
        """Normal sums of chosen columns; what these lack is worked out among them alone: most sets lead no further."""
        gram, there = entries(self.gram, chosen, chosen), self.there[chosen]
        if not there.all():
            lack = np.flatnonzero(~there)
            gram[np.ix_(lack, there)] = gram[np.ix_(there, lack)].T
            gram[np.ix_(lack, lack)] = self.products(chosen[lack], chosen[lack])
        return MemorySums(gram, self.side[chosen], self.square, self.log_noise)

    def across(self, chosen: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Rows of the gram, (p, o); where many others are asked for, the rows are worked out whole and kept."""
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
    """Of rows that are white.

    Attributes:
        white: (P, r).
    """

    white: np.ndarray = field(kw_only=True)

    def products(self, some: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Entries of the gram, (s, o)."""
        return np.asarray(self.white[some] @ self.white[others].T)

    def _blocks(self, columns: np.ndarray) -> np.ndarray:
        own = self.white[run_of(columns.ravel())].reshape(*columns.shape, -1)
        return np.asarray(own @ own.transpose(0, 2, 1))

    def widened(self, white: np.ndarray, values: np.ndarray) -> "SumsOfRows":
        """The same with columns (w, r) behind those that are there; what was worked out stays."""
        gram, there, known = self._room(len(white))
        gram[known, len(self.white) :] = self.white[known] @ white.T
        return SumsOfRows(
            gram, np.concatenate([self.side, white @ values]), self.square, self.log_noise, dict(self._own),
            there=there, white=np.concatenate([self.white, white]),
        )  # fmt: skip


@dataclass(frozen=True)
class SumsOfPoses(LazySums):
    """Of rows whose poses have errors to themselves.

    The inverse of the covariance I + v 1 1^T of k visits of a pose is I - v / (1 + k v) 1 1^T: the sums are those of
    white rows less a share of those of each pose's mean.

    Attributes:
        plain: without those errors.
        means: root of k times the mean over the visits of each pose, (P, 3 poses).
        share: k v / (1 + k v) of each, (3 poses,).
    """

    plain: MemorySums = field(kw_only=True)
    means: np.ndarray = field(kw_only=True)
    share: np.ndarray = field(kw_only=True)

    def products(self, some: np.ndarray, others: np.ndarray | slice) -> np.ndarray:
        """Entries of the gram, (s, o)."""
        return self.plain.across(some, others) - (self.means[some] * self.share) @ self.means[others].T

    def widened(self, plain: MemorySums, means: np.ndarray, values: np.ndarray) -> "SumsOfPoses":
        """The same with columns behind those that are there.

        Args:
            plain: without errors of poses, of all columns.
            means: of all columns.
            values: of the readings, (3 poses,).
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
    """Normal sums of white columns (P, r) and readings (r,); where rows are many, sums of all take less room.

    Args:
        white: the columns.
        values: the readings.
        log_noise: half the log-determinant of the noise's covariance.
        all_of_them: whether sums of all may be worked out at once.
    """
    side, square, width = white @ values, float(values @ values), len(white)
    if all_of_them and white.shape[1] > WHOLE_GRAM_ROWS * width:
        return MemorySums(white @ white.T, side, square, log_noise)
    room, there = np.empty((width, width)), np.zeros(width, dtype=bool)
    return SumsOfRows(room, side, square, log_noise, white=white, there=there)


def sums_of_poses(
    plain: MemorySums, means: np.ndarray, values: np.ndarray, poses: Poses | PosesBeside, size: float
) -> MemorySums:
    """Normal sums where each pose has an error to itself.

    Args:
        plain: without those errors.
        means: of the columns, as `Poses.means` has them, (P, 3 poses).
        values: of the readings, (3 poses,).
        poses: of the rows.
        size: variance of the errors over that of the white noise.
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
    """Normal sums of a few columns under any memory of the noise; what memories share is worked out once.

    Attributes:
        rows: gives the columns, and the readings as the last, (P + 1, 3, m) whitened.
        base: sums of the base reflectors, (P + 1, P + 1), or a single zero.
        clock: of the rows.
        poses: of the rows.
        white: sums under white noise, base reflectors included; None where nobody has worked them out.
        means: of the columns and the readings as `Poses.means` has them, (P + 1, 3, poses); None likewise.
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
class HiddenRows(Hidden):
    """A held-out block of travel whose rows are there.

    Attributes:
        columns: (p, 3, b) whitened.
        values: (3, b).
        unit: of the noise, mm, (3, 3).
    """

    columns: np.ndarray
    values: np.ndarray
    unit: np.ndarray

    def square(self, values: np.ndarray) -> float:
        """Sum of squares that a solution leaves in the block, mm^2."""
        told = values @ flattened(self.columns)
        return float(np.square(self.unit @ (self.values - told.reshape(self.values.shape))).sum())


def hide_rows(columns: np.ndarray, values: np.ndarray, unit: np.ndarray) -> Hidden:
    """A held-out block from its rows, arguments as of `HiddenRows`."""
    flat = flattened(columns)
    energy = float(np.square(values).sum())
    return HiddenRows(flat @ flat.T, flat @ values.ravel(), energy, values.shape[1], columns, values, unit)


def flattened(rows: np.ndarray) -> np.ndarray:
    """Columns (p, 3, m) as (p, 3 m); there may be none."""
    return rows.reshape(len(rows), rows.shape[1] * rows.shape[2])


def _gram(rows: np.ndarray) -> np.ndarray:
    flat = flattened(rows)
    return np.asarray(flat @ flat.T)
