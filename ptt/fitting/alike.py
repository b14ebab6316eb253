"""Rows that err alike because they were read one soon after the other: what that takes from their word on a parameter.

A tracker that wanders, and physics that a model lacks, leave residuals that are alike along the time. The values of a
fit hardly suffer, but a parameter that varies as slowly as the wander is known less well than as many independent rows
would tell it: the covariance becomes H^-1 (X^T V X) H^-1 with the V that the residuals show.

Source: sandwich covariance under correlated errors, White, Econometrica 48, 1980; the correlation is that of an
Ornstein-Uhlenbeck process, exp(-|dt|/T), matched to products of residuals.
"""

from dataclasses import dataclass

import numpy as np

from ptt.run.fading import kept_shares
from ptt.run.problem import Problem

MOST_LAGS = 16  # numbers of rows apart, from neighbours to half the rows, at which products of residuals are looked at
TIME_CONSTANTS = 9  # number of tried time constants, from two steps of the clock to half the run
# standard errors of an autocovariance: one sound run in a hundred passes on some axis at some constant
SURE_ERRORS = 3.5
LEAST_LAGGED_ROWS = 24  # rows from which products of residuals say anything
TINY_VARIANCE = 1e-300  # keeps a division by a variance of zero finite
# share of a row's variance that may be autocorrelated at most: rounding must not make the rest negative
MOST_CORRELATED = 0.9
# share of its variance that the fit may have absorbed at most, beyond which the residual says nothing
MOST_SWALLOWED = 0.8


@dataclass(frozen=True)
class Alike:
    """Part of the residuals that lasts from row to row.

    Attributes:
        variance: (3,) of it per axis, in units of noise squared; zero where none shows.
        constant: time in which it falls to 1/e.
    """

    variance: np.ndarray
    constant: float


@dataclass(frozen=True)
class Times:
    """When the rows were read.

    Attributes:
        time: (n,) s, or the row's number where there is no clock.
        run: (n,) number of the run.
    """

    time: np.ndarray
    run: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """First row of each run, (n,) bool."""
        return np.diff(self.run, prepend=self.run[:1] - 1) != 0


def times_of(problem: Problem, rows: np.ndarray) -> Times:
    """When some rows were read.

    Args:
        problem: n rows.
        rows: (n,) bool.

    Returns:
        Their times.
    """
    view = problem.view
    return Times(view.clock.numpy()[rows], view.run.numpy()[rows])


def alike_in_time(residual: np.ndarray, times: Times) -> Alike | None:
    """The part of residuals that lasts, if there is any.

    Args:
        residual: (n, 3) in units of noise.
        times: of the rows.

    Returns:
        None where rows are too few, or may well be independent.
    """
    gap, product = _products(residual, times)
    if len(residual) < LEAST_LAGGED_ROWS or not len(gap):
        return None
    shortest = 2.0 * float(np.median(gap[: len(residual) - 1])) or 1.0
    longest = max(0.5 * float(np.ptp(times.time)), shortest)
    best, told, square = 0.0, None, (residual**2).mean(axis=0)
    for constant in np.geomspace(shortest, longest, TIME_CONSTANTS):
        weight = np.exp(-gap / constant)
        energy = float(weight @ weight)
        sure = weight @ product / np.maximum(square * np.sqrt(energy), TINY_VARIANCE)
        worth = float((np.maximum(sure, 0.0) ** 2).sum())
        if sure.max() > SURE_ERRORS and worth > best:
            # Where one axis errs alike for sure the others may: what they show counts, sure or not.
            best, told = worth, Alike(np.clip(weight @ product / energy, 0.0, square), float(constant))
    return told


def _products(residual: np.ndarray, times: Times) -> tuple[np.ndarray, np.ndarray]:
    """Times between rows of one run, (m,), and products of their residuals per axis, (m, 3)."""
    rows = len(residual)
    lags = np.unique(np.geomspace(1, max(rows // 2, 1), MOST_LAGS).astype(int))
    gaps, products = [np.zeros(0)], [np.zeros((0, 3))]
    for lag in lags[lags < rows]:
        same = times.run[lag:] == times.run[:-lag]
        gaps.append(np.abs(times.time[lag:] - times.time[:-lag])[same])
        products.append((residual[lag:] * residual[:-lag])[same])
    return np.concatenate(gaps), np.concatenate(products)


def excess(
    jacobian: np.ndarray, residual: np.ndarray, times: Times, inverse: np.ndarray, scatter: float
) -> np.ndarray | None:
    """What rows that err alike add to X^T V X beyond independent rows of the same scatter.

    Args:
        jacobian: X, (n, 3, u) in units of noise and usual size.
        residual: (n, 3) in units of noise.
        times: of the rows.
        inverse: of the normal equations, prior included, (u, u).
        scatter: variance that each row has as an independent one, in units of noise squared.

    Returns:
        (u, u), None where nothing shows. A fit swallows part of a slow wander; what it left is scaled up by that.
    """
    told = alike_in_time(residual, times)
    if told is None:
        return None
    # An axis that scatters by more than the others was not counted in full.
    counted = np.minimum(told.variance, MOST_CORRELATED * scatter)
    joined, own = _joined(jacobian, told, times), np.einsum("nai,naj,a->ij", jacobian, jacobian, counted)
    whole = len(residual) * float(told.variance.sum())
    swallowed = min(float(np.einsum("ij,ji->", inverse, joined)) / whole, MOST_SWALLOWED)
    return joined / (1.0 - swallowed) - own


def _joined(jacobian: np.ndarray, told: Alike, times: Times) -> np.ndarray:
    """X^T K X per axis times its variance, K = exp(-|dt|/T) within runs, by one pass over the rows, (u, u)."""
    scaled = jacobian * np.sqrt(told.variance)[:, None]
    step, state, before = np.diff(times.time, prepend=times.time[:1]), np.zeros(scaled.shape[1:]), np.empty_like(scaled)
    for row, keep in enumerate(kept_shares(step, times.starts, told.constant).tolist()):
        before[row] = state = state * keep
        state = state + scaled[row]
    flat, earlier = scaled.reshape(-1, scaled.shape[2]), before.reshape(-1, scaled.shape[2])
    cross = flat.T @ earlier
    return np.asarray(flat.T @ flat + cross + cross.T)
