"""Normal equations as sums over rows: what chunks accumulate, what blocks hold out, what a cluster could reduce."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

SEEN_INFORMATION = 1.0  # in usual sizes, from which a direction counts as seen
TRACE = 1e-7  # share of a column's information below which what is its own is a trace of the linearisation


@dataclass(frozen=True)
class Sums:
    """A^T A, A^T y and y^T y of whitened rows, block by block.

    Columns are in units of usual sizes, so an eigenvalue of one means: known as well as the usual size.

    Attributes:
        gram: (b, P, P).
        side: (b, P).
        square: (b,).
        count: (b,) number of coordinates.
    """

    gram: np.ndarray
    side: np.ndarray
    square: np.ndarray
    count: np.ndarray

    def __add__(self, other: "Sums") -> "Sums":
        """Sums over the rows of both: chunks and machines of a cluster join by this."""
        return Sums(
            self.gram + other.gram, self.side + other.side, self.square + other.square, self.count + other.count
        )

    def of(self, chosen: np.ndarray) -> "Sums":
        """The same sums for some of the columns, by their indices."""
        return Sums(self.gram[:, chosen[:, None], chosen], self.side[:, chosen], self.square, self.count)

    @cached_property
    def total(self) -> tuple[np.ndarray, np.ndarray, float, int]:
        """Sums over all blocks."""
        return self.gram.sum(axis=0), self.side.sum(axis=0), float(self.square.sum()), int(self.count.sum())


def accumulate(columns: np.ndarray, values: np.ndarray, block: np.ndarray, blocks: int) -> Sums:
    """Sum up whitened rows.

    Args:
        columns: (m, 3, P) whitened, in usual sizes; (m, P) for one coordinate alone.
        values: (m, 3) whitened; (m,).
        block: (m,) int, -1 for rows that are never held out; those join the first block's sums.
        blocks: number of blocks.

    Returns:
        The sums.
    """
    width = columns.shape[-1]
    gram, side = np.zeros((blocks, width, width)), np.zeros((blocks, width))
    square, count = np.zeros(blocks), np.zeros(blocks, dtype=int)
    own = np.maximum(block, 0)
    order = np.argsort(own, kind="stable")
    ends = np.searchsorted(own[order], np.arange(blocks + 1))
    for index in np.flatnonzero(np.diff(ends)):
        rows = order[ends[index] : ends[index + 1]]
        flat, value = columns[rows].reshape(-1, width), values[rows].ravel()
        gram[index], side[index] = flat.T @ flat, flat.T @ value
        square[index], count[index] = value @ value, len(value)
    return Sums(gram, side, square, count)


@dataclass(frozen=True)
class Solution:
    """Least squares on a choice of columns.

    Attributes:
        left: sum of squares that is left.
        seen: number of directions that the rows see.
        values: (p,) solution in usual sizes, zero along what is not seen.
    """

    left: float
    seen: int
    values: np.ndarray


def solve(
    gram: np.ndarray, side: np.ndarray, square: float, chosen: np.ndarray, least: float = SEEN_INFORMATION
) -> Solution:
    """Least squares on chosen columns; directions that the rows do not see are left at zero.

    Args:
        gram: (P, P).
        side: (P,).
        square: sum of squared values.
        chosen: indices of the columns.
        least: information from which a direction counts as seen.

    Returns:
        The solution.
    """
    if not len(chosen):
        return Solution(square, 0, np.zeros(0))
    strength, directions = linalg.eigh(gram[np.ix_(chosen, chosen)])
    seen = strength > least
    along = directions[:, seen].T @ side[chosen]
    values = directions[:, seen] @ (along / strength[seen])
    return Solution(max(square - float(along @ (along / strength[seen])), 0.0), int(seen.sum()), values)


@dataclass(frozen=True)
class Projected:
    """Columns with everything the present model explains taken off.

    Attributes:
        gram: (P, P) of the columns.
        side: (P,).
        left: sum of squares that the present model leaves.
        seen: number of directions that the present model uses.
        before: (P,) information of each column before anything was taken off.
    """

    gram: np.ndarray
    side: np.ndarray
    left: float
    seen: int
    before: np.ndarray

    def least(self, chosen: np.ndarray) -> float:
        """Information from which a direction of the chosen columns counts as seen.

        In very many rows even the thousandth part by which two columns differ only because of where they were
        linearised would count, and be blown up into anything.
        """
        return max(SEEN_INFORMATION, TRACE * float(self.before[chosen].max(initial=0.0)))


def project(gram: np.ndarray, side: np.ndarray, square: float, base: np.ndarray) -> Projected:
    """Take off what the base columns explain.

    Args:
        gram: (P, P).
        side: (P,).
        square: sum of squared values.
        base: indices of the present model's columns.

    Returns:
        The projection, over all columns; those of the base are zero up to rounding.
    """
    if not len(base):
        return Projected(gram, side, square, 0, np.diag(gram))
    strength, directions = linalg.eigh(gram[np.ix_(base, base)])
    seen = strength > SEEN_INFORMATION
    root = directions[:, seen] / np.sqrt(strength[seen])
    cross = root.T @ gram[base]  # shape: (s, P)
    along = root.T @ side[base]
    left = max(square - float(along @ along), 0.0)
    return Projected(gram - cross.T @ cross, side - cross.T @ along, left, int(seen.sum()), np.diag(gram))


def gain(projected: Projected, chosen: np.ndarray) -> tuple[float, int]:
    """What chosen columns take off the rest.

    Args:
        projected: columns with the present model taken off.
        chosen: indices.

    Returns:
        Reduction of the sum of squares, and the number of seen directions behind it.
    """
    strength, directions = linalg.eigh(projected.gram[np.ix_(chosen, chosen)])
    seen = strength > projected.least(chosen)
    along = directions[:, seen].T @ projected.side[chosen]
    return float(along @ (along / strength[seen])), int(seen.sum())
