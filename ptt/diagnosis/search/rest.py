"""Is there a rest? What the best explanation leaves must be noise: the last step, which no verdict skips."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nets import RbfSettings, train_rbf
from ptt.dependence.dependence import Dependence
from ptt.dependence.following import dependence_of
from ptt.dependence.said import by_chance
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.wander import FAULT
from ptt.diagnosis.search.neighbours import off_alike, thin
from ptt.effects.phrases import listed
from ptt.judge.compare.lack_of_fit import lack_of_fit_of
from ptt.run.holdout import BLOCKS, blocks
from ptt.run.noise import Noise
from ptt.run.problem import Problem

SILENT = 1.5  # times a stated noise up to which nothing is said rather than what is little likelier
EXCESS = 2.0  # times a stated noise from which an error is not nothing: one figure for all axes is often half too small
CHANCE_LACK = 1e-4  # lack of fit
CHANCE_FIELD = 1e-4  # a network over position predicts held-out residuals
CHANCE_PLACE = 1e-4  # neighbours in space are off alike
CHANCE_DEPENDS = 1e-5  # a smooth function of a context variable predicts residuals
LIGHT = RbfSettings(centre_counts=(12,), spreads=(1.0, 2.0), ridges=(1e-4, 1e-2), affine=(False,), restarts=1)
FIELD_ROWS = 3000  # a field that 3,000 rows do not show is no field worth naming
LEAST_ROWS = 30  # of fewer the twelve nodes of a network have hardly two each
LEAST_PARTS = 5  # of a run, held out in turn: over fewer, gains must be alike to some percent to pass `CHANCE_FIELD`


@dataclass(frozen=True)
class Rest:
    """What is left after everything that fits has been added.

    Attributes:
        depends_on: what the rest depends on, significant entries only.
        reasons: what is significant, in words.
    """

    depends_on: tuple[Dependence, ...]
    reasons: tuple[str, ...]

    @property
    def significant(self) -> bool:
        """Whether any test objects."""
        return bool(self.reasons)


def look_for_rest(system: System, state: State, problem: Problem, *, seed: int = 0) -> Rest:
    """Test the innovations against repeats, against position, and against every context variable.

    Args:
        system: the linearised problem.
        state: the best set.
        problem: n rows.
        seed: of the permutations.

    Returns:
        The rest.
    """
    return rest_left(innovations_of(system, state, problem), state, problem.with_noise(system.noise), seed=seed)


def rest_left(residual: np.ndarray, state: State, problem: Problem, *, seed: int = 0) -> Rest:
    """Test what an explanation leaves of some rows.

    Args:
        residual: innovations, (n, 3) mm; NaN on rows left out.
        state: the best set.
        problem: the rows, with the noise.
        seed: of the permutations.

    Returns:
        The rest.
    """
    if problem.noise is not None and np.nanmean(np.square(residual)) < problem.noise.least:
        return Rest((), ())  # less than the last digit of a reading
    against, lack = "repeats scatter", lack_of_fit_of(problem, residual, round(state.decided)).p_value
    if lack is None:
        against = "visits of a pose from any side scatter"
        lack = lack_of_fit_of(problem, residual, round(state.decided), from_any_side=True).p_value
    field = _field(problem, residual)
    place, where = off_alike(problem, residual)
    depends = dependence_of(problem, residual, seed=seed)
    if state.memory.wander is not None:  # what is left of a slow wander is no more news than the wander
        depends = tuple(item for item in depends if item.on not in ("time", "run"))
    reasons = []
    if lack is not None and lack < CHANCE_LACK:
        reasons.append(f"the rest is larger than {against} ({by_chance(lack)})")
    if field < CHANCE_FIELD:
        reasons.append(f"a network over position predicts held-out rests ({by_chance(field)})")
    if place < CHANCE_PLACE:
        about = listed([f"{axis} = {value:.0f}" for axis, value in zip("xyz", where, strict=True)])
        reasons.append(f"poses next to each other in space are off alike, most about {about} mm ({by_chance(place)})")
    strong = [item for item in depends if item.p_value < CHANCE_DEPENDS]
    reasons += [
        f"what is left of {item.residual} depends on {item.on} ({by_chance(item.p_value)})" for item in strong[:1]
    ]
    return Rest(depends, tuple(reasons))


def with_objections(
    rest: Rest, faithful: bool, unproven: Sequence[str], left: Noise, stated: Noise | None, beyond: Sequence[str] = (),
    aside: str | None = None, unsaid: str | None = None, idle: Sequence[str] = (), backward: Sequence[str] = (),
) -> Rest:  # fmt: skip
    """The rest with what else speaks against an explanation: hidden readings, and far more left than is stated.

    Args:
        rest: tests of what the explanation leaves.
        faithful: whether hidden readings are foretold as well as it claims to.
        unproven: names of effects that the readings ask for, though hidden ones do not bear them out.
        left: what the explanation leaves.
        stated: the noise as stated; None where nobody did.
        beyond: names of effects with whose values the machine could not stand where it was commanded to.
        aside: what the readings that were set aside have in common, in words; None for nothing.
        idle: names of effects that the readings ask for and that do nothing at their fitted values.
        backward: names of effects that the readings ask for with values that no cause of theirs makes.
        unsaid: why the error is not nothing though no effect is named, in words; None where it may be.

    Returns:
        The rest with those reasons.
    """
    reasons = list(rest.reasons)
    if unproven:
        reasons.append(f"the readings ask for {listed(unproven)}, with which hidden ones are foretold no better")
    elif not faithful:
        reasons.append("hidden readings are foretold far worse than the explanation claims to")
    if beyond:
        reasons.append(f"the readings ask for values of {listed(beyond)} with which the machine could not stand there")
    if idle:
        reasons.append(f"the readings ask for {listed(idle)}, and not for values at which that does anything")
    if backward:
        reasons.append(f"the readings ask for {listed(backward)} of the wrong sign, which no cause of it has")
    if aside:
        reasons.append(f"the readings set aside {aside}: no gross errors do that")
    if stated is not None and left.total > EXCESS * stated.total:
        times = f"{left.total / stated.total:.1f} x the noise by the {stated.source} is left"
        reasons.append(f"{times}: it understates the scatter of a reading, or the rest follows nothing recorded here")
    if unsaid and not reasons:
        reasons.append(unsaid)
    return replace(rest, reasons=tuple(reasons))


def too_much_for_nothing(
    error: float, noise: Noise | None, *, wanders: bool = False, by_visit: bool = False
) -> str | None:
    """Why an error that nothing was found in is not nothing: it is far beyond the noise that somebody states.

    Repeats scatter by whatever differs from visit to visit, and a wander takes whatever is slow: beside either of them
    much can hide, and both are told by the run itself. What is stated of the tracker knows of neither, so either may be
    as much beside that as a wander may beside white noise, and no more.

    Args:
        error: of the readings, what wanders among it, mm.
        noise: the noise floor as it was before any search; None where nothing told it.
        wanders: whether the tracker is said to wander.
        by_visit: whether readings of one visit are said to err alike.

    Returns:
        The reason in words; None where there is none.
    """
    if noise is None:
        return None
    source, total = stated_of(noise)
    visits = by_visit or noise.stated is not None
    if error <= (np.sqrt(1.0 + FAULT) if wanders or visits else EXCESS) * total:
        return None
    times = f"the error is {error / total:.1f} x the noise by the {source}"
    if visits:
        return f"{times}; poses come back that badly, or something differs from visit to visit that no column tells"
    return f"{times}, further than a tracker wanders" if wanders else f"{times}, and follows nothing recorded here"


def stated_of(noise: Noise) -> tuple[str, float]:
    """Who states a noise floor, and how much, mm: what a file states of the tracker before what repeats tell.

    Args:
        noise: the floor as it was before any search.
    """
    return noise.stated or (noise.source, noise.total)


def innovations_of(system: System, state: State, problem: Problem) -> np.ndarray:
    """What the whole explanation leaves, the wander's foretelling taken off, (n, 3) mm; NaN on rows left out."""
    white = system.innovation(state.columns, state.posterior.values, state.memory)
    return system.everywhere(white, problem.table.rows)


def _field(problem: Problem, residual: np.ndarray) -> float:
    rows = np.flatnonzero(np.isfinite(residual).all(axis=1))
    rows = thin(rows, FIELD_ROWS)
    group = blocks(problem.table, 2 * BLOCKS)[rows]
    if len(rows) < LEAST_ROWS or len(np.unique(group)) < LEAST_PARTS:
        return 1.0
    inputs = problem.view.p.numpy()[rows]
    trained = train_rbf(inputs, residual[rows] / np.nanstd(residual[rows], axis=0), group, settings=LIGHT)
    return float(min(1.0, 3.0 * np.min(trained.p_value)))
