"""Bounded Gauss-Newton on normal equations, damped where a step fails: few unknowns, many rows, nearly linear."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy import linalg

MOST_ITERATIONS = 40
TOLERANCE = 1e-8  # chi-squared still to be gained at the end: parameters within 1e-4 standard errors
STEP_RATIO, SHORTER_STEPS = 0.3, 3  # of each undamped trial step to the one before, and how many there are
# Damping, as a share of the diagonal of the normal equations: the first, the ratio of each to the one before, and that
# of the first one of an iteration to the last one of the iteration before, with the least that is kept up
FIRST_DAMPING, DAMPING_RATIO, EASING, LEAST_DAMPING = 0.01, 10.0, 0.1, 1e-6
# Steps in succession, none of them whole, that gain less than a share of chi-squared each, after which it ends: the
# predicted gain lies in a direction in which the model bends at once
SLOW_STEPS, SLOW_SHARE = 3, 1e-6
COARSE_SLOW_SHARE = 1e-3  # the same share of a coarse fit: where noise is left, half a nat of 1,000 coordinates
TRIES = 8  # trial steps of an iteration
FEW_TRIES = 6  # the same of a coarse fit
# tolerance per unit of chi-squared left, times `done`: where more than noise is left, less accuracy is needed
RELATIVE_TOLERANCE = 1e-4
FINE_GAIN = 1e-3  # gain below which a step that keeps less than half of its prediction is the last: kinks are near
PROMISE_FACTOR = 5.0  # times the predicted gain, or the last one, that may still be to come
LEAST_SHARE = 1e-4  # of the predicted decrease that a step has to gain
KINK_SHARE = 1e-4  # share of chi-squared up to which a step that does not help is put down to kinks, as play has them

HOPELESS = "not converged: far above what was asked for"

Sums = tuple[np.ndarray, np.ndarray, float]  # J^T J (u, u), J^T r (u,) and r^T r
Equations = Callable[[np.ndarray], Sums]


@dataclass(frozen=True)
class Descent:
    """Result of a descent.

    Attributes:
        unknowns: (u,).
        status: 'converged' or what kept it from converging.
    """

    unknowns: np.ndarray
    status: str


def descend(
    equations: Equations, start: np.ndarray, lower: np.ndarray, upper: np.ndarray, done: float = TOLERANCE,
    hopeless: float = np.inf,
) -> Descent:  # fmt: skip
    """Minimise a sum of squares between bounds.

    Source: Nocedal and Wright, Numerical Optimization (2006), 10.3 (Gauss-Newton, Levenberg-Marquardt) and 16.5 (active
    sets). Where steps shortened a little fail, damped ones turn into a curved valley in which short ones zigzag.

    Args:
        equations: unknowns -> J^T J (u, u), J^T r (u,) with r what is left and J the model's derivative, and r^T r.
        start: (u,).
        lower: (u,).
        upper: (u,).
        done: predicted decrease at which it ends.
        hopeless: cost above which the descent is given up, once it seems out of reach.

    Returns:
        Where it ended.
    """
    at = np.clip(start, lower, upper)
    sums = equations(at)
    gained, damping, slow, fine = np.inf, 0.0, 0, max(FINE_GAIN, done)
    coarse = fine > FINE_GAIN
    slow_share = COARSE_SLOW_SHARE if coarse else SLOW_SHARE
    for _ in range(MOST_ITERATIONS):
        cost, whole = sums[2], _step(at, sums, lower, upper, 0.0)
        decrease = _decrease(sums, whole)
        if decrease <= done * (1.0 + RELATIVE_TOLERANCE * cost) + 1e-13 * cost:
            return Descent(at, "converged")
        if cost - PROMISE_FACTOR * min(decrease, gained) > hopeless:
            return Descent(at, HOPELESS)
        tries = 1 if decrease <= fine else FEW_TRIES if coarse else TRIES
        taken = None
        for step, its_damping in islice(_trial_steps(at, sums, lower, upper, whole, damping), tries):
            there = equations(at + step)
            if there[2] <= cost - LEAST_SHARE * _decrease(sums, step):
                taken, damping = step, its_damping
                break
        if taken is None:
            kinked = decrease <= max(KINK_SHARE * cost, FINE_GAIN)
            return Descent(at, "converged" if kinked else "not converged: no step lowers the error further")
        at, sums, gained = at + taken, there, cost - there[2]
        if decrease <= max(FINE_GAIN, 10.0 * done) and gained < 0.5 * decrease:
            return Descent(at, "converged")
        slow = slow + 1 if taken is not whole and gained < slow_share * cost else 0
        if slow == SLOW_STEPS:
            return Descent(at, "not converged: steps gain next to nothing")
        damping = EASING * damping if damping > LEAST_DAMPING else 0.0
    return Descent(at, f"not converged after {MOST_ITERATIONS} steps")


def _trial_steps(
    at: np.ndarray, sums: Sums, lower: np.ndarray, upper: np.ndarray, whole: np.ndarray, damping: float
) -> Iterator[tuple[np.ndarray, float]]:
    """Steps to try one after the other, and the damping of each: the whole one and shorter ones, then damped ones.

    Where the iteration before was damped, damped ones from the first.
    """
    if damping == 0.0:
        yield whole, 0.0
        for power in range(1, SHORTER_STEPS):
            yield STEP_RATIO**power * whole, 0.0
        damping = FIRST_DAMPING
    while True:
        yield _step(at, sums, lower, upper, damping), damping
        damping = max(FIRST_DAMPING, DAMPING_RATIO * damping)


def _step(at: np.ndarray, sums: Sums, lower: np.ndarray, upper: np.ndarray, damping: float) -> np.ndarray:
    """Step between the bounds, the diagonal of the normal equations raised by a share."""
    normal, side, _ = sums
    return bounded_step(normal + np.diag(damping * np.diag(normal)), side, lower - at, upper - at)


def _decrease(sums: Sums, step: np.ndarray) -> float:
    """Decrease of the cost that the linearisation predicts for a step."""
    normal, side, _ = sums
    return float(2.0 * side @ step - step @ normal @ step)


def bounded_step(normal: np.ndarray, side: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Minimise s^T N s / 2 - s^T g between bounds that enclose zero, by a primal active set.

    Args:
        normal: N, (u, u), positive definite.
        side: g, (u,).
        lower: (u,), not above zero.
        upper: (u,), not below zero.

    Returns:
        s, (u,).
    """
    free = np.ones(len(side), dtype=bool)
    step = np.zeros(len(side))
    for _ in range(4 * len(side) + 4):
        wanted = step.copy()
        wanted[free] = _solve(normal[np.ix_(free, free)], (side - normal[:, ~free] @ step[~free])[free])
        share, blocking = _first_bound(step, wanted, lower, upper, free)
        step = step + share * (wanted - step)
        if blocking is not None:
            step[blocking] = lower[blocking] if wanted[blocking] < lower[blocking] else upper[blocking]
            free[blocking] = False
            continue
        released = _release(side - normal @ step, step, lower, upper, free)
        if released is None:
            return step
        free[released] = True
    return step


