"""Slow wander of the readings: noise with a memory, so that no effect is named for what the tracker did by itself."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ptt.noise import repeat_groups

if TYPE_CHECKING:
    from ptt.problem import Problem

SHARES = (0.1, 0.25, 0.6, 1.5, 4.0, 10.0)  # variance of the wander over that of the white noise
CONSTANTS = 6  # time constants tried
EVIDENCE = 10.0  # gain of the log-likelihood from which the noise counts as wandering
SCATTERED = 0.4  # step from row to row, in mean distances of two rows, from which poses count as in random order
LEAST_REPEATS = 30


@dataclass(frozen=True)
class Wander:
    """A first-order (Ornstein-Uhlenbeck) wander under white noise, alike in all coordinates.

    Attributes:
        share: its variance over that of the white noise.
        constant: its time constant, s (rows where there is no clock).
    """

    share: float
    constant: float


def find_wander(problem: "Problem", residual: np.ndarray) -> Wander | None:
    """Find slow wander in what a saturated model leaves.

    An error that depends on the pose looks slow where the poses follow a smooth path. So wander is looked for where
    poses come in random order; on a path only in how visits of one pose differ.

    Args:
        problem: n rows.
        residual: (n, 3) in noise units, NaN on rows that do not count.

    Returns:
        The wander, None where white noise does as well.
    """
    rows = np.flatnonzero(np.isfinite(residual).all(axis=1))
    values = residual[rows]
    if not _scattered(problem, rows):
        group = np.unique(repeat_groups(problem.table, problem.view.direction.numpy())[rows], return_inverse=True)[1]
        group = group.reshape(-1)
        count = np.bincount(group)
        if (count - 1).sum() < LEAST_REPEATS:
            return None
        mean = np.column_stack([np.bincount(group, column) for column in values.T]) / count[:, None]
        repeated = count[group] > 1
        rows, values = rows[repeated], (values - mean[group])[repeated]
    clock, starts = _clock(problem, rows)
    step = np.diff(clock)[~starts[1:]]
    if len(step) < LEAST_REPEATS or not (step > 0).any():
        return None
    constants = np.geomspace(2.0 * np.median(step[step > 0]), max(np.ptp(clock) / 3.0, 1.0), CONSTANTS)
    share, constant = (grid.ravel() for grid in np.meshgrid(SHARES, constants))
    likelihood = _likelihood(values, clock, starts, np.append(share, 0.0), np.append(constant, 1.0))
    best = int(np.argmax(likelihood[:-1]))
    if likelihood[best] - likelihood[-1] < EVIDENCE:
        return None
    return Wander(float(share[best]), float(constant[best]))


def take_off(values: np.ndarray, wander: Wander, problem: "Problem", rows: np.ndarray) -> np.ndarray:
    """Innovations of a Kalman filter: what each reading says beyond what the wander of those before it foretold.

    The filter is linear, so columns of a model go through it as readings do.

    Args:
        values: (n, 3, ...) in noise units.
        wander: the noise's memory.
        problem: n rows, for their clock.
        rows: rows that count, (n,) bool; the others stay as they are.

    Returns:
        Same shape; rows that count are white with the variance of the white part.
    """
    place = np.flatnonzero(rows)
    clock, starts = _clock(problem, place)
    gains, decays, widths = _gains(clock, starts, np.array([wander.share]), np.array([wander.constant]))
    result = values.copy()
    state = np.zeros(values.shape[1:])
    for index, row in enumerate(place):
        state = decays[index, 0] * state
        innovation = values[row] - state
        result[row] = innovation / np.sqrt(widths[index, 0])
        state = state + gains[index, 0] * innovation
    return result


def _scattered(problem: "Problem", rows: np.ndarray) -> bool:
    p = problem.view.p.numpy()[rows]
    shuffled = np.random.default_rng(0).permutation(len(p))
    between = np.linalg.norm(p - p[shuffled], axis=1).mean()
    return len(p) > 2 and np.linalg.norm(np.diff(p, axis=0), axis=1).mean() > SCATTERED * max(between, 1e-9)


def _clock(problem: "Problem", rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    view = problem.view
    clock = view.time.numpy() if "time" in view.varies else np.arange(view.rows, dtype=float)
    run = view.run.numpy()[rows]
    return clock[rows], np.concatenate([[True], run[1:] != run[:-1]])


def _gains(
    clock: np.ndarray, starts: np.ndarray, share: np.ndarray, constant: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Kalman gains, decays and innovation variances of rows under each setting, (n, s) each."""
    step = np.maximum(np.diff(clock, prepend=clock[:1]), 0.0)
    decays = np.where(starts[:, None], 0.0, np.exp(-step[:, None] / constant))
    gains, widths = np.zeros_like(decays), np.zeros_like(decays)
    variance = share.copy()
    for index, decay in enumerate(decays):
        variance = decay**2 * variance + (1.0 - decay**2) * share
        widths[index] = variance + 1.0
        gains[index] = variance / widths[index]
        variance = variance / widths[index]
    return gains, decays, widths


def _likelihood(
    values: np.ndarray, clock: np.ndarray, starts: np.ndarray, share: np.ndarray, constant: np.ndarray
) -> np.ndarray:
    """Log-likelihood of each setting, the overall scale taken out, (s,)."""
    gains, decays, widths = _gains(clock, starts, share, constant)
    state = np.zeros((len(share), 3))
    squares = np.zeros(len(share))
    for index, value in enumerate(values):
        state = decays[index][:, None] * state
        innovation = value - state
        squares += np.square(innovation).sum(axis=1) / widths[index]
        state = state + gains[index][:, None] * innovation
    size = values.size
    return -0.5 * (3.0 * np.log(widths).sum(axis=0) + size * np.log(squares / size))
