"""The tracker's wander: Ornstein-Uhlenbeck noise, filtered off columns and readings by a Kalman filter, run by run."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ptt.diagnosis.noise.gains import Gains, all_rows, filter_rows, gains_of, predict
from ptt.run.fading import kept_shares
from ptt.run.noise import Noise

SHARES = np.geomspace(0.03, 60.0, 12)  # tried variances of the wander over the white variance
TIME_CONSTANTS = 9  # number of tried time constants, from the shortest told from white noise to the longest
# Longest time constant in lengths of the longest run: beyond, a wander is a random walk wherever it began
LONGEST_RUNS = 4.0
SHORTEST_STEPS = 4.0  # shortest time constant in steps between rows: below, a wander is white noise by another name
LEAST_WANDER_ROWS = 12  # rows from which a wander is looked for
USUAL_SHARE, SHARE_LOG_STD = 0.5, np.log(4.0)  # median and log standard deviation of the log-normal prior of the share
Axes = tuple[float, float, float]  # factor on the share along each axis of the noise
AS_NOISE: Axes = (1.0, 1.0, 1.0)  # a wander that is distributed over the axes as the white noise is
# Ratio of the variances of a tracker's two axes across its beam, as the range to the readings differs
BLUNT_RATIO = 4.0
# Ratio of the noise's axis variances from which a stand's and the air's wander differ: one step of `SHARES`
SHARP_RATIO = 2.0
FAULT_SHARE = 10.0  # share from which a wander is no tracker's: air and stand wander by up to three sigma of the noise


@dataclass(frozen=True)
class Wander:
    """An Ornstein-Uhlenbeck process beside white noise.

    Air bends the beam and so moves readings as the noise does, mostly across the beam; a leaning stand moves them
    equally along all axes.

    Attributes:
        share: its variance over the white variance, both averaged over the axes.
        constant: its time constant, s (rows where there is no clock).
        axes: factor on the share along each axis of the noise.
    """

    share: float
    constant: float
    axes: Axes = AS_NOISE

    @property
    def parts(self) -> tuple[tuple[slice, float], ...]:
        """Axes of the noise with the same share, and that share."""
        if len(set(self.axes)) == 1:
            return ((slice(None), self.share * self.axes[0]),)
        return tuple((slice(k, k + 1), self.share * times) for k, times in enumerate(self.axes))

    @property
    def log_prior(self) -> float:
        """Log prior density of the share, up to a constant."""
        return -0.5 * (np.log(self.share / USUAL_SHARE) / SHARE_LOG_STD) ** 2


def kinds_of_wander(noise: Noise) -> tuple[Axes, ...]:
    """Axis factors of the wanders to try: that of the air (as the noise), and that of a stand (equal in mm).

    The second only where the noise looks like a tracker's: small along the beam, larger and similar on the two axes
    across it. If one axis alone is noisy, that is a residual of the machine and says nothing about a stand.
    """
    squares = 1.0 / np.square(noise.whitener).sum(axis=1)
    sharp, blunt, bluntest = np.sort(squares).tolist()
    if bluntest < SHARP_RATIO * sharp or bluntest > BLUNT_RATIO * blunt:
        return (AS_NOISE,)
    first, second, third = (squares.mean() / squares).tolist()
    return AS_NOISE, (first, second, third)


@dataclass(frozen=True)
class Clock:
    """When the rows were read.

    Attributes:
        time: (n,) s, or row numbers where there is no clock; it never goes back.
        starts: first row of each run, (n,) bool.
        registered: whether the frame was registered at the start of each run: it is trusted, or given by base
            reflectors.
    """

    time: np.ndarray
    starts: np.ndarray
    registered: bool = False
    _gains: dict[tuple[float, float], Gains] = field(default_factory=dict, compare=False, repr=False)
    _decays: dict[float, np.ndarray] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def step(self) -> float:
        """Median time between rows of a run; zero where time stands still."""
        steps = np.diff(self.time)[~self.starts[1:]]
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0

    @cached_property
    def span(self) -> float:
        """Time from the first row of a run to its last, summed over the runs."""
        return float(self.lasts.sum())

    @cached_property
    def constants(self) -> np.ndarray:
        """Grid of time constants to try; empty where rows are too few."""
        if len(self.time) < LEAST_WANDER_ROWS or not self.step:
            return np.zeros(0)
        shortest = SHORTEST_STEPS * self.step
        return np.geomspace(shortest, max(LONGEST_RUNS * float(self.lasts.max()), 2.0 * shortest), TIME_CONSTANTS)

    @cached_property
    def lasts(self) -> np.ndarray:
        """Time from the first row of each run to its last, (runs,)."""
        run = np.cumsum(self.starts) - 1
        step = np.where(self.starts[1:], 0.0, np.maximum(np.diff(self.time), 0.0))
        return np.bincount(run[1:], step, minlength=int(run[-1]) + 1)

    def gains(self, share: float, constant: float) -> Gains:
        """Kalman gains of a wander along one axis; cached."""
        if (share, constant) not in self._gains:
            self._gains[share, constant] = gains_of(share, self.decays(constant), self.begun(constant))
        return self._gains[share, constant]

    def begun(self, constant: float) -> np.ndarray:
        """Initial variance of a wander at the first row of each run, over its stationary one, (n,); one at other rows.

        A frame registered at the start of the run is then off by no more than the wander moves from the first row to
        the last. With the stationary variance, a wander slower than the run could shift such a frame at no cost, as
        joint zeros and tower positions do. A fitted frame takes that level itself.
        """
        whole = np.ones(len(self.time))
        if not self.registered:
            return whole
        run = np.cumsum(self.starts) - 1
        return np.where(self.starts, -np.expm1(-2.0 * self.lasts / constant)[run], whole)

    def about_means(self, left: np.ndarray) -> np.ndarray:
        """Values of rows (n, ..) less their mean over each run."""
        first = np.flatnonzero(self.starts)
        count = np.diff(np.append(first, len(left)))
        return np.asarray(left - np.repeat((np.add.reduceat(left, first).T / count).T, count, axis=0))

    def decays(self, constant: float) -> np.ndarray:
        """exp(-dt / constant) from each row's predecessor, (n,); zero where a run starts."""
        if constant not in self._decays:
            step = np.diff(self.time, prepend=self.time[:1])
            self._decays[constant] = kept_shares(step, self.starts, constant)
        return self._decays[constant]

    def is_fault(self, wander: Wander | None) -> bool:
        """Whether a wander is slow and larger than a tracker's own."""
        return wander is not None and wander.share > FAULT_SHARE and self.is_slow(wander)

    def is_slow(self, wander: Wander) -> bool:
        """Whether the time constant spans so many rows that the wander is not white noise by another name."""
        return wander.constant > SHORTEST_STEPS * self.step


