"""Gains: how a filter of a wander weighs the rows of one axis, and what these predict of each other."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

BATCH_ROWS = 16  # rows whose innovations are one matrix product where rows are the last axis
BATCH_COLUMNS = 512  # columns filtered at a time, so that they stay in the cache
MANY_COLUMNS = 200  # columns from which a loop over rows is faster than one bidiagonal system


@dataclass(frozen=True)
class Gains:
    """How a filter weighs the rows: the predicted state s follows s_i = keep_(i-1) s_(i-1) + take_(i-1) x_(i-1).

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
    def stretches(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights of the state before each stretch of w rows and of its readings, (s, w + 1, w) and (s, w + 1).

        Of the innovations of its rows in units of their error, and of the state behind the last.
        """
        count = len(self.root)
        keep, take, root = np.zeros(
            (3, -(-count // BATCH_ROWS) * BATCH_ROWS)
        )  # behind the last row nothing is predicted
        keep[: count - 1], take[: count - 1], root[:count], root[count:] = self.keep, self.take, self.root, 1.0
        return _triangles(*(part.reshape(-1, BATCH_ROWS) for part in (keep, take, root)))


def gains_of(share: float, decay: np.ndarray, begun: np.ndarray) -> Gains:
    """Gains and variances of the innovations, which depend on when rows were read alone.

    Args:
        share: variance of the wander over that of the white noise.
        decay: what each row keeps of the state before it, (n,).
        begun: what each row that keeps nothing has of that variance, (n,); one at the others.

    Where each row keeps k of the state before it, row less k times the row before it has variance 1 + q + k^2, q what
    the wander gains on the way, and covariance -k with its neighbours: the innovations' variances are the pivots of
    that tridiagonal matrix.
    """
    squares = np.square(decay)
    widths = 1.0 + squares + (1.0 - squares) * share * begun
    if len(widths) > 1:  # LAPACK's pivots; none is below one
        widths = lapack.dpttrf(widths, decay[1:])[0]
    keeps = decay[1:] / widths[:-1]
    return Gains(keeps, decay[1:] - keeps, np.sqrt(widths), 0.5 * float(np.log(widths).sum()))


def filter_rows(rows: np.ndarray, gains: Gains, white: np.ndarray) -> None:
    """Innovations of rows (r, n) of one axis, or of axes that wander alike.

    Within a stretch they are a triangle of weights times the readings, and the state with which it begins goes on into
    each of them.

    Args:
        rows: the rows.
        gains: of the wander.
        white: where they are put, (r, n).
    """
    for first in range(0, len(rows), BATCH_COLUMNS):
        _filter(rows[first : first + BATCH_COLUMNS], *gains.stretches, white[first : first + BATCH_COLUMNS])


def _filter(rows: np.ndarray, weights: np.ndarray, onward: np.ndarray, white: np.ndarray) -> None:
    """The same of so few rows that they stay in the cache; all stretches at once but for the states between them."""
    (count, length), full = rows.shape, rows.shape[1] // BATCH_ROWS
    both = np.zeros((len(weights), count, 1 + BATCH_ROWS))  # the state before each stretch, and its readings
    both[:full, :, 1:] = _cut(rows, full)
    both[full:, :, 1 : 1 + length - full * BATCH_ROWS] = rows[:, full * BATCH_ROWS :]
    for now, then, weight in zip(both[:-1], both[1:], onward[:-1], strict=True):
        np.matmul(now, weight, out=then[:, 0])
    np.matmul(both[:full], weights[:full], out=_cut(white, full))
    white[:, full * BATCH_ROWS :] = (both[full:] @ weights[full:]).sum(axis=0)[:, : length - full * BATCH_ROWS]


def _cut(rows: np.ndarray, count: int) -> np.ndarray:
    """Stretches of rows (r, n), (count, r, w): the same numbers in memory."""
    return rows[:, : count * BATCH_ROWS].reshape(len(rows), count, BATCH_ROWS).transpose(1, 0, 2)


def predict(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """States that readings (n, c) predict, each from the rows before it; `Gains` says how they are weighed."""
    return (_row_by_row if flat.shape[1] > MANY_COLUMNS else all_rows)(flat, keep, take)


def all_rows(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """The predicted states of a few columns: a bidiagonal system."""
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
    """Of all stretches at once, (s, w) each, as `Gains.stretches` has them: first what predicts each row."""
    count, width = keep.shape
    weights = np.zeros((count, width + 1, width + 1))
    weights[:, 0, 0] = 1.0
    for row in range(width):
        weights[:, : row + 1, row + 1] = keep[:, row, None] * weights[:, : row + 1, row]
        weights[:, row + 1, row + 1] = take[:, row]
    onward, every = weights[:, :, width].copy(), np.arange(width)
    weights = weights[:, :, :width] * (-1.0 / root[:, None])
    weights[:, every + 1, every] = 1.0 / root
    return weights, onward
