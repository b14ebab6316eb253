"""The noise floor: as stated before a search, and as estimated from what the search leaves."""

from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.wander import FAULT_SHARE
from ptt.run.holdout import sharing_groups
from ptt.run.noise import REPEATS, SATURATED, VISITED, Noise, at_least, guessed_noise, least_variance
from ptt.run.problem import Problem
from ptt.run.tails import f_cdf, f_sf

MOST_REPEAT_FREEDOM = 300.0  # degrees of freedom that repeats may claim: they do not see what varies between poses
STATED_FREEDOM = 100.0  # degrees of freedom that a figure counts for which somebody states
LEAST_FREEDOM = 12.0  # degrees of freedom that a noise has to have which only the residuals tell
OUTDONE_CHANCE = 1e-4  # p-value of an F test below which two noise figures contradict each other
SURE_ERRORS = 3.0  # standard errors taken off the lag-one covariance of the axis that is accused of wandering alone
# P-value below which the axes wander unlike each other: one of a thousand sound wanders is called a fault
ONE_AXIS_CHANCE = 1e-3
# Least variance along one axis over that along another: a beam's length is read ten times as well, not thirty
LEAST_AXIS_RATIO = 1e-3
MACHINE_FILE = "machine file"  # source of a noise that the machine file states as one figure for all axes


def starting_noise(problem: Problem) -> tuple[Noise, float]:
    """The noise floor as stated or guessed, and the degrees of freedom (in coordinates) behind it.

    Args:
        problem: the readings.

    Returns:
        The noise and its degrees of freedom, zero where it is only a guess or the rows tell better.
    """
    given = problem.noise
    if given is None:
        least = least_variance(problem.table.measured[problem.used])
        guess = guessed_noise()
        return replace(guess, covariance=at_least(guess.covariance, least), least=least), 0.0
    if given.source != REPEATS:
        return given, STATED_FREEDOM
    if sharing_groups(problem.table, problem.used)[1]:  # repeats within a visit do not show what differs between visits
        return given, 0.0
    return given, min(3.0 * given.freedom, MOST_REPEAT_FREEDOM)


def noise_left(system: System, state: State, beside: np.ndarray | None = None) -> Noise:
    """Noise estimated from a set's innovations, less errors that repeat with their pose, which are no noise.

    Args:
        system: the linearised problem.
        state: the set.
        beside: further regressors that are no noise but no atoms yet, (m, s); None for none.

    Returns:
        The noise, with the degrees of freedom that set and regressors leave.
    """
    innovation, taken = system.innovation(state.columns, state.posterior.values, state.memory), 0
    if beside is not None:
        values, _, taken, _ = np.linalg.lstsq(beside, innovation, rcond=None)
        innovation = innovation - beside @ values
    left = _noise_from(innovation, system, state, 3.0 * taken)
    return _by_visit(left, state) if system.shares_by_pose(state.memory) else left


def _by_visit(left: Noise, state: State) -> Noise:
    """The noise of one visit, given the total scatter of visits with random errors of poses."""
    return replace(left, covariance=at_least(left.covariance / (1.0 + state.memory.pose), left.least))


def _noise_from(left: np.ndarray, system: System, state: State, taken: float = 0.0) -> Noise:
    """Noise covariance of a residual (m, 3) whitened, after a set and `taken` further values were fitted."""
    freedom = max(system.count - state.effective_parameters - taken, 1.0)
    scatter = system.in_mm(left)
    covariance = scatter.T @ scatter * (3.0 / freedom)
    # Along an axis that blocks follow to the last digit the residual does not show the noise.
    narrowest = max(LEAST_AXIS_RATIO * float(np.linalg.eigvalsh(covariance)[-1]), system.noise.least)
    return Noise(at_least(covariance, narrowest), SATURATED, freedom, least=system.noise.least)


def visit_left(system: System, state: State) -> Noise:
    """Noise of single visits that a set leaves, comparable to a stated tracker noise or to repeats at a held pose.

    Scatter of the machine between visits is taken off. A wander that decays within a few rows is white noise by another
    name, and counts as noise.

    Args:
        system: the linearised problem.
        state: the set.
    """
    wander, left = state.memory.wander, noise_left(system, state)
    if wander is not None and not system.clock.is_slow(wander):
        left = _noise_from(system.residual(state.columns, state.posterior.values), system, state)
    return _by_visit(left, state) if system.by_visit else left