def innovations(values: np.ndarray, wander: Wander | None, clock: Clock) -> tuple[np.ndarray, float]:
    """Scaled innovations of rows under a wander, by a Kalman filter.

    Args:
        values: (n, 3, ...) in noise units.
        wander: None for white noise.
        clock: of the rows.

    Returns:
        Innovations over their standard deviations, in the same shape; and half the log-determinant of the covariance.
    """
    if wander is None:
        return values, 0.0
    white, log_noise = np.empty_like(values), 0.0
    for axes, share in wander.parts:
        own, gains = values[:, axes], clock.gains(share, wander.constant)
        flat = own.reshape(len(own), -1)
        predicted = predict(flat, gains.keep, gains.take)
        flat = (flat - predicted) / gains.root[:, None]
        white[:, axes] = flat.reshape(own.shape)
        log_noise += gains.log_noise * own.shape[1]
    return white, log_noise


def filtered(rows: np.ndarray, wander: Wander | None, clock: Clock) -> tuple[np.ndarray, float]:
    """As `innovations` with the rows as the last axis, which allows products of matrices.

    Args:
        rows: (.., 3, n) in noise units.
        wander: None for white noise.
        clock: of the rows.

    Returns:
        Innovations over their standard deviations, in the same shape; and half the log-determinant of the covariance.
    """
    if wander is None:
        return rows, 0.0
    white, log_noise = np.empty(rows.shape), 0.0
    flat, filled = (each.reshape(-1, *rows.shape[-2:]) for each in (rows, white))
    for axes, share in wander.parts:
        own, gains = flat[:, axes], clock.gains(share, wander.constant)
        filter_rows(own.reshape(-1, own.shape[2]), gains, filled[:, axes].reshape(-1, own.shape[2]))
        log_noise += gains.log_noise * own.shape[1]
    return white, log_noise


def likelihoods(left: np.ndarray, wanders: Sequence[Wander], clock: Clock) -> np.ndarray:
    """Log likelihood plus log prior of each wander given a residual, the white variance profiled out, (w,) nats.

    Args:
        left: residual, (n, 3) in noise units.
        wanders: to be compared.
        clock: of the rows.
    """
    shares = [[share for axes, share in wander.parts for _ in range(3)[axes]] for wander in wanders]
    gains = [clock.gains(share, one.constant) for one, own in zip(wanders, shares, strict=True) for share in own]
    # The axes of all wanders are concatenated to one series; zero gains in between decouple them.
    keep, take = np.zeros((2, len(gains), len(left)))
    for index, each in enumerate(gains):
        keep[index, :-1], take[index, :-1] = each.keep, each.take
    every = np.tile(left.T, (len(wanders), 1))
    predicted = all_rows(every.reshape(-1, 1), keep.ravel()[:-1], take.ravel()[:-1]).reshape(every.shape)
    white = (every - predicted) / np.array([each.root for each in gains])
    square = np.square(white).reshape(len(wanders), -1).sum(axis=1)
    log_noise = np.array([each.log_noise for each in gains]).reshape(-1, 3).sum(axis=1)
    prior = np.array([wander.log_prior for wander in wanders])
    return prior - log_noise - 0.5 * left.size * np.log(square)


def tracker_likelihood(left: np.ndarray, noise: Noise, clock: Clock) -> float:
    """Log likelihood plus log prior of the best wander of a tracker, or of none, given a residual, nats.

    Args:
        left: residual, (n, 3) in noise units.
        noise: its noise.
        clock: of the rows.
    """
    wanders = [
        Wander(float(share), float(constant), axes)
        for axes in kinds_of_wander(noise) for share in SHARES for constant in clock.constants
    ]  # fmt: skip
    return max(white_likelihood(left), float(likelihoods(left, wanders, clock).max()))


def white_likelihood(left: np.ndarray, taken: float = 0.0, log_noise: float = 0.0) -> float:
    """Log likelihood of residuals (n, 3), the white variance profiled out, nats.

    Args:
        left: the residuals, in noise units.
        taken: what a memory of the noise takes off their sum of squares.
        log_noise: half the log-determinant of its covariance beside white noise.
    """
    return -log_noise - 0.5 * left.size * float(np.log(np.square(left).sum() - taken))
