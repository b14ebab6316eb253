"""Kalman filter of an Ornstein-Uhlenbeck wander along one axis: gains, innovations and their variances."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

BATCH_ROWS = 16  # rows whose innovations are one matrix product where rows are the last axis
BATCH_COLUMNS = 512  # columns filtered at a time, so that they stay in the cache
MANY_COLUMNS = 200  # columns from which a loop over rows is faster than one bidiagonal system


@dataclass(frozen=True)
class Gains:
    """Kalman gains for rows x: the predicted state s follows s_i = keep_(i-1) s_(i-1) + take_(i-1) x_(i-1), s_0 = 0.

    Attributes:
        keep: weight of the state before, (n - 1,).
        take: weight of the row before, (n - 1,).
        root: standard deviation of each innovation x_i - s_i, (n,).
        log_noise: half the log-determinant of the noise's covariance along one axis.
    """

    keep: np.ndarray
    take: np.ndarray
    root: np.ndarray
    log_noise: float

    @cached_property
    def batches(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights of batches of w rows: for the scaled innovations, (s, w + 1, w), and for the next state, (s, w + 1).

        Both apply to the state before the batch followed by its w rows. Innovations are over their standard deviations.
        """
        keep, take, over = self._whole
        return _triangles(keep, take, over, over)

    @cached_property
    def batches_back(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights of the adjoint's batches, from the last row to the first: of its results and of its next state.

        With u_i the sum of what rows from i on have to do with the state, u_i = keep_i u_(i+1) + y_i / root_i, and the
        result is y_i / root_i - take_i u_(i+1).
        """
        keep, take, over = (part[::-1] for part in self._whole)
        return _triangles(keep, over, over, take)

    @property
    def _whole(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights of the state and of the row, nothing behind the last one, and one over the deviations, (n,) each."""
        return np.append(self.keep, 0.0), np.append(self.take, 0.0), 1.0 / self.root


def gains_of(share: float, decay: np.ndarray, begun: np.ndarray) -> Gains:
    """Gains and innovation variances, which depend only on when rows were read.

    With k the share of the state that is kept from row to row, x_i - k x_(i-1) has variance 1 + q + k^2, q being the
    process noise added on the way, and covariance -k with its neighbours. The innovations' variances are the pivots of
    that tridiagonal matrix.

    Args:
        share: variance of the wander over the white variance.
        decay: share k of the state before that each row keeps, (n,); zero at the first row of a run.
        begun: share of its variance that the wander has at rows that keep nothing, (n,); one at the others.
    """
    squares = np.square(decay)
    variances = 1.0 + squares + (1.0 - squares) * share * begun
    if len(variances) > 1:  # LAPACK's pivots; none is below one
        variances = lapack.dpttrf(variances, decay[1:])[0]
    keep = decay[1:] / variances[:-1]
    return Gains(keep, decay[1:] - keep, np.sqrt(variances), 0.5 * float(np.log(variances).sum()))


def filter_rows(rows: np.ndarray, gains: Gains, white: np.ndarray) -> None:
    """Scaled innovations of r series of n rows each, batch by batch: a triangular product, and the state carried on.

    Args:
        rows: the series, (r, n), of one axis or of axes with the same gains.
        gains: of the wander.
        white: receives the innovations over their standard deviations, (r, n).
    """
    for first in range(0, len(rows), BATCH_COLUMNS):
        _filter(rows[first : first + BATCH_COLUMNS], *gains.batches, white[first : first + BATCH_COLUMNS])


def _filter(rows: np.ndarray, weights: np.ndarray, onward: np.ndarray, white: np.ndarray) -> None:
    """As `filter_rows` for so few series that they stay in the cache; only the states run from batch to batch."""
    (count, length), full = rows.shape, rows.shape[1] // BATCH_ROWS
    both = np.zeros((len(weights), count, 1 + BATCH_ROWS))  # the state before each batch, and its rows
    both[:full, :, 1:] = _cut(rows, full)
    both[full:, :, 1 : 1 + length - full * BATCH_ROWS] = rows[:, full * BATCH_ROWS :]
    for now, then, weight in zip(both[:-1], both[1:], onward[:-1], strict=True):
        np.matmul(now, weight, out=then[:, 0])
    np.matmul(both[:full], weights[:full], out=_cut(white, full))
    white[:, full * BATCH_ROWS :] = (both[full:] @ weights[full:]).sum(axis=0)[:, : length - full * BATCH_ROWS]


def filter_back(white: np.ndarray, gains: Gains) -> np.ndarray:
    """The adjoint of `filter_rows` along series of n rows, (r, n): the same batches from the last row to the first."""
    back = np.empty_like(white)
    for first in range(0, len(white), BATCH_COLUMNS):
        some = slice(first, first + BATCH_COLUMNS)
        _filter(white[some, ::-1], *gains.batches_back, back[some])
    return back[:, ::-1]


def _cut(rows: np.ndarray, count: int) -> np.ndarray:
    """Batches of w rows of series (r, n), (count, r, w): a view."""
    return rows[:, : count * BATCH_ROWS].reshape(len(rows), count, BATCH_ROWS).transpose(1, 0, 2)


def predict(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """Predicted states of c series of n rows, (n, c) each, with the weights of `Gains`."""
    return (_row_by_row if flat.shape[1] > MANY_COLUMNS else all_rows)(flat, keep, take)


def all_rows(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """`predict` for a few series, by solving one bidiagonal system."""
    side = np.zeros(flat.shape, order="F")
    if len(flat) > 1 and flat.shape[1]:  # with no column at all LAPACK would write out of bounds
        side[1:] = take[:, None] * flat[:-1]
        # The diagonal is one and `keep` at most one, so LAPACK exchanges no rows.
        side = lapack.dgtsv(-keep, np.ones(len(flat)), np.zeros(len(flat) - 1), side, overwrite_b=1)[3]
    return np.asarray(side)


def _row_by_row(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """`predict` for many series: one row of all of them at a time stays in the cache, which is ten times faster."""
    state = np.zeros_like(flat)
    for row in range(1, len(flat)):
        np.multiply(flat[row - 1], take[row - 1], out=state[row])
        state[row] += keep[row - 1] * state[row - 1]
    return state


def _triangles(keep: np.ndarray, take: np.ndarray, own: np.ndarray, less: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Batches of a state s, s_(i+1) = keep_i s_i + take_i x_i, and results r_i = own_i x_i - less_i s_i of rows x.

    Args:
        keep: weight of the state in the next one, (n,).
        take: weight of the row in the next state, (n,).
        own: weight of the row in its result, (n,).
        less: weight of the state in the result, (n,).

    Returns:
        As `Gains.batches`.
    """
    parts = np.zeros((4, -(-len(keep) // BATCH_ROWS) * BATCH_ROWS))  # padded behind the last row
    parts[:, : len(keep)] = keep, take, own, less
    keep, take, own, less = parts.reshape(4, -1, BATCH_ROWS)
    count, width = keep.shape
    weights = np.zeros((count, width + 1, width + 1))
    weights[:, 0, 0] = 1.0
    for row in range(width):
        weights[:, : row + 1, row + 1] = keep[:, row, None] * weights[:, : row + 1, row]
        weights[:, row + 1, row + 1] = take[:, row]
    onward, every = weights[:, :, width].copy(), np.arange(width)
    weights = weights[:, :, :width] * -less[:, None]
    weights[:, every + 1, every] = own
    return weights, onward
