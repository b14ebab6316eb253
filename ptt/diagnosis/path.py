"""Path: add what is missing step by step, refit, look again; then check that each step is still needed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.diagnosis.design import Design, build_design, present_candidates
from ptt.diagnosis.screen import Finding, Screen, effective_trials, screen, significant, toll
from ptt.diagnosis.wander import Wander, take_off
from ptt.effects import Effect, Library
from ptt.effects.base import flatten
from ptt.fit import FitResult, fit
from ptt.model import Model, Term
from ptt.noise import Noise
from ptt.problem import Problem
from ptt.sums import Solution, project, solve

LEADING = 6  # candidates, at most, that are refitted exactly before one is picked
ABREAST = 0.02  # share of the leader's gain within which the linear screen does not decide
LOOKS = 3  # times that a fit and its gross errors may change each other
CLOSE = 10.0  # difference in chi-squared, tolls counted, below which two models cannot be told apart
NONLINEAR = 0.003  # share of an effect's gain by which the linear cost of a swap may be off
TIE = 3.0  # difference in chi-squared that counts as none where it saves parameters
MENDS = 3  # swaps and removals that are refitted exactly in one round
MOST_ALTERNATIVES = 4
STEPS = 8
ROUNDS = 4

Progress = Callable[[str], None]
Shape = Mapping[str, Tensor]


@dataclass(frozen=True)
class State:
    """A model on the path.

    Attributes:
        fitted: the model with its fit.
        design: linearised there, with every candidate beside it.
        screened: the candidates tested.
    """

    fitted: FitResult
    design: Design
    screened: Screen


@dataclass(frozen=True)
class Path:
    """What was added, in the order of what each step took off the error.

    Attributes:
        start: the model as given.
        states: after each step.
        added: keys in that order.
        alternatives: for each of them, other effects that would do its work as well.
        untestable: name -> what the data lack.
    """

    start: State
    states: tuple[State, ...]
    added: tuple[str, ...]
    alternatives: tuple[tuple[str, ...], ...]
    untestable: dict[str, str]

    @property
    def end(self) -> State:
        """The last state."""
        return self.states[-1] if self.states else self.start


class Walker:
    """Fits and screens models of one problem; holds what does not change from step to step."""

    def __init__(
        self, problem: Problem, known: Library, noise: Noise, wander: Wander | None, progress: Progress | None = None
    ) -> None:
        self.problem, self.known, self.noise, self.wander = problem, known, noise, wander
        self.tell = progress or (lambda what: None)
        self.gross = np.zeros(problem.table.rows, dtype=bool)

    def look(self, model: Model, *, fitted: FitResult | None = None) -> State:
        """Fit a model and screen all candidates on top of it; gross errors found by the way are left out of both."""
        fitted = fitted or self.fit(model)
        candidates, _ = present_candidates(fitted, self.problem, self.known)
        design = build_design(fitted, self.problem, candidates, self.noise, wander=self.wander)
        for _ in range(LOOKS):
            gross = self.problem.used & ~design.rows
            if (gross == self.gross).all():
                break
            self.gross = gross
            fitted = self.fit(fitted.model)
            design = build_design(fitted, self.problem, candidates, self.noise, wander=self.wander)
        return State(fitted, design, screen(design))

    def fit_with(self, model: Model, finding_term: Term) -> FitResult:
        """Fit a model with one more term."""
        self.tell(f"fit {finding_term.effect.key}")
        return self.fit(model + finding_term)

    def fit(self, model: Model) -> FitResult:
        """Fit a model to the rows that are no gross errors."""
        return fit(model, self.problem.masked(self.gross), noise=self.noise, robust=False)


def walk(
    model: Model,
    problem: Problem,
    known: Library,
    noise: Noise,
    *,
    wander: Wander | None = None,
    steps: int = STEPS,
    progress: Progress | None = None,
) -> Path:
    """Find what is missing.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.
        noise: the noise floor.
        wander: its memory, if it has one.
        steps: how many effects may be added.
        progress: told what is being fitted.

    Returns:
        The path; empty where nothing is missing or nothing fits.
    """
    walker = Walker(problem, known, noise, wander, progress)
    start = walker.look(model)
    _, untestable = present_candidates(start.fitted, problem, known)
    given = frozenset(model.keys)
    state = start
    for _ in range(ROUNDS):
        state = _forward(walker, state, given, steps)
        mended = _mend(walker, state, given)
        if mended is None:
            break
        state = mended
    return _retrace(walker, start, state, given, untestable)


def _forward(walker: Walker, state: State, given: frozenset[str], steps: int) -> State:
    while len(set(state.fitted.model.keys) - given) < steps:
        better = _add_best(walker, state)
        if better is None:
            break
        state = better
    return state


def _add_best(walker: Walker, state: State) -> State | None:
    """Refit the leading candidates exactly and take the one with the least cost; None where none is worth its toll."""
    found = significant(state.screened)
    if not found:
        return None
    lead = found[0].net
    leading = [finding for finding in found if finding.net > (1.0 - ABREAST) * lead - 2.0 * CLOSE][:LEADING]
    best: tuple[float, FitResult] | None = None
    for finding in leading:
        fitted = walker.fit_with(state.fitted.model, _term(finding, state, walker))
        cost = misfit(walker, fitted) / state.screened.spread + finding.toll
        if best is None or cost < best[0]:
            best = cost, fitted
    assert best is not None
    if best[0] >= misfit(walker, walker.fit(state.fitted.model)) / state.screened.spread:
        return None
    return walker.look(best[1].model, fitted=best[1])


def _term(finding: Finding, state: State, walker: Walker) -> Term:
    """The candidate in its best shape, its amplitudes at what the screen found."""
    trial, joints = finding.trial, walker.problem.view.joints
    finer = trial.effect.refine(walker.problem.view, trial.shape)
    if len(finer) > 1:
        return Term(trial.effect, flatten(trial.effect, _finest(trial.effect, finer, state, walker), joints))
    projected = project(*state.design.sums.total[:3], state.design.base)
    values = solve(projected.gram, projected.side, projected.left, trial.columns).values
    theta = flatten(trial.effect, trial.shape, joints)
    amplitude = torch.as_tensor(values * state.design.scale[trial.columns])
    theta[: len(amplitude)] = amplitude
    return Term(trial.effect, _inside_bounds(theta, trial.effect, walker))


def _finest(effect: Effect, shapes: Sequence[Shape], state: State, walker: Walker) -> Shape:
    """The shape that takes most off the residual."""
    design = build_design(state.fitted, walker.problem.masked(walker.gross), [effect], walker.noise, shapes=shapes, wander=walker.wander)
    return screen(design).findings[0].trial.shape


def _inside_bounds(theta: Tensor, effect: Effect, walker: Walker) -> Tensor:
    """Amplitudes that respect the physical bounds, a little open where zero is one."""
    place = 0
    for declared in effect.parameters:
        parameter = declared.on(walker.problem.file.machine.kind)
        size = parameter.size(walker.problem.view.joints)
        opened = 0.05 * parameter.usual if parameter.lower == 0.0 and parameter.role == "linear" else parameter.lower
        theta[place : place + size] = theta[place : place + size].clamp(opened, parameter.upper)
        place += size
    return theta


def cost(state: State, chosen: dict[str, np.ndarray], trials: dict[str, float]) -> tuple[float, Solution]:
    """Cost of a choice of effects, to first order around a state: sum of squares in noise units, and tolls.

    Args:
        state: where the problem is linearised.
        chosen: key -> columns of each effect.
        trials: key -> shapes that were tried.

    Returns:
        The cost and the solution.
    """
    gram, side, square, _ = state.design.sums.total
    columns = np.concatenate([state.design.frame, *chosen.values()]).astype(int)
    solution = solve(gram, side, square, columns)
    total = solution.left / state.screened.spread
    for key, own in chosen.items():
        others = [value for other, value in chosen.items() if other != key]
        seen = solution.seen - solve(gram, side, square, np.concatenate([state.design.frame, *others]).astype(int)).seen
        if seen > 0:
            tests = state.screened.candidates * trials.get(key, 1.0)
            total += toll(seen, state.screened.freedom, tests)
        elif len(own):
            total += CLOSE  # an effect that adds nothing seen is no explanation
    return total, solution


def _mend(walker: Walker, state: State, given: frozenset[str]) -> State | None:
    """One improvement by taking a step out or by swapping it for another effect; None where there is none."""
    now, _ = cost(state, state.design.present, {})
    options: list[tuple[float, str, Finding | None]] = []
    for key in state.fitted.model.keys:
        if key not in given:
            without = cost(state, _without(state, key), {})[0]
            options.append((without - now, key, None))
            slack = NONLINEAR * max(without - now, 0.0)
            options += [(value - now - slack, key, finding) for value, finding in _swaps(state, key)]
    options = [option for option in sorted(options, key=lambda item: item[0]) if option[0] < _price(state, *option[1:])]
    exact = _exact_cost(walker, state, state)
    for _, key, finding in options[:MENDS]:
        fitted = _refit(walker, state, key, finding)
        again = walker.look(fitted.model, fitted=fitted)
        if _exact_cost(walker, again, state) < exact + _price(state, key, finding):
            return again
    return None


def _price(state: State, key: str, finding: Finding | None) -> float:
    """What a change may cost: it has to gain, unless it does with fewer parameters what was done with more."""
    if finding is not None and len(finding.trial.columns) < len(state.design.present[key]):
        return TIE
    return -1.0


def misfit(walker: Walker, fitted: FitResult) -> float:
    """Sum of squares in noise units, what held values cost by their prior included, the noise's memory taken off."""
    held = float(np.square(fitted.unknowns[fitted.layout.held]).sum())
    if walker.wander is None:
        return fitted.chi2 + held
    rows = walker.problem.used & ~walker.gross
    values = np.nan_to_num(fitted.residual) @ walker.noise.whitener.T
    return float(np.square(take_off(values, walker.wander, walker.problem, rows)[rows]).sum()) + held


