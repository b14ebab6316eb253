"""Empirical Bayes for a linear problem: one prior variance for each group of unknowns, at the largest evidence."""

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
REMAINDER_FACTOR = 9.0  # four times the 9/4 of one variance (see `_is_last`), as a margin for steps along several
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
    group: np.ndarray,
    *,
    freedom: float,
    start: np.ndarray | None = None,
    floor: float | np.ndarray = LEAST_VARIANCE,
    ceiling: float | np.ndarray = MOST_VARIANCE,
    log_size_std: float | np.ndarray = LOG_SIZE_STD,
    ungrouped_variance: float = UNGROUPED_VARIANCE,
    tolerance: float = TOLERANCE,
    least_total: float = -np.inf,
    least_phi: float = 0.0,
) -> Posterior:
    """Find the prior variance of each group of unknowns that maximises the evidence, and the posterior there.

    y = X b + e with e ~ N(0, phi) and b_i ~ N(0, phi d_g) for every unknown i of group g. The white variance phi is
    profiled out under a prior worth nu degrees of freedom. With D the diagonal of the d and Q the penalised sum of
    squares |y - X b|^2 + b^T D^-1 b at its minimum, the group variances d maximise

        -1/2 log|X^T X + D^-1| - 1/2 log|D| - (N + nu)/2 (log phi + (nu + Q)/(nu + N)/phi - 1) + log prior(d),

    by MacKay's fixed point while they are far off and by Newton's method near the end; no step is taken that lowers it.

    Source: MacKay, Bayesian Interpolation, Neural Computation 4 (1992), for the evidence and its fixed point.

    Args:
        gram: X^T X of whitened rows, (P, P).
        side: X^T y, (P,).
        square: y^T y.
        count: N, number of coordinates.
        group: (P,) int, group 0 .. G-1 of each unknown; -1 for those with the fixed prior `ungrouped_variance`.
        freedom: nu, degrees of freedom behind the noise that whitened the rows: 0 unknown, inf exact (phi = 1).
        start: (G,) variances to start from; None starts at one, the usual sizes.
        floor: least variance, one for all or (G,).
        ceiling: largest variance, one for all or (G,); equal to the floor for a group that is not learned.
        log_size_std: standard deviation of the log-normal prior of a group's size (the root of its variance) about one;
            inf for no prior; one for all or (G,).
        ungrouped_variance: prior variance of unknowns of no group.
        tolerance: the ascent ends where no more than this can still be gained, nats.
        least_total: it also ends where the objective can no longer reach this, nats: the caller drops such a set.
        least_phi: lower bound of phi.

    Returns:
        The posterior.
    """
    groups = int(group.max(initial=-1)) + 1
    low, high, log_std = (item + np.zeros(groups) for item in (floor, ceiling, log_size_std))
    problem = _Problem(gram, side, square, count, freedom, group, log_std, ungrouped_variance, least_phi)
    at = np.log(np.clip(np.ones(groups) if start is None else start, low, high))
    return problem.posterior(*_ascend(problem, at, np.log(low), np.log(high), tolerance, least_total))


def _ascend(
    problem: "_Problem", at: np.ndarray, bottom: np.ndarray, top: np.ndarray, tolerance: float, least_total: float
) -> tuple["_Point", "_Slope", bool]:
    """The objective's local maximum within bounds, its derivatives, and whether it was given up as too low."""
    here = problem.evaluate(at)
    slope = problem.slope(here)
    for _ in range(MOST_ITERATIONS):
        free = (bottom < top) & ~((at <= bottom) & (slope.first < 0)) & ~((at >= top) & (slope.first > 0))
        newton = _newton(slope, free)
        hope = float(slope.first @ newton)
        if hope <= 2.0 * tolerance:
            break
        low = here.value + HOPE_FACTOR * hope < least_total
        if low and max(np.abs(newton).max(), _longest(slope, free)) < LONG_STEP:
            return here, slope, True
        found = _climb(problem, here, at, _steps(slope, newton, free), bottom, top)
        if found is None:
            break
        is_newton, gained = bool((found[0] == at + newton).all()), found[1].value - here.value
        at, here = found
        if _is_last(slope, newton, hope, gained, tolerance, is_newton=is_newton):
            break
        slope = problem.slope(here)
    return here, slope, False


