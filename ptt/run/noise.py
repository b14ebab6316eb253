"""Scatter of one reading: its covariance, and where that comes from."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from ptt.record import Record

ROUNDING = 1e-9  # share of the summed variances below which the variance of a direction is rounding
NOTHING = 1e-18  # mm^2: no reading is better than a nanometre
STEPS = tuple(digit * 10.0**-power for power in range(1, 5) for digit in (5.0, 2.0, 1.0))  # mm, steps of last digits
ON_STEP = 1e-5  # share of a step by which a reading may be off a whole number of steps
FIRST = 1000  # readings that are tested before all of them are
SATURATED = "saturated model"  # source: the residual of everything that could be fitted at once
REPEATS = "repeats"  # source: scatter of repeats
GUESSED = "first guess"  # source: none; used as weights in a fit, never reported
VISITED = f"{SATURATED}; readings of one visit scatter by less"  # source where no pose was visited a second time
COARSEST = 0.01  # mm: a coarser step is not that of a tracker's last digit
READABLE = 1e-4  # mm: no tracker resolves less, the air alone moves its beam by more
DEFAULT_SIGMA = 0.005  # mm, one coordinate of a hand-held reflector: the first guess


@dataclass(frozen=True)
class Noise(Record):
    """Scatter of one reading.

    Attributes:
        covariance: (3, 3) mm^2 of the coordinates of one reading, in the base frame.
        source: where it comes from: 'repeats', 'std columns', 'machine file', 'saturated model' (perhaps with a remark
            behind it), 'first guess' where there is nothing.
        freedom: its degrees of freedom, of coordinates for a saturated model, of readings (three coordinates) for
            repeats; infinite where it was stated.
        stated: source and total (mm) that std columns or the machine file state instead; None where they do not.
        least: mm^2, lower bound of the variance of one coordinate, by resolution.
    """

    keys: ClassVar[str] = "x: sigma.0 [um], y: sigma.1 [um], z: sigma.2 [um], total: total [um], source"

    covariance: np.ndarray
    source: str
    freedom: float = np.inf
    stated: tuple[str, float] | None = None
    least: float = NOTHING

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviation of each coordinate, (3,) mm."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def total(self) -> float:
        """Root of the summed variances, mm: the noise floor of `total` errors."""
        return float(np.sqrt(np.trace(self.covariance)))

    @cached_property
    def whitener(self) -> np.ndarray:
        """Whitening matrix W, (3, 3) 1/mm: W^T W is the inverse covariance; its rows are the principal axes."""
        least = max(ROUNDING * float(np.trace(self.covariance)), NOTHING)
        squares, ways = np.linalg.eigh(at_least(self.covariance, least))
        return np.asarray(ways.T / np.sqrt(squares)[:, None])

    def log_density(self, rows: int) -> float:
        """Normalisation of the log likelihood of a number of readings: -rows/2 log det(covariance).

        The log likelihood is this less half of chi-squared, up to a constant that does not depend on the noise; so
        explanations with different noise compare.
        """
        return rows * float(np.linalg.slogdet(self.whitener)[1])


def source_in_words(source: str) -> str:
    """Where a noise comes from, within a sentence: 'repeats', but 'the machine file', 'the std columns'."""
    return source if source == REPEATS else f"the {source}"


def guessed_noise() -> Noise:
    """The noise to start with where none is known."""
    return Noise(np.eye(3) * DEFAULT_SIGMA**2, GUESSED)


def at_least(covariance: np.ndarray, variance: float) -> np.ndarray:
    """A covariance with its eigenvalues raised to a lower bound, (3, 3) mm^2; unchanged where none is below.

    Args:
        covariance: (3, 3) mm^2.
        variance: the bound, mm^2.
    """
    sizes, ways = np.linalg.eigh(covariance)
    if sizes[0] >= variance:
        return covariance
    return np.asarray((ways * np.maximum(sizes, variance)) @ ways.T)


def step_of(reading: np.ndarray) -> float:
    """Resolution of readings: the step of their last digit, mm.

    Args:
        reading: (n, 3) mm, in the tracker's own axes.

    Returns:
        The largest of the usual decimal steps of which all readings are whole multiples; zero where there is none.
    """
    for step in STEPS:
        if _are_whole(reading[:FIRST], step) and _are_whole(reading, step):
            return step
    return 0.0


def _are_whole(reading: np.ndarray, step: float) -> bool:
    steps = reading / step
    return bool((np.abs(steps - np.round(steps)) < ON_STEP).all())


def least_variance(reading: np.ndarray, stated: float = np.inf) -> float:
    """Lower bound of the variance of one coordinate by resolution, mm^2.

    Args:
        reading: (n, 3) mm.
        stated: known variance of one coordinate, mm^2: an instrument may resolve less than any tracker.

    Returns:
        That of rounding to the last digit, or that of the best tracker.
    """
    step = step_of(reading)
    return max(step**2 / 12.0 if step <= COARSEST else 0.0, min(READABLE**2, stated))