def _first_bound(
    step: np.ndarray, wanted: np.ndarray, lower: np.ndarray, upper: np.ndarray, free: np.ndarray
) -> tuple[float, int | None]:
    """Share of the way to the wanted step up to the first bound, and which bound that is; None for none."""
    move = wanted - step
    room = np.where(move > 0, upper - step, lower - step)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        share = np.where(free & (move != 0), room / move, np.inf)
    first = int(np.argmin(share)) if len(share) else 0
    if not len(share) or share[first] >= 1.0:
        return 1.0, None
    return max(float(share[first]), 0.0), first


def _release(slope: np.ndarray, step: np.ndarray, lower: np.ndarray, upper: np.ndarray, free: np.ndarray) -> int | None:
    """Index of the unknown with the largest wrong-signed multiplier at its bound; None if there is none."""
    pull = np.where(step <= lower, slope, np.where(step >= upper, -slope, 0.0))
    pull[free | (lower == upper)] = 0.0
    worst = int(np.argmax(pull)) if len(pull) else 0
    return worst if len(pull) and pull[worst] > 1e-12 * (1.0 + np.abs(slope).max()) else None


def _solve(normal: np.ndarray, side: np.ndarray) -> np.ndarray:
    if not len(side):
        return side
    try:
        return linalg.cho_solve(linalg.cho_factor(normal, check_finite=False), side, check_finite=False)
    except linalg.LinAlgError:
        return np.linalg.lstsq(normal, side, rcond=1e-14)[0]
