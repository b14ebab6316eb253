"""Periods of an error over a height or an angle that was visited unevenly."""

from dataclasses import dataclass

import numpy as np

LONGEST = 3.0  # periods that the range must hold at least
MOST_PERIODS = 120.0  # finer ones need a model of everything else first, which the diagnosis has
FINER = 2.0  # trial frequencies in one line width


@dataclass(frozen=True)
class Periodogram:
    """Share of the variance that a sine takes, by its period.

    Attributes:
        period: (f,) in the unit of the height, descending.
        share: (f,) 0 to 1, of the variance.
        chance: share that pure noise reaches in one run out of a hundred at its highest line.
    """

    period: np.ndarray
    share: np.ndarray
    chance: float

    @property
    def best(self) -> float:
        """Period of the highest line."""
        return float(self.period[np.argmax(self.share)])


def periodogram(height: np.ndarray, residual: np.ndarray, frequency: np.ndarray | None = None) -> Periodogram:
    """Lomb-Scargle periodogram with floating mean (Zechmeister and Kuerster 2009, eq. 5).

    Args:
        height: (n,) mm or rad.
        residual: (n,) mm.
        frequency: (f,) trial frequencies, ascending; None takes `trial_frequencies`.

    Returns:
        The periodogram; the chance level takes the lines as independent (Baluev 2008 shows it a good bound).
    """
    known = np.isfinite(height) & np.isfinite(residual)
    height, residual = height[known], residual[known]
    frequency = trial_frequencies(height) if frequency is None else frequency
    share = line_shares(height, residual, frequency)
    lines = max(len(frequency) / FINER, 1.0)
    freedom = max(len(height) - 3, 1)
    chance = -np.expm1(np.log(-np.expm1(np.log(0.99) / lines)) * 2.0 / freedom)
    return Periodogram(1.0 / frequency, share, float(chance))


def trial_frequencies(height: np.ndarray) -> np.ndarray:
    """Frequencies that a run can show: from three periods in the range to about one in two places visited.

    Args:
        height: (n,) mm or rad.

    Returns:
        (f,) ascending, 1/mm or 1/rad; empty where heights are too few.
    """
    places = np.unique(np.round(height, 6))
    if len(places) < 16:
        return np.zeros(0)
    span = places[-1] - places[0]
    # Unevenly spread heights show more than their mean spacing would; the median spacing is the shorter one.
    finest = min(MOST_PERIODS, span / (2.0 * float(np.median(np.diff(places)))), 0.5 * len(places) * 1.5)
    step = 1.0 / FINER
    return np.arange(LONGEST, max(finest, LONGEST + step), step) / span


def harmonics(height: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Cosine and sine of each frequency side by side.

    Args:
        height: (n,).
        frequency: (f,).

    Returns:
        (n, 2 f), single precision.
    """
    phase = (height - height.mean())[:, None] * frequency
    turn = ((phase - np.round(phase)) * (2.0 * np.pi)).astype(np.float32)
    return np.stack([np.cos(turn), np.sin(turn)], axis=2).reshape(len(height), -1)


def line_shares(height: np.ndarray, residual: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Share of the variance that each frequency takes.

    Args:
        height: (n,).
        residual: (n,).
        frequency: (f,).

    Returns:
        (f,), 0 to 1.
    """
    column = harmonics(height, frequency).astype(float)
    column -= column.mean(axis=0)
    centred = residual - residual.mean()
    cosine, sine = column[:, 0::2], column[:, 1::2]
    cc, ss, cs = (cosine**2).sum(axis=0), (sine**2).sum(axis=0), (cosine * sine).sum(axis=0)
    rc, rs = cosine.T @ centred, sine.T @ centred
    determinant = cc * ss - cs**2
    whole = determinant > 1e-9 * np.maximum(cc, ss) ** 2
    taken = np.where(whole, (ss * rc**2 + cc * rs**2 - 2.0 * cs * rc * rs) / np.where(whole, determinant, 1.0), 0.0)
    return taken / max(float(centred @ centred), 1e-300)


def refine_frequency(height: np.ndarray, residual: np.ndarray, frequency: float) -> float:
    """Find the top of a line.

    Args:
        height: (n,).
        residual: (n,).
        frequency: of the nearest trial.

    Returns:
        Frequency of the top, to a hundredth of a line width.
    """
    width = 1.0 / np.ptp(height)
    for reach, count in ((0.6 / FINER * 2, 25), (0.05, 11)):
        trial = frequency + np.linspace(-reach, reach, count) * width
        frequency = float(trial[np.argmax(line_shares(height, residual, trial))])
    return frequency
