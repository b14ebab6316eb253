"""The tracker's wander: noise with a memory, filtered off columns and readings alike, run by run."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from ptt.run.noise import Noise

SHARES = np.geomspace(0.03, 60.0, 12)  # variance of the wander over that of the white noise
CONSTANTS = 9  # time constants between the shortest that is told from white noise and the longest
LONGEST = 4.0  # times a run: a stand that warms for an hour is a random walk in a run of minutes, wherever it began
SHORTEST = 4.0  # steps between rows: a shorter constant is white noise by another name
LEAST_STEPS = 12
STRETCH = 32  # rows whose innovations are worked out at once where columns lie one behind the other
MANY = 200  # columns from which a row of them is worth a step of its own
USUAL_SHARE, SPREAD = 0.5, np.log(4.0)  # log-normal prior of the share
Axes = tuple[float, float, float]
AS_NOISE: Axes = (1.0, 1.0, 1.0)
LIKE = 4.0  # of variances of the two blunt axes of a tracker, which differ where the range to the readings does
UNEVEN = 2.0  # of variances of the noise's axes, from which a stand and the air are two things: one step of the shares
FAULT = 10.0  # variance over that of the white noise from which a wander is no tracker's: air and stand do three sigma


@dataclass(frozen=True)
class Wander:
    """An Ornstein-Uhlenbeck wander under white noise.

    Air bends a beam and so moves readings as the noise does, most of all across the beam; a stand that leans moves
    them along every axis alike.

    Attributes:
        share: its variance over that of the white noise, the mean of all axes of both.
        constant: its time constant, s (rows where there is no clock).
        axes: by which the share is larger along each axis of the noise.
    """

    share: float
    constant: float
    axes: Axes = AS_NOISE

    @property
    def parts(self) -> tuple[tuple[slice, float], ...]:
        """Axes of the noise that wander alike, and their share."""
        if len(set(self.axes)) == 1:
            return ((slice(None), self.share * self.axes[0]),)
        return tuple((slice(k, k + 1), self.share * times) for k, times in enumerate(self.axes))

    @property
    def log_prior(self) -> float:
        """Log prior density of the share, up to a constant."""
        return -0.5 * (np.log(self.share / USUAL_SHARE) / SPREAD) ** 2


def kinds_of_wander(noise: Noise) -> tuple[Axes, ...]:
    """By which a wander's share is larger along each axis of the noise: of the air, and of a stand.

    A tracker is sharp along its beam and blunt across it, both ways. Noise of which one axis alone is loud is what a
    machine has left of its own way, and that says nothing of a stand.
    """
    squares = 1.0 / np.square(noise.whitener).sum(axis=1)
    sharp, blunt, bluntest = np.sort(squares).tolist()
    if bluntest < UNEVEN * sharp or bluntest > LIKE * blunt:
        return (AS_NOISE,)
    first, second, third = (squares.mean() / squares).tolist()
    return AS_NOISE, (first, second, third)


@dataclass(frozen=True)
class Clock:
    """When the rows were read.

    Attributes:
        time: (n,) s, or the row's number.
        starts: first row of each run, (n,) bool.
    """

    time: np.ndarray
    starts: np.ndarray
    _gains: dict[tuple[float, float], "Gains"] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def step(self) -> float:
        """Median time between rows of a run, zero where there is none."""
        steps = np.diff(self.time)[~self.starts[1:]]
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0

    @cached_property
    def span(self) -> float:
        """Time from the first row of a run to its last, of all runs together."""
        return float(np.maximum(np.diff(self.time), 0.0)[~self.starts[1:]].sum())

    @cached_property
    def constants(self) -> np.ndarray:
        """Time constants worth trying; none where rows are too few."""
        if len(self.time) < LEAST_STEPS or not self.step:
            return np.zeros(0)
        shortest = SHORTEST * self.step
        return np.geomspace(shortest, max(LONGEST * float(np.ptp(self.time)), 2.0 * shortest), CONSTANTS)

    def gains(self, share: float, constant: float) -> "Gains":
        """How a filter of a wander along one axis weighs the rows; what was worked out once is kept."""
        if (share, constant) not in self._gains:
            self._gains[share, constant] = _gains_of(share, constant, self)
        return self._gains[share, constant]

    def is_fault(self, wander: Wander | None) -> bool:
        """Whether a wander is more than a tracker does by itself."""
        return wander is not None and wander.share > FAULT and self.is_slow(wander)

    def is_slow(self, wander: Wander) -> bool:
        """Whether a wander lasts so many rows that it is more than white noise by another name."""
        return wander.constant > SHORTEST * self.step


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
        """What readings of each stretch of w rows (w, w + 1), and the state before it (w + 1,), foretell in it.

        In each of its rows, and in the next one.
        """
        count = len(self.keep) + 1
        keep, take = np.zeros((2, -(-count // STRETCH) * STRETCH))  # behind the last row nothing is foretold
        keep[: count - 1], take[: count - 1] = self.keep, self.take
        taken, kept = _triangles(keep.reshape(-1, STRETCH), take.reshape(-1, STRETCH))
        widths = [min(STRETCH, count - first) for first in range(0, count, STRETCH)]
        return [(own[:w, : w + 1], all_[: w + 1]) for own, all_, w in zip(taken, kept, widths, strict=True)]


def _triangles(keep: np.ndarray, take: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of all stretches at once, gains (s, w): (s, w, w + 1) and (s, w + 1)."""
    count, width = keep.shape
    taken, kept = np.zeros((count, width, width + 1)), np.ones((count, width + 1))
    for row in range(width):
        taken[:, :row, row + 1] = keep[:, row, None] * taken[:, :row, row]
        taken[:, row, row + 1] = take[:, row]
        kept[:, row + 1] = keep[:, row] * kept[:, row]
    return taken, kept


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
    white, log_noise = np.empty_like(values), 0.0
    for axes, share in wander.parts:
        own, gains = values[:, axes], clock.gains(share, wander.constant)
        flat = own.reshape(len(own), -1)
        foretold = _row_by_row if flat.shape[1] > MANY else _all_rows
        flat = (flat - foretold(flat, gains.keep, gains.take)) / gains.root[:, None]
        white[:, axes] = flat.reshape(own.shape)
        log_noise += gains.log_noise * own.shape[1]
    return white, log_noise