def wanders_beyond(system: System, state: State) -> bool:
    """Whether the wander is more than a tracker's, on all axes together or on a single one: then it is the machine's.

    Air and the tracker's stand move readings along all axes; something that bends or warms moves one. The wander has
    one share for all axes, so each axis is examined by itself.

    A slow wander: the variance that it predicts of one axis is compared with the white variance of all axes together.
    Along its beam a tracker scatters a tenth of what it does across, but its stand moves it no less there.

    A fast one (a few rows): the lag-one covariances of the axes have to be alike, in mm (as air moves them) or in
    proportion to each axis's white variance. They are compared by F tests with as many degrees of freedom as the run
    has correlation times. Of the axis that is accused `SURE_ERRORS` standard errors are taken off.

    Args:
        system: the linearised problem.
        state: the set.
    """
    wander, clock = state.memory.wander, system.clock
    if wander is None:
        return False
    if clock.is_fault(wander):
        return True
    left = system.in_mm(system.residual(state.columns, state.posterior.values))
    left = left - left.mean(axis=0)
    whole, follows = np.square(left).mean(axis=0), ~clock.starts[1:]
    if clock.is_slow(wander):
        new = system.in_mm(system.innovation(state.columns, state.posterior.values, state.memory))
        return bool((whole - new.var(axis=0) > FAULT_SHARE * new.var(axis=0).mean()).any())
    lagged = np.maximum((left[1:] * left[:-1])[follows].mean(axis=0), 0.0)  # lag-one covariance of each axis
    white = whole - lagged
    error = whole / np.sqrt(len(left))
    sure, seen = np.maximum(lagged - SURE_ERRORS * error, 0.0), np.maximum(lagged, error)
    freedom = max(clock.span / (2.0 * wander.constant), 1.0)
    unlike = [
        3.0 * f_sf(own / ((each.sum() - each) / 2.0), freedom, 2.0 * freedom) < ONE_AXIS_CHANCE
        for own, each in ((sure, seen), (sure / white, seen / white))
    ]
    return bool(np.logical_and(*unlike).any())


def noise_again(
    problem: Problem, system: System, state: State, *, settled: bool = False, beside: np.ndarray | None = None
) -> Noise:
    """The noise to whiten the next linearisation with, updated by what a set leaves.

    Args:
        problem: the readings.
        system: the linearised problem.
        state: the set.
        settled: whether the problem was linearised at this set; else the set may change, and half a step is taken.
        beside: as of `noise_left`.

    Returns:
        The noise; that of repeats is kept unless the set leaves significantly less (`outdone`).
    """
    given, left = problem.noise, noise_left(system, state, beside)
    if given is None:
        return left
    if given.source == REPEATS:
        return left if outdone(given, left) else given
    if settled:
        return replace(system.noise, covariance=left.covariance)
    if given.source == MACHINE_FILE:  # it gives one figure: how the axes share it, the rows tell at once
        share = 0.5 * (1.0 + (system.noise.total / left.total) ** 2)
        return replace(system.noise, covariance=share * left.covariance)
    return replace(system.noise, covariance=0.5 * (left.covariance + system.noise.covariance))


def noise_after(problem: Problem, system: System, state: State) -> Noise:
    """The noise floor that is reported: the one that was known, unless the best explanation contradicts it.

    Repeats read before and after a knock scatter by the knock: where the best explanation leaves significantly less
    than the repeats scatter by, the noise is what it leaves.

    Args:
        problem: the readings.
        system: the linearised problem.
        state: the best set.

    Returns:
        The noise.
    """
    given, left = problem.noise, noise_left(system, state)
    if given is None:
        return left
    if given.source == REPEATS and system.by_visit and state.memory.pose > 0.0:
        return replace(left, source=VISITED)
    if outdone(given, left):
        return replace(left, source=f"{SATURATED}; repeats scatter by more, through what changed between them")
    return given


def outdone(given: Noise, left: Noise) -> bool:
    """F test: whether repeats scatter significantly more, along any direction, than an explanation leaves.

    So do repeats that were read before and after a knock, or while the tracker wandered.

    Args:
        given: what was known of the noise.
        left: what an explanation leaves.

    Returns:
        False unless repeats are the source.
    """
    if given.source != REPEATS:
        return False
    whitener = given.whitener
    least = float(np.linalg.eigvalsh(whitener @ left.covariance @ whitener.T)[0])
    return bool(3.0 * f_cdf(least, left.freedom / 3.0, given.freedom) < OUTDONE_CHANCE)


def stated_noise(problem: Problem, system: System, state: State) -> Noise | None:
    """The stated noise that an explanation is compared with, rounding of commands added.

    Repeats count unless the explanation leaves significantly less (`outdone`): they then scatter by what changed
    between them, and the figure stated beside them, if any, counts.

    Args:
        problem: the readings.
        system: the linearised problem.
        state: the best set.

    Returns:
        The noise; None where nobody stated it.
    """
    given = problem.noise
    if given is not None and outdone(given, noise_left(system, state)):
        if given.stated is None:
            return None
        source, total = given.stated
        given = Noise(np.eye(3) * total**2 / 3.0, source)
    rounding_mm = problem.rounding[1]
    if given is None or not rounding_mm:
        return given
    return replace(given, covariance=given.covariance + np.eye(3) * rounding_mm**2 / 3.0)
