"""Alternative solutions of a fit: with one further size of the drawing, and clearly other values of its effects."""

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
    """An alternative solution.

    Attributes:
        chance: its probability.
        size: the further size of the drawing.
        effects: keys of the fit's effects whose values are clearly different.
        there: its posterior.
    """

    chance: float
    size: DrawnSize
    effects: tuple[str, ...]
    there: Posterior


def other_ways(
    fitted: FitResult, total: Total, sizes: Sequence[DrawnSize], base: Posterior, ahead: float
) -> list[OtherWay]:
    """Alternative solutions with one further size of the drawing, on a grid of its prior variance.

    Learned variances lead to sparse solutions: where rails lean, zeros differ and the frame is free, to rails alone
    that lean differently. Integrated over the prior variance, these are hardly more probable than others. Each size is
    judged by itself, so probabilities of different sizes do not share one total.

    Args:
        fitted: the fit.
        total: sums of its columns and those of the sizes.
        sizes: further sizes of the drawing, each tried alone.
        base: posterior without any of them.
        ahead: log evidence of the likeliest solution.

    Returns:
        Those that are probable enough and have clearly different values.
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
    """Posteriors with a size at each prior variance, started from the fit and with each of its groups near zero."""
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
    """Keys of a fit's effects with a clearly different value."""
    layout, errors = fitted.layout, np.sqrt(np.diag(base.covariance))
    off = np.abs(there.values[: len(base.values)] - base.values)
    far = [
        np.maximum(CLEAR_ERRORS * errors, CLEAR_SHARE * np.abs(base.values[layout.owner == number]).max(initial=0.0))
        for number in range(len(layout.terms))
    ]  # fmt: skip
    return tuple(
        term.effect.key for number, term in enumerate(layout.terms) if (off > far[number])[layout.owner == number].any()
    )