def filtered(rows: np.ndarray, wander: Wander | None, clock: Clock) -> tuple[np.ndarray, float]:
    """The same where the rows come last: some rows at a time are one product of matrices.

    Within a stretch the innovations are a triangle of weights times the readings, and the state with which it begins
    goes on into each of them.

    Args:
        rows: (.., 3, n) in noise units.
        wander: None for white noise.
        clock: of the rows.

    Returns:
        The same shape, white under the wander; and half the log-determinant of the noise's covariance.
    """
    if wander is None:
        return rows, 0.0
    if len(wander.parts) == 1:  # all axes alike: nothing has to be put together
        gains = clock.gains(wander.parts[0][1], wander.constant)
        return _filtered(rows.reshape(-1, rows.shape[-1]), gains).reshape(rows.shape), gains.log_noise * rows.shape[-2]
    white, log_noise = np.empty_like(rows), 0.0
    for axes, share in wander.parts:
        own, gains = rows[..., axes, :], clock.gains(share, wander.constant)
        white[..., axes, :] = _filtered(own.reshape(-1, rows.shape[-1]), gains).reshape(own.shape)
        log_noise += gains.log_noise * own.shape[-2]
    return white, log_noise


def _filtered(flat: np.ndarray, gains: Gains) -> np.ndarray:
    """Rows (r, n) of one axis, or of axes that wander alike."""
    white, state = np.empty_like(flat), np.zeros(len(flat))
    for first, (taken, kept) in zip(range(0, flat.shape[1], STRETCH), gains.stretches, strict=True):
        own = flat[:, first : first + STRETCH]
        foretold = own @ taken
        foretold += state[:, None] * kept
        width = own.shape[1]
        part = white[:, first : first + width]
        np.subtract(own, foretold[:, :width], out=part)
        part /= gains.root[first : first + width]
        state = foretold[:, width]
    return white


def likelihoods(left: np.ndarray, wanders: Sequence[Wander], clock: Clock) -> np.ndarray:
    """How likely each wander makes what is left, its white variance at the best, up to a constant, (w,) nats.

    Args:
        left: (n, 3) in noise units.
        wanders: to be compared.
        clock: of the rows.
    """
    shares = [[share for axes, share in wander.parts for _ in range(3)[axes]] for wander in wanders]
    gains = [clock.gains(share, one.constant) for one, own in zip(wanders, shares, strict=True) for share in own]
    # The axes behind each other for every wander: nothing is foretold from one to the next.
    keep, take = np.zeros((2, len(gains), len(left)))
    for index, each in enumerate(gains):
        keep[index, :-1], take[index, :-1] = each.keep, each.take
    every = np.tile(left.T, (len(wanders), 1))
    foretold = _all_rows(every.reshape(-1, 1), keep.ravel()[:-1], take.ravel()[:-1]).reshape(every.shape)
    white = (every - foretold) / np.array([each.root for each in gains])
    square = np.square(white).reshape(len(wanders), -1).sum(axis=1)
    log_noise = np.array([each.log_noise for each in gains]).reshape(-1, 3).sum(axis=1)
    prior = np.array([wander.log_prior for wander in wanders])
    return prior - log_noise - 0.5 * left.size * np.log(square)


def _all_rows(flat: np.ndarray, keep: np.ndarray, take: np.ndarray) -> np.ndarray:
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


def _gains_of(share: float, constant: float, clock: Clock) -> Gains:
    """Gains and variances of the innovations, which depend on the clock alone."""
    step = np.maximum(np.diff(clock.time, prepend=clock.time[:1]), 0.0)
    decay = np.where(clock.starts, 0.0, np.exp(-step / constant))
    gains, widths, variance = list[float](), list[float](), share
    for keep in np.square(decay).tolist():
        variance = keep * variance + (1.0 - keep) * share
        wide = variance + 1.0
        variance /= wide
        gains.append(variance)
        widths.append(wide)
    gain, width = np.array(gains), np.array(widths)
    keeps, takes = decay[1:] * (1.0 - gain[:-1]), decay[1:] * gain[:-1]
    return Gains(keeps, takes, np.sqrt(width), 0.5 * float(np.log(width).sum()))