def _is_last(
    slope: "_Slope", newton: np.ndarray, hope: float, gained: float, tolerance: float, *, is_newton: bool
) -> bool:
    """Whether a step gained what the quadratic model predicted, so that what is still to be gained is of higher order.

    After a whole Newton step whose prediction was off by e, it is 9/4 e^2 over the predicted gain.
    """
    predicted = float(hope - 0.5 * newton @ slope.curvature @ newton)
    missed = abs(gained - predicted)
    small = REMAINDER_FACTOR * missed**2 < tolerance * predicted
    return missed < PREDICTED_SHARE * tolerance or (is_newton and small)


def profile_noise(
    squares: np.ndarray, count: float, freedom: float, least_phi: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """White variance phi with the largest evidence, and its term of the log evidence, as in `maximise`.

    Args:
        squares: Q, penalised sums of squares, (..).
        count: N, number of coordinates.
        freedom: nu, degrees of freedom behind the stated noise.
        least_phi: lower bound of phi.

    Returns:
        phi, and nats, (..) each.
    """
    if np.isinf(freedom):
        return np.ones_like(squares), 0.5 * (count - squares)
    known = freedom + count
    own = (freedom + squares) / known
    phi = np.maximum(own, least_phi)
    return phi, -0.5 * known * (np.log(phi) + own / phi - 1.0)


@dataclass(frozen=True)
class _Point:
    """The objective at some log variances and what it is made of, unknowns sorted by group; else as in `Posterior`."""

    value: float  # of the objective, nats
    values: np.ndarray
    factor: np.ndarray  # lower Cholesky factor of X^T X + D^-1
    prior_variance: np.ndarray
    penalised_square: float
    phi: float
    group_variances: np.ndarray


@dataclass(frozen=True)
class _Slope:
    """Derivatives of the objective by the log variances.

    Attributes:
        first: gradient, (G,).
        curvature: minus the Hessian, (G, G).
        mackay: step of each log variance to MacKay's fixed point, (G,).
    """

    first: np.ndarray
    curvature: np.ndarray
    mackay: np.ndarray


class _Problem:
    """The normal sums, columns sorted by group."""

    def __init__(
        self, gram: np.ndarray, side: np.ndarray, square: float, count: float, freedom: float, group: np.ndarray,
        log_std: np.ndarray, ungrouped_variance: float, least_phi: float,
    ) -> None:  # fmt: skip
        self.order, self.group, self.log_std = np.arange(len(group)), group, log_std
        self.ungrouped_variance = ungrouped_variance
        if (group[1:] < group[:-1]).any():
            self.order = np.argsort(group, kind="stable")
            gram, side, self.group = gram[np.ix_(self.order, self.order)], side[self.order], group[self.order]
        self.gram, self.side, self.square = gram, side, square
        self.count, self.freedom, self.least_phi, self.evaluations = count, freedom, least_phi, 0
        self.members = (self.group[:, None] == np.arange(len(log_std))).astype(float)  # shape: (P, G)
        self.size = self.members.sum(axis=0)  # shape: (G,)
        self.log_ungrouped = (len(group) - self.size.sum()) * np.log(ungrouped_variance)

    def evaluate(self, logs: np.ndarray) -> _Point:
        """The objective at some log variances, (G,)."""
        self.evaluations += 1
        group_variances = np.exp(logs)
        prior_variance = np.append(group_variances, self.ungrouped_variance)[self.group]
        factor = factor_of(self.gram, 1.0 / prior_variance)
        values = lapack.dpotrs(factor, self.side, lower=1)[0] if len(prior_variance) else self.side
        # Written as a quadratic form about its minimum, so that rounding of the values enters only squared.
        explained = float(values @ (2.0 * self.side - self.gram @ values - values / prior_variance))
        penalised = max(self.square - explained, SQUARE_ROUNDING * self.square + TINY_SQUARE)
        phi, noise_term = map(float, profile_noise(np.asarray(penalised), self.count, self.freedom, self.least_phi))
        log_prior = -0.125 * float(((logs / self.log_std) ** 2).sum())
        half_log_det = float(np.log(factor.diagonal()).sum() + 0.5 * (self.size @ logs + self.log_ungrouped))
        value = noise_term - half_log_det + log_prior
        return _Point(value, values, factor, prior_variance, penalised, phi, group_variances)

    def slope(self, point: _Point) -> _Slope:
        """Derivatives by the log variances, and MacKay's step."""
        # The lower triangle of the inverse is enough.
        half = lapack.dpotri(point.factor, lower=1)[0] if len(point.factor) else point.factor
        group_variances, members, diagonal, energy = (
            point.group_variances,
            self.members,
            half.diagonal(),
            point.values**2,
        )
        prior_curvature, inverse = 0.25 / self.log_std**2, 1.0 / group_variances
        both = inverse[:, None] * inverse
        moved = _between(half, members * point.values[:, None], (energy * diagonal) @ members) * both / point.phi
        shared = _between(half * half, members, diagonal**2 @ members) * both
        energy = (energy @ members) * inverse / point.phi
        # MacKay's gamma: the effective number of unknowns of each group that the data determine.
        effective = np.maximum(self.size - (diagonal @ members) * inverse, 1e-12)
        curvature = -(moved + 0.5 * shared)
        if not np.isinf(self.freedom) and point.phi > self.least_phi:
            curvature -= (0.5 / (self.freedom + self.count)) * energy[:, None] * energy
        curvature.ravel()[:: len(group_variances) + 1] += prior_curvature + 0.5 * (energy + self.size - effective)
        return _Slope(
            0.5 * (energy - effective) - prior_curvature * np.log(group_variances),
            curvature,
            np.maximum(np.log(np.maximum(energy, 1e-12) / effective), -LONGEST_STEP),
        )

    def posterior(self, point: _Point, slope: _Slope, stopped_early: bool) -> Posterior:
        """The result, unknowns in the order in which they were given."""
        place = np.argsort(self.order)
        return Posterior(
            point.values[place], point.factor, self.order, point.prior_variance[place], point.group_variances,
            slope.curvature, point.value, point.penalised_square, point.phi, self.evaluations, stopped_early,
        )  # fmt: skip


def _between(half: np.ndarray, weights: np.ndarray, own: np.ndarray) -> np.ndarray:
    """W^T M W of a symmetric matrix M that is given by its lower triangle, with zeros above it.

    Args:
        half: (P, P).
        weights: W, (P, G), each row with at most one entry.
        own: diagonal of W^T diag(M) W, (G,), which both triangles would count.
    """
    lower = weights.T @ (half @ weights)
    both = lower + lower.T
    both.ravel()[:: len(own) + 1] -= own
    return np.asarray(both)


def _newton(slope: _Slope, free: np.ndarray) -> np.ndarray:
    """A Newton step, with the absolute eigenvalues of the Hessian, so that it ascends where that is indefinite."""
    step = np.zeros_like(slope.first)
    if len(free) == 1:
        step = np.where(free, slope.first / np.maximum(np.abs(slope.curvature[0]), 1e-2), 0.0)
    elif free.any():
        eigenvalues, vectors = np.linalg.eigh(slope.curvature[np.ix_(free, free)])
        step[free] = vectors @ ((vectors.T @ slope.first[free]) / np.maximum(np.abs(eigenvalues), 1e-2))
    return step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max(initial=0.0)), 1e-300))


