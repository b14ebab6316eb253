"""Find: linearise, search, move the model to what was found, linearise there again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.diagnosis.atoms import Atom
from ptt.diagnosis.candidates import first_of, present_candidates
from ptt.diagnosis.gross import gross_errors, places_of
from ptt.diagnosis.jumps import jumps_instead
from ptt.diagnosis.memory import WHITE
from ptt.diagnosis.noise import noise_again, starting_noise
from ptt.diagnosis.periods import find_period
from ptt.diagnosis.row_system import RowSystem, build_system
from ptt.diagnosis.score import Scorer, State
from ptt.diagnosis.search import improve, loose, plainest, refilled, search, without
from ptt.diagnosis.span import Span
from ptt.diagnosis.system import System
from ptt.diagnosis.turn import best_moments, gross_beside, with_shapes
from ptt.effects import Effect, Library
from ptt.effects.base import flatten
from ptt.effects.sudden import Sudden
from ptt.fitting.linear import Linear, Shape, few_shapes, linear_columns
from ptt.fitting.moment import exchanged, place_own_moments
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.model.model import Model, Term
from ptt.progress import Tell
from ptt.run.noise import Noise
from ptt.run.problem import Problem

STEPS = 12  # effects that may be added
TURNS = 5  # of linearising and searching
MOST_FIRST = 0.05  # share of the rows that may open a run and be left out for it
HOPELESS = 1.5  # times the chi-squared that would do, above which a refit without an effect is not brought to its end
OPENING = 0.05  # usual sizes: where an amplitude starts that cannot be negative


@dataclass(frozen=True)
class Found:
    """The best explanation of a run.

    Attributes:
        fitted: the model with the named effects, at which the system was linearised; residuals hold the blocks' share.
        system: linearised there.
        scorer: with all that was scored there.
        state: the best set.
        noise: the noise floor as it ended.
        carried: what the blocks put into the readings, (n, 3) mm.
        gross: rows left out as gross errors, (n,) bool.
        untestable: effect -> what the data lack.
        periods: joint and length of those that were seen in what was left.
        span: of the run that the rows are a part of; None where they are all of it.
        sample: stretches of the run that stand for it where a system keeps only sums.
    """

    fitted: FitResult
    system: System
    scorer: Scorer
    state: State
    noise: Noise
    carried: np.ndarray
    gross: np.ndarray
    untestable: dict[str, str]
    periods: Sequence[tuple[int, float]] = ()
    span: Span | None = None
    sample: Problem | None = None


def find(
    model: Model, problem: Problem, known: Library, tell: Tell, steps: int = STEPS, span: Span | None = None
) -> Found:
    """Find the best explanation of a run.

    Args:
        model: as given.
        problem: the readings.
        known: effects by name.
        tell: told what is being done.
        steps: how many effects may be added.
        span: of the run that the rows are a part of; None where they are all of it.

    Returns:
        What was found.
    """
    noise, freedom = starting_noise(problem)
    current, gross = model, np.zeros(problem.table.rows, dtype=bool)
    carried = np.zeros((problem.table.rows, 3))
    kept: tuple[str, ...] | None = None
    moments: dict[str, list[Shape]] = {}
    memory, periods, barred, held = WHITE, list[tuple[int, float]](), frozenset[str](), tuple[str, ...]()
    for turn in range(TURNS):
        tell(f"linearise {turn + 1}")
        fitted = _fit_less(current, problem, carried, gross, noise)
        candidates, untestable = present_candidates(fitted, problem, known)
        linear = None
        if turn == 0:
            linear = linear_columns(fitted, problem, candidates, noise)
            gross = _sift(linear, problem)
        rows = problem.used & ~gross & np.isfinite(fitted.residual).all(axis=1)
        shapes = {effect.key: [*effect.search(problem.view), *moments.get(effect.key, ())] for effect in candidates}
        system = build_system(fitted, problem, candidates, noise, freedom, rows, periods, shapes, span, linear)
        scorer = Scorer(system, model.keys, steps, barred)
        tell(f"search {turn + 1}")
        if kept is None:
            state = search(scorer)
            found = Found(fitted, system, scorer, state, noise, carried, gross, untestable, periods, span)
            dated = _dated(found, candidates)
            if dated:
                scorer, system = with_shapes(scorer, dated)
                state = search(scorer)
        else:
            state = scorer.score([key for key in kept if key in system.atoms], memory)
            if turn < TURNS - 1:  # what is said is what it is linearised at
                state = refilled(scorer, improve(scorer, state))
        state = plainest(scorer, state)
        found = Found(fitted, system, scorer, state, noise, carried, gross, untestable, periods, span)
        seen = find_period(scorer, state, problem)
        if turn == TURNS - 1:
            break
        far, gross = gross, gross_beside(system, state, gross)
        blocks = tuple(key for key in state.keys if system.atoms[key].block is not None)
        same = settled(state, system) and set(blocks) == set(held)
        steady = turn > 0 and seen is None and same and (far == gross).all()
        still = turn == 0 and seen is None and same and not gross.any()
        if still and noise_again(problem, system, state) is noise:  # the next turn would be this one, but for moments
            again = _with_moments(found, candidates)
            steady = again.state.keys == state.keys
            found = again if steady else found
        if steady or turn == TURNS - 2:
            needless = _needless(found, fitted.model, problem)
            if needless:
                barred, kept = barred | set(needless), tuple(key for key in kept or () if key not in needless)
                current, memory = _without(fitted.model, needless), state.memory
                system.forget()
                continue
        if steady:
            break
        moments = best_moments(scorer, state, loose(scorer, state), candidates)
        periods += [] if seen is None else [(seen.joint, seen.length)]
        carried = carried_by(state, system, problem)
        noise = noise_again(problem, system, state)
        current = moved(found, model, problem)
        kept, memory, held = (*current.keys, *blocks), state.memory, blocks
        system.forget()
    scorer, state = jumps_instead(found.scorer, found.state)
    return replace(found, scorer=scorer, system=scorer.system, state=state)


def opening_rows(problem: Problem) -> np.ndarray:
    """The rows that a run opens with: from where they came, on which side of any play, nobody knows.

    Args:
        problem: n rows.

    Returns:
        (n,) bool; none where they are more than a few, or no direction is told.
    """
    view = problem.view
    first = problem.used & view.starts.numpy() & (view.direction.numpy() != 0.0).any(axis=1)
    few = "direction" in view.varies and first.sum() < MOST_FIRST * problem.used.sum()
    return first if few else np.zeros_like(first)


def _with_moments(found: Found, candidates: Sequence[Effect]) -> Found:
    """The same, searched on with moments to the row."""
    moments = best_moments(found.scorer, found.state, loose(found.scorer, found.state), candidates)
    scorer, system = with_shapes(found.scorer, moments)
    state = plainest(scorer, refilled(scorer, improve(scorer, found.state)))
    return replace(found, system=system, scorer=scorer, state=state)


def _dated(found: Found, candidates: Sequence[Effect]) -> dict[str, list[Shape]]:
    """Moments to the row for a first search that has found something sudden; none where it has not.

    Between the moments that it tried lie rows enough for curves that make good for them, and those would stay.
    """
    atoms = found.system.atoms
    if not any(isinstance(atoms[key].effect, Sudden) and atoms[key].shape is not None for key in found.state.keys):
        return {}
    return best_moments(found.scorer, found.state, loose(found.scorer, found.state), candidates)


def carried_by(state: State, system: System, problem: Problem) -> np.ndarray:
    """What the blocks of a state put into the readings, (n, 3) mm."""
    total = np.zeros((problem.table.rows, 3))
    for key in state.keys:
        atom = system.atoms[key]
        if atom.block is not None:
            total += atom.block.features @ atom.amplitudes(state.posterior.values[state.of(key)], system.scale)
    return total


def _fit_less(
    model: Model, problem: Problem, carried: np.ndarray, gross: np.ndarray, noise: Noise, hopeless: float = np.inf
) -> FitResult:
    """Fit the model to what the blocks leave of the readings; where that is hopeless, not to the end."""
    less = replace(problem, measured=problem.measured - carried).masked(gross)

    def ended(other: Model) -> FitResult:
        return fit(other, less, noise=noise, robust=False, coarse=True, hopeless=hopeless)

    fitted = ended(model)
    dated = place_own_moments(fitted, less)
    if dated is not fitted.model:
        fitted = ended(dated)
    return min([fitted, *map(ended, exchanged(fitted))], key=lambda each: each.chi2)


def settled(state: State, system: System) -> bool:
    """Whether the search named just what the system was linearised at.

    Args:
        state: the best set.
        system: the linearised problem.

    Returns:
        Whether it did.
    """
    named = {key for key in state.keys if system.atoms[key].effect is not None}
    return named == {key for key, atom in system.atoms.items() if atom.effect is not None and atom.shape is None}


def _sift(linear: Linear, problem: Problem) -> np.ndarray:
    """Lone rows that neither the model nor all effects together can explain, (n,) bool."""
    saturated = few_shapes(linear.trials, linear.simple)
    return gross_errors(linear.columns, linear.values, linear.rows, linear.simple, saturated, places_of(problem))


def _without(model: Model, keys: Sequence[str]) -> Model:
    for key in keys:
        model = model.without(key)
    return model


def _needless(found: Found, current: Model, problem: Problem) -> tuple[str, ...]:
    """Effects that a model with a law that bends does as well without, once everything is refitted.

    Play takes up its gap along the travel, which no tangent shows: a wind-up that took the place of the bend is still
    needed where the system is linearised with it, but not in truth.
    """
    terms, scorer, state, atoms = current.terms, found.scorer, found.state, found.system.atoms
    if not any(type(term.effect).shift is not Effect.shift for term in terms):
        return ()
    whole = _fit_less(current, problem, found.carried, found.gross, found.noise)
    dropped: list[str] = []
    lenders = {name for term in terms for parameter in term.effect.parameters for name in parameter.lent}
    for key in sorted(loose(scorer, state), key=lambda key: state.worth(key) if key in current.keys else np.inf):
        if atoms[key].effect is None or key not in current.keys or len(current.terms) == 1 or key in lenders:
            continue  # nor is one that a curve beside it would take over
        most = whole.chi2 + 2.0 * state.posterior.phi * atoms[key].odds
        less = whole.model.without(key)
        fewer = _fit_less(less, problem, found.carried, found.gross, found.noise, HOPELESS * most)
        if fewer.chi2 < most:
            whole, current = fewer, current.without(key)
            dropped.append(key)
    return tuple(dropped)


def moved(found: Found, model: Model, problem: Problem, *, refine: bool = True) -> Model:
    """The model as given with the named effects at the state's values.

    Args:
        found: the best explanation.
        model: as given.
        problem: the rows that it was found on.
        refine: look for finer shapes of new effects.

    Returns:
        The model.
    """
    current = model
    for key in found.state.keys:
        atom = found.system.atoms[key]
        if atom.effect is None or atom.name in current.keys:
            continue
        base = first_of(atom.name, {found.system.atoms[key].name for key in found.state.keys})
        if base in current.keys:
            continue
        if atom.shape is None:
            term = next(term for term in found.fitted.model.terms if term.effect.key == atom.name)
        else:
            shape = _finest(found, atom, problem) if refine else atom.shape
            term = Term(atom.effect, _opened(found, atom, shape, problem))
        if base != atom.name:
            term = replace(term, effect=replace(term.effect, label=""))
        current = current + term
    return current


def _opened(found: Found, atom: Atom, shape: Mapping[str, Tensor], problem: Problem) -> Tensor:
    """Parameters of a new effect at the state's amplitudes and in a shape."""
    assert atom.effect is not None
    joints, kind = problem.view.joints, problem.file.machine.kind
    theta = flatten(atom.effect, shape, joints)
    amplitudes = atom.amplitudes(found.state.posterior.values[found.state.of(atom.key)], found.system.scale)
    theta[: len(amplitudes)] = torch.as_tensor(amplitudes)
    place = 0
    for parameter in (declared.on(kind) for declared in atom.effect.parameters):
        size = parameter.size(joints)
        shut = parameter.lower == 0.0 and parameter.role == "linear"
        theta[place : place + size] = theta[place : place + size].clamp(
            OPENING * parameter.usual if shut else parameter.lower, parameter.upper
        )
        place += size
    return theta


def _finest(found: Found, atom: Atom, problem: Problem) -> Mapping[str, Tensor]:
    """The shape near the chosen one that scores best in its place."""
    assert atom.effect is not None and atom.shape is not None
    finer = list(atom.effect.refine(problem.view, atom.shape))
    if len(finer) < 2:
        return atom.shape
    assert isinstance(found.system, RowSystem)
    state = found.state
    scorer, near = with_shapes(Scorer(found.system.only(state.keys), found.scorer.given), {atom.name: finer})
    rest = scorer.score(without(state, atom.key), state.memory, state.scales)
    gains = scorer.screen(rest, lambda other: other.key not in state.keys)
    return near.atoms[gains[0].key].shape or atom.shape if gains else atom.shape
