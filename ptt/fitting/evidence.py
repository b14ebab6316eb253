"""How wide the unknowns of a linear problem are: one learned prior variance for each group, at the most evidence."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ptt.fitting.factor import factor_of
from ptt.fitting.posterior import Posterior

# std of the log-normal prior of a group's size: two in three lie within a factor of 8
LOG_SIZE_STD = float(np.log(8.0))
UNGROUPED_VARIANCE = 1e6  # prior variance of unknowns of no group: they take what the data ask for
# bounds of a group's prior variance: a thousandth to ten thousand usual sizes
LEAST_VARIANCE, MOST_VARIANCE = 1e-6, 1e8
MOST_ITERATIONS = 30  # of the ascent; it usually ends by its tolerance
TOLERANCE = 1e-3  # nats still to be gained at which the ascent ends
# share of the tolerance by which a step's gain may differ from the predicted one for it to be the last
PREDICTED_SHARE = 0.1
REMAINDER_FACTOR = 9.0  # four times the 9/4 of one variance (see `maximise`), as a margin for steps along several
LONG_STEP = 1.0  # change of a log variance by MacKay's rule from which his step is taken instead of Newton's
LONGEST_STEP = 4.0  # change of a log variance in one of Newton's steps, and downward in one of MacKay's
STEP_HALVINGS = 8  # of a Newton step, to a 128th of it: where even that does not rise, the maximum is reached
HOPE_FACTOR = 4.0  # times twice the gain predicted by slope and curvature: no more than that can still be gained
SQUARE_ROUNDING = 1e-13  # share of the sum of squares that is rounding
TINY_SQUARE = 1e-12  # least sum of squares: nothing scatters by a millionth of its noise


def maximise(
    gram: np.ndarray,
    side: np.ndarray,
    square: float,
    count: float,
    owner: np.ndarray,
    *,
    freedom: float,
    start: np.ndarray | None = None,
    floor: float | np.ndarray = LEAST_VARIANCE,
    ceiling: float | np.ndarray = MOST_VARIANCE,
    width: float | np.ndarray = LOG_SIZE_STD,
    wide: float = UNGROUPED_VARIANCE,
    done: float = TOLERANCE,
    least: float = -np.inf,
    finest: float = 0.0,
) -> Posterior:
    """Find the prior variance of each group of unknowns, and the unknowns with it.

    y = X b + e with e ~ N(0, phi) and b_i ~ N(0, phi d_g) for every unknown i of group g; phi is profiled against its
    own degrees of freedom, and no less than the last digit of a reading. The variances d maximise

        -1/2 log|X^T X + D^-1| - 1/2 log|D| - (N + nu)/2 (log phi + (nu + Q)/(nu + N)/phi - 1) + log prior(d),

    by MacKay's rule while they are far off and by Newton's method near the end; no step is taken that lowers it.

    Source: MacKay, Bayesian Interpolation, Neural Computation 4 (1992), for the evidence and its fixed point.

    Args:
        gram: X^T X of whitened rows, (P, P).
        side: X^T y, (P,).
        square: y^T y.
        count: N, number of coordinates.
        owner: (P,) int, group 0 .. G-1 of each unknown; -1 where the prior is `wide` and fixed.
        freedom: nu, degrees of freedom behind the noise that whitened the rows: 0 unknown, inf exact.
        start: (G,) variances to start from; None starts at the usual sizes.
        floor: least variance, one for all or (G,).
        ceiling: largest variance, one for all or (G,); equal to the floor for a group that is not learned.
        width: of the log-normal prior of a group's size (the root of its variance) about the usual one, in nats; inf
            for no prior; one for all or (G,).
        wide: prior variance of unknowns of no group.
        done: it ends where no more than this can still be gained, nats.
        least: it also ends where the total evidence can no longer reach this, nats: the caller drops such a set.
        finest: least phi.

    Returns:
        The posterior.
    """
    groups = int(owner.max(initial=-1)) + 1
    low, high, spread = (item + np.zeros(groups) for item in (floor, ceiling, width))
    problem = _Problem(gram, side, square, count, freedom, owner, spread, wide, finest)
    at = np.log(np.clip(np.ones(groups) if start is None else start, low, high))
    here = problem.evaluate(at)
    bottom, top = np.log(low), np.log(high)
    slope, ended = problem.slope(here), False
    for _ in range(MOST_ITERATIONS):
        free = (bottom < top) & ~((at <= bottom) & (slope.first < 0)) & ~((at >= top) & (slope.first > 0))
        newton = _newton(slope, free)
        hope = float(slope.first @ newton)
        if hope <= 2.0 * done:
            break
        if here.value + HOPE_FACTOR * hope < least and max(np.abs(newton).max(), _longest(slope, free)) < LONG_STEP:
            ended = True
            break
        found = _climb(problem, here, at, _steps(slope, newton, free), bottom, top)
        if found is None:
            break
        is_newton, gained = bool((found[0] == at + newton).all()), found[1].value - here.value
        at, here = found
        predicted = float(hope - 0.5 * newton @ slope.curvature @ newton)
        # Where the evidence rises just as its curvature predicted, what is still to be had is of a higher order: after
        # a whole step of Newton's that missed by e, it is e^2 9/4 over what was predicted.
        missed = abs(gained - predicted)
        if missed < PREDICTED_SHARE * done or (is_newton and REMAINDER_FACTOR * missed**2 < done * predicted):
            break
        slope = problem.slope(here)
    return problem.posterior(here, slope, ended)


def noise_of(left: np.ndarray, count: float, freedom: float, finest: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """White variance phi at the most evidence, and the evidence's term of it, for sums of squares Q, (..) each.

    Args:
        left: Q.
        count: N.
        freedom: nu.
        finest: least phi.
    """
    if np.isinf(freedom):
        return np.ones_like(left), 0.5 * (count - left)
    known = freedom + count
    own = (freedom + left) / known
    phi = np.maximum(own, finest)
    return phi, -0.5 * known * (np.log(phi) + own / phi - 1.0)


@dataclass(frozen=True)
class _Point:
    """The evidence and what it was made of at some log variances, unknowns in sorted order."""

    value: float
    values: np.ndarray
    factor: np.ndarray  # lower Cholesky factor of X^T X + D^-1
    prior: np.ndarray
    left: float
    phi: float
    scales: np.ndarray


@dataclass(frozen=True)
class _Slope:
    """Derivatives of the evidence by the log variances.

    Attributes:
        first: (G,).
        curvature: minus the second, (G, G).
        mackay: step to where his rule puts each log variance, (G,).
    """

    first: np.ndarray
    curvature: np.ndarray
    mackay: np.ndarray


class _Problem:
    """The sums in an order where every group is a run of columns."""

    def __init__(
        self, gram: np.ndarray, side: np.ndarray, square: float, count: float, freedom: float, owner: np.ndarray,
        spread: np.ndarray, wide: float, finest: float,
    ) -> None:  # fmt: skip
        self.order, self.group, self.spread, self.wide = np.arange(len(owner)), owner, spread, wide
        if (owner[1:] < owner[:-1]).any():
            self.order = np.argsort(owner, kind="stable")
            gram, side, self.group = gram[np.ix_(self.order, self.order)], side[self.order], owner[self.order]
        self.gram, self.side, self.square = gram, side, square
        self.count, self.freedom, self.finest, self.evaluations = count, freedom, finest, 0
        self.members = (self.group[:, None] == np.arange(len(spread))).astype(float)  # shape: (P, G)
        self.size = self.members.sum(axis=0)
        self.fixed = (len(owner) - self.size.sum()) * np.log(wide)

    def evaluate(self, logs: np.ndarray) -> _Point:
        """The evidence at some log variances, (G,)."""
        self.evaluations += 1
        scales = np.exp(logs)
        prior = np.append(scales, self.wide)[self.group]
        factor = factor_of(self.gram, 1.0 / prior)
        values = lapack.dpotrs(factor, self.side, lower=1)[0] if len(prior) else self.side
        # A quadratic form about its minimum: rounding of the values enters only squared.
        taken = float(values @ (2.0 * self.side - self.gram @ values - values / prior))
        left = max(self.square - taken, SQUARE_ROUNDING * self.square + TINY_SQUARE)
        phi, tail = map(float, noise_of(np.asarray(left), self.count, self.freedom, self.finest))
        log_prior = -0.125 * float(((logs / self.spread) ** 2).sum())
        half = float(np.log(factor.diagonal()).sum() + 0.5 * (self.size @ logs + self.fixed))
        return _Point(tail - half + log_prior, values, factor, prior, left, phi, scales)

    def slope(self, point: _Point) -> _Slope:
        """Derivatives by the log variances, and MacKay's step."""
        # Of the inverse the lower half is enough.
        half = lapack.dpotri(point.factor, lower=1)[0] if len(point.factor) else point.factor
        scales, members, diagonal, energy = point.scales, self.members, half.diagonal(), point.values**2
        pull, size = 0.25 / self.spread**2, 1.0 / scales
        both = size[:, None] * size
        moved = _between(half, members * point.values[:, None], (energy * diagonal) @ members) * both / point.phi
        shared = _between(half * half, members, diagonal**2 @ members) * both
        energy = (energy @ members) * size / point.phi
        decided = np.maximum(self.size - (diagonal @ members) * size, 1e-12)
        curvature = -(moved + 0.5 * shared)
        if not np.isinf(self.freedom) and point.phi > self.finest:
            curvature -= (0.5 / (self.freedom + self.count)) * energy[:, None] * energy
        curvature.ravel()[:: len(scales) + 1] += pull + 0.5 * (energy + self.size - decided)
        return _Slope(
            0.5 * (energy - decided) - pull * np.log(scales),
            curvature,
            np.maximum(np.log(np.maximum(energy, 1e-12) / decided), -LONGEST_STEP),
        )

    def posterior(self, point: _Point, slope: _Slope, ended: bool) -> Posterior:
        """The result, unknowns in the order that they were given in."""
        place = np.argsort(self.order)
        return Posterior(
            point.values[place], point.factor, self.order, point.prior[place], point.scales, slope.curvature,
            point.value, point.left, point.phi, self.evaluations, ended,
        )  # fmt: skip