def _steps(slope: _Slope, newton: np.ndarray, free: np.ndarray) -> Iterator[np.ndarray]:
    """Steps worth trying: MacKay's while it is long (it converges slowly near the end), then Newton's and parts of it.

    MacKay's rule ignores the prior of the sizes. Where that prior pulls the other way, Newton's step is taken instead,
    for the rule would press the group to its bound for good.
    """
    if _longest(slope, free) > LONG_STEP:
        yield np.where(_uphill(slope, free), slope.mackay, newton)
    yield from (newton * 0.5**n for n in range(STEP_HALVINGS))


def _uphill(slope: _Slope, free: np.ndarray) -> np.ndarray:
    """Groups along whose MacKay step the objective rises, (G,) bool."""
    return np.asarray(free & (slope.mackay * slope.first > 0.0))


def _longest(slope: _Slope, free: np.ndarray) -> float:
    """The longest of MacKay's steps along which the objective rises."""
    return float(np.abs(slope.mackay[_uphill(slope, free)]).max(initial=0.0))


def _climb(
    problem: _Problem, here: _Point, at: np.ndarray, steps: Iterable[np.ndarray], bottom: np.ndarray, top: np.ndarray
) -> tuple[np.ndarray, _Point] | None:
    """The first step that raises the objective, clipped to the bounds, and the point there; None if none does."""
    for step in steps:
        there = np.clip(at + step, bottom, top)
        point = problem.evaluate(there)
        if point.value > here.value:
            return there, point
    return None
