"""The tracker's wander: noise with a memory, filtered off columns and readings alike, run by run."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

SHARES = np.geomspace(0.03, 60.0, 12)  # variance of the wander over that of the white noise
CONSTANTS = 7  # time constants between the shortest that is told from white noise and half the run
SHORTEST = 4.0  # steps between rows: a shorter constant is white noise by another name
LEAST_STEPS = 12
MANY = 200  # columns from which a row of them is worth a step of its own
USUAL_SHARE, SPREAD = 0.5, np.log(4.0)  # log-normal prior of the share
FAULT = 10.0  # variance over that of the white noise from which a wander is no tracker's: air and stand do three sigma


@dataclass(frozen=True)
class Wander:
    """An Ornstein-Uhlenbeck wander under white noise, alike in all coordinates.

    Attributes:
        share: its variance over that of the white noise.
        constant: its time constant, s (rows where there is no clock).
    """

    share: float
    constant: float

    @property
    def log_prior(self) -> float:
        """Log prior density of the share, up to a constant."""
        return -0.5 * (np.log(self.share / USUAL_SHARE) / SPREAD) ** 2


@dataclass(frozen=True)
class Clock:
    """When the rows were read.

    Attributes:
        time: (n,) s, or the row's number.
        starts: first row of each run, (n,) bool.
    """

    time: np.ndarray
    starts: np.ndarray

    @property
    def step(self) -> float:
        """Median time between rows of a run, zero where there is none."""
        steps = np.diff(self.time)[~self.starts[1:]]
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0

    @property
    def constants(self) -> np.ndarray:
        """Time constants worth trying; none where rows are too few."""
        if len(self.time) < LEAST_STEPS or not self.step:
            return np.zeros(0)
        shortest = SHORTEST * self.step
        return np.geomspace(shortest, max(float(np.ptp(self.time)) / 2.0, 2.0 * shortest), CONSTANTS)

    def is_fault(self, wander: Wander | None) -> bool:
        """Whether a wander is more than a tracker does by itself."""
        return wander is not None and wander.share > FAULT and wander.constant > SHORTEST * self.step


def innovations(values: np.ndarray, wander: Wander | None, clock: Clock) -> tuple[np.ndarray, float]:
    """What each row says beyond what the wander of those before it foretold (a Kalman filter, which is linear).

    Args:
        values: (n, 3, ...) in noise units.
        wander: None for white noise.
        clock: of the rows.

    Returns:
        The same shape, white under the wander; and half the log-determinant of the noise's covariance.
    """
    if wander is None:
        return values, 0.0
    gain, decay, width = _gains(wander, clock)
    flat = values.reshape(len(values), -1)
    # The foretold state s follows s_i = decay_i ((1 - gain) s + gain x)_(i-1).
    keep, take = decay[1:] * (1.0 - gain[:-1]), decay[1:] * gain[:-1]
    foretold = _row_by_row if flat.shape[1] > MANY else _all_rows
    white = (flat - foretold(flat, keep, take)) / np.sqrt(width)[:, None]
    return white.reshape(values.shape), 1.5 * float(np.log(width).sum())


def _all_rows(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """The foretold states of a few columns: a bidiagonal system."""
    bands = np.ones((2, len(flat)))
    bands[1, :-1] = -keep
    side = np.zeros_like(flat)
    side[1:] = take[:, None] * flat[:-1]
    return np.asarray(linalg.solve_banded((1, 0), bands, side, overwrite_b=True, check_finite=False))


def _row_by_row(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
    """The same where columns are many: a row of them at a time stays in the cache, which is ten times faster."""
    state = np.zeros_like(flat)
    for row in range(1, len(flat)):
        np.multiply(flat[row - 1], take[row - 1], out=state[row])
        state[row] += keep[row - 1] * state[row - 1]
    return state


def _gains(wander: Wander, clock: Clock) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gain, decay and innovation variance of each row, which depend on the clock alone."""
    step = np.maximum(np.diff(clock.time, prepend=clock.time[:1]), 0.0)
    decay = np.where(clock.starts, 0.0, np.exp(-step / wander.constant))
    gain, width = np.empty(len(step)), np.empty(len(step))
    variance = wander.share
    for index, keep in enumerate(decay.tolist()):
        variance = keep * keep * variance + (1.0 - keep * keep) * wander.share
        wide = variance + 1.0
        gain[index], width[index] = variance / wide, wide
        variance = variance / wide
    return gain, decay, width
