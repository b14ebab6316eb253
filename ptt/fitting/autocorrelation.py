"""Residuals that are autocorrelated in time, and the sandwich covariance of a fit to such rows.

A wandering tracker, and physics that a model lacks, leave residuals that are correlated in time. The values of a fit
hardly suffer, but a parameter that varies as slowly as the wander is known less well than from as many independent
rows: with H the normal matrix and V the covariance of the residuals, its covariance is H^-1 (X^T V X) H^-1.

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
class Autocorrelation:
    """Autocorrelated part of residuals, with covariance variance * exp(-|dt| / constant).

    Attributes:
        variance: per axis, (3,), in units of noise squared; zero where there is none.
        constant: time constant, s (rows where there is no clock).
    """

    variance: np.ndarray
    constant: float


@dataclass(frozen=True)
class Times:
    """When the rows were read.

    Attributes:
        time: (n,) s, or row numbers where there is no clock.
        run: run number of each row, (n,).
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


def autocorrelation_of(residual: np.ndarray, times: Times) -> Autocorrelation | None:
    """The autocorrelated part of residuals, if it is significant.

    Args:
        residual: (n, 3) in units of noise.
        times: of the rows.

    Returns:
        None where rows are too few or may be independent.
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
        errors = weight @ product / np.maximum(square * np.sqrt(energy), TINY_VARIANCE)  # in standard errors
        worth = float((np.maximum(errors, 0.0) ** 2).sum())
        if errors.max() > SURE_ERRORS and worth > best:
            # Where one axis is significant, the estimates of the others count as well.
            best, told = worth, Autocorrelation(np.clip(weight @ product / energy, 0.0, square), float(constant))
    return told


def _products(residual: np.ndarray, times: Times) -> tuple[np.ndarray, np.ndarray]:
    """Times between pairs of rows of one run, (m,), and products of their residuals per axis, (m, 3)."""
    rows = len(residual)
    lags = np.unique(np.geomspace(1, max(rows // 2, 1), MOST_LAGS).astype(int))
    gaps, products = [np.zeros(0)], [np.zeros((0, 3))]
    for lag in lags[lags < rows]:
        same = times.run[lag:] == times.run[:-lag]
        gaps.append(np.abs(times.time[lag:] - times.time[:-lag])[same])
        products.append((residual[lag:] * residual[:-lag])[same])
    return np.concatenate(gaps), np.concatenate(products)


def excess_scatter(
    jacobian: np.ndarray, residual: np.ndarray, times: Times, inverse: np.ndarray, scatter: float
) -> np.ndarray | None:
    """What autocorrelation adds to X^T V X, compared with independent rows of the same variance.

    Args:
        jacobian: X, (n, 3, u) in units of noise and usual size.
        residual: (n, 3) in units of noise.
        times: of the rows.
        inverse: inverse of the normal matrix, prior included, (u, u).
        scatter: variance of each row, in units of noise squared.

    Returns:
        (u, u); None where there is no autocorrelation. The fit absorbs part of a slow wander, so what is left of it is
        scaled up accordingly.
    """
    told = autocorrelation_of(residual, times)
    if told is None:
        return None
    # Not more than the mean variance, which was counted for each axis.
    counted = np.minimum(told.variance, MOST_CORRELATED * scatter)
    joined, own = _joined(jacobian, told, times), np.einsum("nai,naj,a->ij", jacobian, jacobian, counted)
    whole = len(residual) * float(told.variance.sum())
    swallowed = min(float(np.einsum("ij,ji->", inverse, joined)) / whole, MOST_SWALLOWED)
    return joined / (1.0 - swallowed) - own


def _joined(jacobian: np.ndarray, told: Autocorrelation, times: Times) -> np.ndarray:
    """X^T K X, summed over axes with their variances, with K = exp(-|dt|/T) within runs, (u, u), in one pass."""
    scaled = jacobian * np.sqrt(told.variance)[:, None]
    step, state, before = np.diff(times.time, prepend=times.time[:1]), np.zeros(scaled.shape[1:]), np.empty_like(scaled)
    for row, keep in enumerate(kept_shares(step, times.starts, told.constant).tolist()):
        before[row] = state = state * keep
        state = state + scaled[row]
    flat, earlier = scaled.reshape(-1, scaled.shape[2]), before.reshape(-1, scaled.shape[2])
    cross = flat.T @ earlier
    return np.asarray(flat.T @ flat + cross + cross.T)
