"""The noise floor: what is known of it before a search, and what the search says of it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.row_system import build_row_system
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.noise.wander import FAULT_SHARE
from ptt.effects import Library
from ptt.errors import TooFewError
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.run.holdout import sharing_groups
from ptt.run.noise import SATURATED, VISITED, Noise, at_least, guessed_noise, least_variance
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
SATURATED_ROUNDS = 3  # rounds of the saturated model, each whitened with the noise that the one before left
MACHINE_FILE = "machine file"  # source of a noise that the machine file states as one figure for all axes
# Columns per coordinate beyond which the saturated model takes minutes to say what a search says
MOST_COLUMNS_RATIO = 4.0
TOO_MANY_SHAPES = 12  # shapes from which an effect is left out of the saturated model


def starting_noise(problem: Problem) -> tuple[Noise, float]:
    """The noise floor as far as it is known, and the degrees of freedom of coordinates behind it.

    Args:
        problem: the readings.

    Returns:
        The noise, and zero where it is only a guess.
    """
    given = problem.noise
    if given is None:
        least = least_variance(problem.table.measured[problem.used])
        guess = guessed_noise()
        return replace(guess, covariance=at_least(guess.covariance, least), least=least), 0.0
    if given.source != "repeats":
        return given, STATED_FREEDOM
    if sharing_groups(problem.table, problem.used)[1]:  # of one visit or of all: the rows say what visits share
        return given, 0.0
    return given, min(3.0 * given.freedom, MOST_REPEAT_FREEDOM)


def noise_left(system: System, state: State, beside: np.ndarray | None = None) -> Noise:
    """What a set of atoms leaves, by coordinates, less errors that come back with their pose: these are no noise.

    Args:
        system: the linearised problem.
        state: the set.
        beside: shapes that no atom has yet and that are no noise either, (m, s); None for none.

    Returns:
        The noise; its degrees of freedom are those that the atoms do not use up.
    """
    innovation, taken = system.innovation(state.columns, state.posterior.values, state.memory), 0
    if beside is not None:
        values, _, taken, _ = np.linalg.lstsq(beside, innovation, rcond=None)
        innovation = innovation - beside @ values
    left = _noise_of(innovation, system, state, 3.0 * taken)
    return _by_visit(left, state) if system.shares_by_pose(state.memory) else left


def _by_visit(left: Noise, state: State) -> Noise:
    """What one visit scatters by, of what visits of a pose scatter by together with the errors that they share."""
    return replace(left, covariance=at_least(left.covariance / (1.0 + state.memory.pose), left.least))


def _noise_of(left: np.ndarray, system: System, state: State, taken: float = 0.0) -> Noise:
    """The noise of what is left, (m, 3) whitened, once a set and so many values beside it are taken."""
    freedom = max(system.count - state.effective_parameters - taken, 1.0)
    scatter = system.in_mm(left)
    covariance = scatter.T @ scatter * (3.0 / freedom)
    # An axis that blocks follow to the last digit tells no noise.
    narrowest = max(LEAST_AXIS_RATIO * float(np.linalg.eigvalsh(covariance)[-1]), system.noise.least)
    return Noise(at_least(covariance, narrowest), SATURATED, freedom, least=system.noise.least)


def visit_left(system: System, state: State) -> Noise:
    """What a set of atoms leaves of readings of one visit: a tracker's scatter, less what the machine comes back by.

    What is stated of a tracker, and what its readings of a held pose scatter by, is no more than that. A wander that
    forgets within a few rows is scatter by another name, and counts.

    Args:
        system: the linearised problem.
        state: the set.
    """
    wander, left = state.memory.wander, noise_left(system, state)
    if wander is not None and not system.clock.is_slow(wander):
        left = _noise_of(system.residual(state.columns, state.posterior.values), system, state)
    return _by_visit(left, state) if system.by_visit else left


def wanders_beyond(system: System, state: State) -> bool:
    """Whether the memory of the noise has taken what no tracker does by itself, on all axes together or on one.

    Air and stand move a reading along every axis alike; what bends or warms moves one. The memory has one share,
    the mean of all axes, so an axis is asked for itself. What was predicted of one that lasts is held against the
    scatter of all axes together, for along its beam a tracker scatters by a tenth of what it does across, and its
    stand moves it no less. What forgets within a few rows is no stand that leans to one side as it warms: there
    axes are asked whether what their rows share with those before is alike, in mm as air moves them or as each
    scatters, by Fisher's test with as many degrees of freedom as the run has times in which the wander forgets.
    What an axis shares is known no better than to its scatter over the root of the rows; of the accused one only
    what is sure counts.

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
    shared = np.maximum((left[1:] * left[:-1])[follows].mean(axis=0), 0.0)
    white = whole - shared
    error = whole / np.sqrt(len(left))
    sure, seen = np.maximum(shared - SURE_ERRORS * error, 0.0), np.maximum(shared, error)
    free = max(clock.span / (2.0 * wander.constant), 1.0)
    unlike = [
        3.0 * f_sf(own / ((each.sum() - each) / 2.0), free, 2.0 * free) < ONE_AXIS_CHANCE
        for own, each in ((sure, seen), (sure / white, seen / white))
    ]
    return bool(np.logical_and(*unlike).any())


