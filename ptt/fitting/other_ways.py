"""Other ways to say what a fit says: with a size of the drawing off that its model does not have, and other values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.fitting.drawn_sizes import DrawnSize, learn_beside
from ptt.fitting.evidence import LOG_SIZE_STD
from ptt.fitting.posterior import Posterior
from ptt.fitting.result import FitResult
from ptt.fitting.whitened import Total

TRIED_VARIANCES = (1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0)  # of a size, from a thirtieth of the usual size to ten of it
LOG_SIZE_STEP = 0.5 * np.log(10.0)  # between two such sizes, in nats
# prior probability of each grid point if the log-normal density were at its peak there
GRID_PRIOR = LOG_SIZE_STEP / (np.sqrt(2.0 * np.pi) * LOG_SIZE_STD)
GONE_SHARE = 0.1  # share of the variance that a group has in the fit below which its values count as zero
SAME_NATS = 0.05  # difference in nats below which two solutions are the same one, reached from two sides
CLEAR_ERRORS = 5.0  # standard errors from which a value is clearly another, so that no stated error covers it
CLEAR_SHARE = 1.0 / 3.0  # share of the effect's largest value from which it is
# probability from which a solution is mentioned: less moves no error by more than a thirtieth of the shift
LEAST_CHANCE = 1e-3


@dataclass(frozen=True)
class OtherWay:
    """A way to say the same.

    Attributes:
        chance: of it.
        size: of the drawing that is off in it.
        effects: of the fit, by key, whose values are clearly others in it.
        there: where all values are then.
    """

    chance: float
    size: DrawnSize
    effects: tuple[str, ...]
    there: Posterior


def other_ways(
    fitted: FitResult, total: Total, sizes: Sequence[DrawnSize], base: Posterior, ahead: float
) -> list[OtherWay]:
    """Other ways to say what a fit says, with one size of the drawing as far off as may be.

    Widths at the most evidence end at the fewest values that are not zero: where rails lean, zeros differ and the frame
    is free, at rails alone, that lean another way. Little more speaks for these than for all others, over all widths
    that a size may have. Each size is off or not by itself, so the chances of one are no part of another's.

    Args:
        fitted: the fit.
        total: sums of its columns and those of the sizes.
        sizes: of the drawing, each alone.
        base: the fit's values without any.
        ahead: log evidence of the likeliest way.

    Returns:
        Those that are likely enough, and have values clearly elsewhere.
    """
    found = list[OtherWay]()
    for size in sizes:
        ways = _with_size(fitted, total, size)
        odds = GRID_PRIOR * np.exp(np.minimum([way.total - ahead for way in ways], 0.0))
        for chance, there in zip(odds / (1.0 + odds.sum()), ways, strict=True):
            effects = _elsewhere(fitted, base, there) if chance > LEAST_CHANCE else ()
            found += [OtherWay(float(chance), size, effects, there)] if effects else []
    return found


def _with_size(fitted: FitResult, total: Total, size: DrawnSize) -> list[Posterior]:
    """Where all values are with a size of each width, from where the fit is and with each of its kinds at nothing."""
    kinds, group = fitted.layout.kinds, fitted.layout.group[fitted.layout.owner >= 0]
    ways = [learn_beside(fitted, total, (size,), held=width) for width in TRIED_VARIANCES]
    for number in np.unique(group[group >= 0]).tolist():
        if kinds[number] != "free":
            continue
        there = learn_beside(fitted, total, (size,), held=1.0, small=number)
        if there.group_variances[number] < GONE_SHARE * fitted.prior.group_variances[number]:
            start, known = there.group_variances[: len(kinds)], np.array([way.total for way in ways])
            again = [learn_beside(fitted, total, (size,), held=width, start=start) for width in TRIED_VARIANCES]
            ways += [way for way in again if np.abs(known - way.total).min() > SAME_NATS]
    return ways


def _elsewhere(fitted: FitResult, base: Posterior, there: Posterior) -> tuple[str, ...]:
    """Effects of a fit, by key, of which a value is clearly another."""
    layout, errors = fitted.layout, np.sqrt(np.diag(base.covariance))
    off = np.abs(there.values[: len(base.values)] - base.values)
    far = [
        np.maximum(CLEAR_ERRORS * errors, CLEAR_SHARE * np.abs(base.values[layout.owner == number]).max(initial=0.0))
        for number in range(len(layout.terms))
    ]  # fmt: skip
    return tuple(
        term.effect.key for number, term in enumerate(layout.terms) if (off > far[number])[layout.owner == number].any()
    )
