"""Path: add what is missing step by step, refit, look again; then check that each step is still needed."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ptt.diagnosis.design import Design, build_design, present_candidates
from ptt.diagnosis.screen import Finding, Screen, effective_trials, screen, significant, toll
from ptt.effects import Library
from ptt.effects.base import flatten
from ptt.fit import FitResult, fit
from ptt.model import Model, Term
from ptt.noise import Noise
from ptt.problem import Problem
from ptt.sums import Solution, project, solve

LEADING = 3  # candidates that are refitted exactly before one is picked
CLOSE = 10.0  # difference in chi-squared, tolls counted, below which two models cannot be told apart
STEPS = 8
ROUNDS = 4

Progress = Callable[[str], None]


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

    def __init__(self, problem: Problem, known: Library, noise: Noise, progress: Progress | None = None) -> None:
        self.problem, self.known, self.noise = problem, known, noise
        self.tell = progress or (lambda what: None)

    def look(self, model: Model, *, fitted: FitResult | None = None) -> State:
        """Fit a model and screen all candidates on top of it."""
        fitted = fitted or fit(model, self.problem, noise=self.noise)
        candidates, _ = present_candidates(fitted, self.problem, self.known)
        design = build_design(fitted, self.problem, candidates, self.noise)
        return State(fitted, design, screen(design))

    def fit_with(self, model: Model, finding_term: Term) -> FitResult:
        """Fit a model with one more term."""
        self.tell(f"fit {finding_term.effect.key}")
        return fit(model + finding_term, self.problem, noise=self.noise)


def walk(model: Model, problem: Problem, known: Library, noise: Noise, *, steps: int = STEPS,
         progress: Progress | None = None) -> Path:  # fmt: skip
    """Find what is missing.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.
        noise: the noise floor.
        steps: how many effects may be added.
        progress: told what is being fitted.

    Returns:
        The path; empty where nothing is missing or nothing fits.
    """
    walker = Walker(problem, known, noise, progress)
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
    leading = [finding for finding in found if finding.net > 0.8 * lead - 2.0 * CLOSE][:LEADING]
    best: tuple[float, FitResult] | None = None
    for finding in leading:
        fitted = walker.fit_with(state.fitted.model, _term(finding, state, walker))
        cost = fitted.chi2 / state.screened.spread + finding.toll + _outlier_cost(fitted, state)
        if best is None or cost < best[0]:
            best = cost, fitted
    assert best is not None
    before = state.fitted.chi2 / state.screened.spread + _outlier_cost(state.fitted, state)
    if best[0] >= before:
        return None
    return walker.look(best[1].model, fitted=best[1])


def _outlier_cost(fitted: FitResult, state: State) -> float:
    """A row left out as a gross error is paid for, so that no model wins by disowning readings."""
    return float(fitted.outliers.sum()) * 30.0


def _term(finding: Finding, state: State, walker: Walker) -> Term:
    """The candidate in its best shape, its amplitudes at what the screen found."""
    trial, joints = finding.trial, walker.problem.view.joints
    projected = project(*state.design.sums.total[:3], state.design.base)
    values = solve(projected.gram, projected.side, projected.left, trial.columns).values
    theta = flatten(trial.effect, trial.shape, joints)  # type: ignore[arg-type]
    import torch

    amplitude = torch.as_tensor(values * state.design.scale[trial.columns])
    theta[: len(amplitude)] = amplitude
    return Term(trial.effect, _inside_bounds(theta, trial.effect, walker))


def _inside_bounds(theta: object, effect: object, walker: Walker) -> object:
    import torch

    assert isinstance(theta, torch.Tensor)
    place = 0
    for parameter in effect.parameters:  # type: ignore[attr-defined]
        parameter = parameter.on(walker.problem.file.machine.kind)
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
    present = state.design.present
    mine = [key for key in state.fitted.model.keys if key not in given]
    now, _ = cost(state, present, {})
    options: list[tuple[float, str, Finding | None]] = []
    for key in mine:
        rest = {other: columns for other, columns in present.items() if other != key}
        options.append((cost(state, rest, {})[0], key, None))
        for finding in state.screened.findings:
            if finding.trial.effect.name == key.partition("[")[0]:
                continue
            swapped = {**rest, finding.trial.effect.key: finding.trial.columns}
            tried = {finding.trial.effect.key: effective_trials(finding.trial)}
            options.append((cost(state, swapped, tried)[0], key, finding))
    options = [option for option in options if option[0] < now - 1.0]
    for _, key, finding in sorted(options, key=lambda option: option[0])[:2]:
        model = state.fitted.model.without(key)
        fitted = (
            fit(model, walker.problem, noise=walker.noise)
            if finding is None
            else walker.fit_with(model, _swapped_term(finding, key, state, walker))
        )
        again = walker.look(fitted.model, fitted=fitted)
        if _exact_cost(again, state.screened.spread) < _exact_cost(state, state.screened.spread) - 1.0:
            return again
    return None


def _exact_cost(state: State, spread: float) -> float:
    """Cost of a fitted model, all at one noise level."""
    extra, solution = cost(state, state.design.present, {})
    tolls = extra - solution.left / state.screened.spread
    return state.fitted.chi2 / spread + tolls + _outlier_cost(state.fitted, state)


def _swapped_term(finding: Finding, key: str, state: State, walker: Walker) -> Term:
    """The candidate with the amplitudes it would have in place of another effect."""
    rest = {other: columns for other, columns in state.design.present.items() if other != key}
    chosen = {**rest, finding.trial.effect.key: finding.trial.columns}
    solution = cost(state, chosen, {})[1]
    term = _term(finding, state, walker)
    import torch

    own = solution.values[-len(finding.trial.columns) :] * state.design.scale[finding.trial.columns]
    theta = term.theta.clone()
    theta[: len(own)] = torch.as_tensor(own)
    return replace(term, theta=_inside_bounds(theta, finding.trial.effect, walker))  # type: ignore[arg-type]


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
    return Path(start, tuple(states), tuple(order), tuple(_alternatives(end, key) for key in order), untestable)


def _alternatives(state: State, key: str) -> tuple[str, ...]:
    """Effects that would do the work of one step as well, the data being what they are."""
    present = state.design.present
    now, _ = cost(state, present, {})
    rest = {other: columns for other, columns in present.items() if other != key}
    found = []
    for finding in state.screened.findings:
        if finding.trial.effect.name == key.partition("[")[0]:
            continue
        swapped = {**rest, finding.trial.effect.key: finding.trial.columns}
        value, _ = cost(state, swapped, {finding.trial.effect.key: effective_trials(finding.trial)})
        if value - now < CLOSE:
            found.append((value, finding.trial.effect.key))
    return tuple(name for _, name in sorted(found))