def _without(state: State, key: str) -> dict[str, np.ndarray]:
    return {other: columns for other, columns in state.design.present.items() if other != key}


def _swaps(state: State, key: str) -> list[tuple[float, Finding]]:
    """Cost, to first order, of having each candidate in the place of one effect."""
    rest = _without(state, key)
    swaps = []
    for finding in state.screened.findings:
        name = finding.trial.effect.key
        if finding.trial.effect.name != key.partition("[")[0]:
            tried = {name: effective_trials(finding.trial)}
            swaps.append((cost(state, {**rest, name: finding.trial.columns}, tried)[0], finding))
    return swaps


def _refit(walker: Walker, state: State, key: str, finding: Finding | None) -> FitResult:
    """The model without one effect, or with a candidate in its place."""
    model = state.fitted.model.without(key)
    return walker.fit(model) if finding is None else walker.fit_with(model, _swapped_term(finding, key, state, walker))


def _exact_cost(walker: Walker, state: State, reference: State) -> float:
    """Cost of a model fitted exactly, at one noise level and on the same rows."""
    extra, solution = cost(state, state.design.present, {})
    tolls = extra - solution.left / state.screened.spread
    return misfit(walker, walker.fit(state.fitted.model)) / reference.screened.spread + tolls


def _swapped_term(finding: Finding, key: str, state: State, walker: Walker) -> Term:
    """The candidate with the amplitudes it would have in place of another effect."""
    rest = {other: columns for other, columns in state.design.present.items() if other != key}
    chosen = {**rest, finding.trial.effect.key: finding.trial.columns}
    solution = cost(state, chosen, {})[1]
    term = _term(finding, state, walker)
    own = solution.values[-len(finding.trial.columns) :] * state.design.scale[finding.trial.columns]
    theta = term.theta.clone()
    theta[: len(own)] = torch.as_tensor(own)
    return replace(term, theta=_inside_bounds(theta, finding.trial.effect, walker))