def _between(half: np.ndarray, ways: np.ndarray, own: np.ndarray) -> np.ndarray:
    """W^T M W of a symmetric M of which only the lower half is there, zeros above it.

    Args:
        half: (P, P).
        ways: W, (P, G), no two of which share a row.
        own: what the diagonal of M alone gives on that of the result, (G,).
    """
    lower = ways.T @ (half @ ways)
    both = lower + lower.T
    both.ravel()[:: len(own) + 1] -= own
    return np.asarray(both)


def _newton(slope: _Slope, free: np.ndarray) -> np.ndarray:
    """An uphill step; where the evidence is not concave, along the same directions by the size of the curvature."""
    step = np.zeros_like(slope.first)
    if len(free) == 1:
        step = np.where(free, slope.first / np.maximum(np.abs(slope.curvature[0]), 1e-2), 0.0)
    elif free.any():
        strength, ways = np.linalg.eigh(slope.curvature[np.ix_(free, free)])
        step[free] = ways @ ((ways.T @ slope.first[free]) / np.maximum(np.abs(strength), 1e-2))
    return step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max(initial=0.0)), 1e-300))


def _steps(slope: _Slope, newton: np.ndarray, free: np.ndarray) -> Iterator[np.ndarray]:
    """Steps worth trying: MacKay's while it is long (near the end it is slow), then Newton's and parts of it.

    His rule knows no prior of the sizes: where that pulls the other way, it would press a group to its bound for good.
    """
    if _longest(slope, free) > LONG_STEP:
        yield np.where(_uphill(slope, free), slope.mackay, newton)
    yield from (newton * 0.5**n for n in range(STEP_HALVINGS))


def _uphill(slope: _Slope, free: np.ndarray) -> np.ndarray:
    """Groups whose evidence rises the way that MacKay's rule goes."""
    return np.asarray(free & (slope.mackay * slope.first > 0.0))


def _longest(slope: _Slope, free: np.ndarray) -> float:
    """The longest of MacKay's steps that go uphill."""
    return float(np.abs(slope.mackay[_uphill(slope, free)]).max(initial=0.0))


def _climb(
    problem: _Problem, here: _Point, at: np.ndarray, steps: Iterable[np.ndarray], bottom: np.ndarray, top: np.ndarray
) -> tuple[np.ndarray, _Point] | None:
    """The first step that raises the evidence."""
    for step in steps:
        there = np.clip(at + step, bottom, top)
        point = problem.evaluate(there)
        if point.value > here.value:
            return there, point
    return None