def noise_again(
    problem: Problem, system: System, state: State, *, settled: bool = False, beside: np.ndarray | None = None
) -> Noise:
    """How coordinates share the noise, told again by what a set of atoms leaves.

    Args:
        problem: the readings.
        system: the linearised problem.
        state: the set.
        settled: it is the set that the problem was linearised at; else it may change, and half of the way is enough.
        beside: as of `noise_left`.

    Returns:
        The noise to whiten with; repeats keep theirs unless they are outdone.
    """
    given, left = problem.noise, noise_left(system, state, beside)
    if given is None:
        return left
    if given.source == "repeats":
        return left if outdone(given, left) else given
    if settled:
        return replace(system.noise, covariance=left.covariance)
    if given.source == MACHINE_FILE:  # it says how wide, not along which axis: that the rows tell, at once
        share = 0.5 * (1.0 + (system.noise.total / left.total) ** 2)
        return replace(system.noise, covariance=share * left.covariance)
    return replace(system.noise, covariance=0.5 * (left.covariance + system.noise.covariance))


def noise_after(problem: Problem, system: System, state: State) -> Noise:
    """The noise floor as it is reported: what was known, unless the search says otherwise.

    Repeats that were read before and after a knock scatter by the knock: where the best explanation leaves
    significantly less than repeats do, it tells the noise.

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
    if given.source == "repeats" and system.by_visit and state.memory.pose > 0.0:
        return replace(left, source=VISITED)
    if outdone(given, left):
        return replace(left, source=f"{SATURATED}; repeats scatter by more, through what changed between them")
    return given


def outdone(given: Noise, left: Noise) -> bool:
    """Whether repeats scatter by significantly more, in any direction, than an explanation leaves.

    Repeats that were read before and after a knock, or while the tracker wandered, do.

    Args:
        given: what was known of the noise.
        left: what an explanation leaves.

    Returns:
        False unless repeats are the source.
    """
    if given.source != "repeats":
        return False
    whitener = given.whitener
    least = float(np.linalg.eigvalsh(whitener @ left.covariance @ whitener.T)[0])
    return bool(3.0 * f_cdf(least, left.freedom / 3.0, given.freedom) < OUTDONE_CHANCE)


def stated_noise(problem: Problem, system: System, state: State) -> Noise | None:
    """The noise that an explanation may be held against: as it was known, but for repeats that it outdoes.

    These scatter by what changed between them, and what the tracker states counts again. Rounding of commands adds to
    either.

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
    aside = problem.rounding[1]
    if given is None or not aside:
        return given
    return replace(given, covariance=given.covariance + np.eye(3) * aside**2 / 3.0)


def saturated_floor(model: Model, problem: Problem, known: Library) -> Noise:
    """The noise floor: the problem's own, else what a model with everything in it leaves.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.

    Returns:
        The noise.

    Raises:
        TableError: nothing tells the noise, or everything has far more values than the readings have coordinates.
    """
    if problem.noise is not None:
        return problem.noise
    noise, sizes = _saturated(model, problem, known, starting_noise(problem)[0])
    if noise.freedom < LEAST_FREEDOM:
        raise too_few(problem)
    for _ in range(SATURATED_ROUNDS - 1):
        finer, sizes = _saturated(model, problem, known, noise, sizes)
        if finer.freedom < LEAST_FREEDOM:  # the finer the noise, the more of the curves is seen, until nothing is left
            break
        noise = finer
    return noise


def too_few(problem: Problem) -> TooFewError:
    """The error for readings that do not tell their noise."""
    return TooFewError(
        f"{int(problem.used.sum())} readings without repeats do not tell the noise",
        where=problem.table.source,
        fix="give sigma_mm under [tracker] in the machine file, or measure more rows",
    )


Sizes = Mapping[str, np.ndarray]  # name of an atom -> its variances, in units of the usual sizes


def _saturated(
    model: Model, problem: Problem, known: Library, noise: Noise, sizes: Sizes | None = None
) -> tuple[Noise, Sizes]:
    """What everything at once leaves, each effect and each block as wide as the data make it; and how wide that is.

    The sizes do not depend on the noise that they are told in, so the next round begins where the last one ended.
    """
    fitted = fit(model, problem, noise=noise)
    candidates, _ = present_candidates(fitted, problem, known)
    short = [effect for effect in candidates if len(effect.search(problem.view)) < TOO_MANY_SHAPES]
    rows = problem.used & ~fitted.outliers & np.isfinite(fitted.residual).all(axis=1)
    system = build_row_system(fitted, problem, short, noise, 0.0, rows)
    one_each = {atom.name: key for key, atom in system.atoms.items()}
    if sum(len(system.atoms[key].columns) for key in one_each.values()) > MOST_COLUMNS_RATIO * 3.0 * rows.sum():
        raise too_few(problem)
    start = {key: sizes[name] for name, key in one_each.items() if sizes and name in sizes}
    state = Scorer(system, model.keys).score(tuple(one_each.values()), WHITE, start)
    learned = {name: state.variances[key] * state.posterior.phi for name, key in one_each.items()}
    return noise_left(system, state), learned