def _retrace(walker: Walker, start: State, end: State, given: frozenset[str], untestable: dict[str, str]) -> Path:
    """Put the steps in the order of what each takes off, and fit the model after each of them."""
    terms = {term.effect.key: term for term in end.fitted.model.terms if term.effect.key not in given}
    order: list[str] = []
    columns = dict(end.design.present)
    chosen = {key: columns[key] for key in columns if key in given}
    while len(order) < len(terms):
        rest = [key for key in terms if key not in order]
        key = min(rest, key=lambda name: cost(end, {**chosen, name: columns[name]}, {})[0])
        chosen[key] = columns[key]
        order.append(key)
    states = []
    model = start.fitted.model
    for number, key in enumerate(order):
        model = model + terms[key]
        if number == len(order) - 1:
            states.append(end)
        else:
            states.append(walker.look(model))
    return Path(start, tuple(states), tuple(order), tuple(_alternatives(walker, end, key) for key in order), untestable)


def _alternatives(walker: Walker, state: State, key: str) -> tuple[str, ...]:
    """Effects that would do the work of one step as well, the data being what they are; refitted where it is close."""
    now, _ = cost(state, state.design.present, {})
    slack = NONLINEAR * max(cost(state, _without(state, key), {})[0] - now, 0.0)
    exact = _exact_cost(walker, state, state)
    tolls = exact - misfit(walker, walker.fit(state.fitted.model)) / state.screened.spread
    own = now - solve(*state.design.sums.total[:3], state.design.base).left / state.screened.spread
    found = []
    for value, finding in sorted(_swaps(state, key), key=lambda item: item[0]):
        if value - now >= CLOSE + slack or len(found) >= MOST_ALTERNATIVES:
            break
        columns = np.concatenate([state.design.frame, *_without(state, key).values(), finding.trial.columns]).astype(int)
        extra = value - solve(*state.design.sums.total[:3], columns).left / state.screened.spread
        fitted = _refit(walker, state, key, finding)
        if misfit(walker, fitted) / state.screened.spread + tolls + extra - own - exact < CLOSE:
            found.append(finding.trial.effect.key)
    return tuple(found)
