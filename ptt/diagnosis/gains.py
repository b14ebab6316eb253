"""Gains: how a filter of a wander weighs the rows of one axis, and what these foretell of each other."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

STRETCH = 32  # rows whose innovations are worked out at once where columns lie one behind the other
MANY = 200  # columns from which a row of them is worth a step of its own


@dataclass(frozen=True)
class Gains:
    """How a filter weighs the rows: the foretold state s follows s_i = keep_(i-1) s_(i-1) + take_(i-1) x_(i-1).

    Attributes:
        keep: (n - 1,).
        take: (n - 1,).
        root: of the variance of each innovation, (n,).
        log_noise: half the log-determinant of the noise's covariance along one axis.
    """

    keep: np.ndarray
    take: np.ndarray
    root: np.ndarray
    log_noise: float

    @cached_property
    def stretches(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """What readings of each stretch of w rows (w, w + 1), and the state before it (w + 1,), make of it.

        The innovation of each of its rows in units of its error, and the state behind the last.
        """
        count = len(self.root)
        keep, take, root = np.zeros((3, -(-count // STRETCH) * STRETCH))  # behind the last row nothing is foretold
        keep[: count - 1], take[: count - 1], root[:count], root[count:] = self.keep, self.take, self.root, 1.0
        taken, kept = _triangles(*(part.reshape(-1, STRETCH) for part in (keep, take, root)))
        widths = [min(STRETCH, count - first) for first in range(0, count, STRETCH)]
        return [(own[:w, : w + 1], all_[: w + 1]) for own, all_, w in zip(taken, kept, widths, strict=True)]


def gains_of(share: float, decay: np.ndarray) -> Gains:
    """Gains and variances of the innovations, which depend on when rows were read alone.

    Where each row keeps k of the state before it, row less k times the row before it has variance 1 + q + k^2, q what
    the wander gains on the way, and covariance -k with its neighbours: the innovations' variances are the pivots of
    that tridiagonal matrix.
    """
    squares = np.square(decay)
    widths = 1.0 + squares + (1.0 - squares) * share
    if len(widths) > 1:  # LAPACK's pivots; none is below one
        widths = lapack.dpttrf(widths, decay[1:])[0]
    keeps = decay[1:] / widths[:-1]
    return Gains(keeps, decay[1:] - keeps, np.sqrt(widths), 0.5 * float(np.log(widths).sum()))


def filter_rows(flat: np.ndarray, gains: Gains) -> np.ndarray:
    """Innovations of rows (r, n) of one axis, or of axes that wander alike.

    Within a stretch they are a triangle of weights times the readings, and the state with which it begins goes on into
    each of them.
    """
    white, state, first = np.empty_like(flat), np.zeros((len(flat), 1)), 0
    for taken, kept in gains.stretches:
        width = len(taken)
        both = flat[:, first : first + width] @ taken
        both += state * kept
        white[:, first : first + width], state = both[:, :width], both[:, width:]
        first += width
    return white


def foretell(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """States that readings (n, c) foretell, each from the rows before it; `Gains` says how they are weighed."""
    return (_row_by_row if flat.shape[1] > MANY else all_rows)(flat, keep, take)


def all_rows(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """The foretold states of a few columns: a bidiagonal system."""
    side = np.zeros(flat.shape, order="F")
    if len(flat) > 1 and flat.shape[1]:  # of no column at all LAPACK would write the first one, past the end
        side[1:] = take[:, None] * flat[:-1]
        # No state decays by less than nothing, so no rows are exchanged.
        side = lapack.dgtsv(-keep, np.ones(len(flat)), np.zeros(len(flat) - 1), side, overwrite_b=1)[3]
    return np.asarray(side)


def _row_by_row(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """The same where columns are many: a row of them at a time stays in the cache, which is ten times faster."""
    state = np.zeros_like(flat)
    for row in range(1, len(flat)):
        np.multiply(flat[row - 1], take[row - 1], out=state[row])
        state[row] += keep[row - 1] * state[row - 1]
    return state


def _triangles(keep: np.ndarray, take: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of all stretches at once, (s, w) each: (s, w, w + 1) and (s, w + 1) as `Gains.stretches` has them."""
    count, width = keep.shape
    taken, kept = np.zeros((count, width, width + 1)), np.ones((count, width + 1))
    for row in range(width):
        taken[:, :row, row + 1] = keep[:, row, None] * taken[:, :row, row]
        taken[:, row, row + 1] = take[:, row]
        kept[:, row + 1] = keep[:, row] * kept[:, row]
    every = np.arange(width)
    taken[:, :, :width] *= -1.0 / root[:, None]
    taken[:, every, every] = 1.0 / root
    kept[:, :width] *= -1.0 / root
    return taken, kept
