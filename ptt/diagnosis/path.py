"""Path: add what is missing step by step, refit, look again; then check that each step is still needed."""

from collections.abc import Callable
from dataclasses import dataclass

from ptt.diagnosis.design import present_candidates
from ptt.diagnosis.prices import in_order_of_worth, price
from ptt.diagnosis.screen import SIMPLE, Finding, significant
from ptt.diagnosis.walker import State, Walker
from ptt.fit.solve import FitResult
from ptt.model import Model

LEADING = 6  # candidates, at most, that are refitted exactly before one is picked
ABREAST = 0.02  # share of the leader's gain within which the linear screen does not decide
CLOSE = 10.0  # difference in chi-squared, tolls counted, below which two models cannot be told apart
NONLINEAR = 0.003  # share of an effect's worth by which the linear cost of a swap may be off
TIE = 3.0  # difference in chi-squared that counts as none where it saves parameters
GOOD_PART = 0.4  # share of what is left beyond noise that a step next to an unknown fault has to take
SMALL_PART = 0.1  # the same, below which a step is not worth taking where nothing reaches the noise
FAR_FROM_NOISE = 1.3  # variance left by the saturated model, in noise units, that only an unknown fault explains
GAIN = 1.0  # chi-squared that a change has to gain
MENDS = 3  # swaps and removals that are refitted exactly in one round
MOST_ALTERNATIVES = 4
MOST_KEPT = 4  # simple steps of a suspicious path that are tried beside something unknown
STEPS = 12
ROUNDS = 6


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

    def cut(self, steps: int) -> "Path":
        """The path's first steps."""
        return Path(self.start, self.states[:steps], self.added[:steps], self.alternatives[:steps], self.untestable)


def walk(walker: Walker, model: Model, *, steps: int = STEPS) -> Path:
    """Find what is missing.

    A flexible effect fits a part of nearly everything, so where several effects are missing it is easily taken first
    and stands in for others. Where it was, a second walk takes the simple effects first; the better end counts.

    Args:
        walker: fits and screens models of one problem.
        model: the model as given.
        steps: how many effects may be added.

    Returns:
        The path; empty where nothing is missing or nothing fits.
    """
    start = walker.look(model)
    _, untestable = present_candidates(start.fitted, walker.problem, walker.known)
    given = frozenset(model.keys)
    end = _settle(walker, start, given, steps)
    added = [key for key in end.fitted.model.keys if key not in given]
    if len(added) > 1 and any(len(end.design.present[key]) > SIMPLE for key in added):
        simple = _settle(walker, start, given, steps, lambda finding: len(finding.trial.columns) <= SIMPLE)
        other = _settle(walker, simple, given, steps)
        if path_cost(walker, other, end) < path_cost(walker, end, end) - GAIN:
            end = other
    return _retrace(walker, start, end, given, untestable)


def walk_plainly(path: Path, walker: Walker, given: frozenset[str], steps: int = STEPS) -> Path:
    """The beginning of a path that can be trusted where something unknown is missing.

    Flexible effects, and many small ones, imitate what no effect describes and blur its trace. So only simple effects
    are taken, as long as each takes a good part of what was left.

    Args:
        path: the whole path, for its start.
        walker: that walked it.
        given: effects that were there before.
        steps: how many effects may be added.

    Returns:
        The short path.
    """
    state = path.start
    for _ in range(steps):
        better = _add_best(walker, state, lambda finding: len(finding.trial.columns) <= SIMPLE)
        if better is None:
            break
        before, after = (_excess(walker, item) for item in (state, better))
        if after > (1.0 - GOOD_PART) * before:
            break
        state = better
    return _retrace(walker, path.start, state, given, path.untestable)


def simple_part(path: Path, walker: Walker) -> Path:
    """A path's leading simple steps, without the flexible ones that may stand in for something unknown.

    Args:
        path: the whole path.
        walker: that walked it.

    Returns:
        The short path.
    """
    terms = {term.effect.key: term for term in path.end.fitted.model.terms}
    simple = [key for key in path.added if len(path.end.design.present[key]) <= SIMPLE][:MOST_KEPT]
    states: list[State] = []
    for key in simple:
        states.append(walker.look((states[-1] if states else path.start).fitted.model + terms[key]))
    also = dict(zip(path.added, path.alternatives, strict=True))
    return Path(path.start, tuple(states), tuple(simple), tuple(also[key] for key in simple), path.untestable)


def _hopeless(walker: Walker, state: State, better: State) -> bool:
    """Whether a step takes little of what is left while even all effects together would leave more than noise."""
    if better.screened.spread < FAR_FROM_NOISE:
        return False
    return _excess(walker, better) > (1.0 - SMALL_PART) * _excess(walker, state)


def _excess(walker: Walker, state: State) -> float:
    """Sum of squares beyond what noise alone would leave, in noise units."""
    return max(walker.misfit(state) - state.screened.count, 0.0)


def _settle(
    walker: Walker,
    state: State,
    given: frozenset[str],
    steps: int,
    allowed: Callable[[Finding], bool] = lambda finding: True,
) -> State:
    """Add and mend until neither helps."""
    for _ in range(ROUNDS):
        while len(set(state.fitted.model.keys) - given) < steps:
            better = _add_best(walker, state, allowed)
            if better is None or _hopeless(walker, state, better):
                break
            state = better
        mended = _mend(walker, state, given, allowed)
        if mended is None:
            break
        state = mended
    return state


def _add_best(walker: Walker, state: State, allowed: Callable[[Finding], bool]) -> State | None:
    """Refit the leading candidates exactly and take the one with the least cost; None where none is worth its toll."""
    found = [finding for finding in significant(state.screened) if allowed(finding)]
    if not found:
        return None
    reach = (1.0 - ABREAST) * found[0].net - 2.0 * CLOSE
    costs: list[tuple[float, int, FitResult]] = []
    for number, finding in enumerate(item for item in found[:LEADING] if item.net > reach):
        fitted = walker.fit_swapped(state, None, finding)
        costs.append((walker.misfit_of(fitted) / state.screened.spread + finding.toll, number, fitted))
    least, _, fitted = min(costs, key=lambda item: item[:2])
    if least >= walker.misfit(state) / state.screened.spread:
        return None
    return walker.look(fitted.model, fitted=fitted)


def _mend(walker: Walker, state: State, given: frozenset[str], allowed: Callable[[Finding], bool]) -> State | None:
    """One improvement by taking a step out or by swapping it for another effect; None where there is none."""
    options: list[tuple[float, int, str, Finding | None]] = []
    for key in (key for key in state.fitted.model.keys if key not in given):
        worth = price(state, key)
        options.append((worth.removal, len(options), key, None))
        slack = NONLINEAR * worth.worth
        start = len(options)
        options += [(swap.change - slack, start + i, key, swap.finding) for i, swap in enumerate(worth.swaps)]
    options = [
        option for option in options if option[0] < _most(state, *option[2:]) and (not option[3] or allowed(option[3]))
    ]
    now = path_cost(walker, state, state)
    for *_, key, finding in sorted(options, key=lambda option: option[:2])[:MENDS]:
        fitted = walker.fit_swapped(state, key, finding)
        again = walker.look(fitted.model, fitted=fitted)
        if path_cost(walker, again, state) < now + _most(state, key, finding):
            return again
    return None


def _most(state: State, key: str, finding: Finding | None) -> float:
    """What a change may cost: it has to gain, unless it does with fewer parameters what was done with more."""
    fewer = finding is not None and len(finding.trial.columns) < len(state.design.present[key])
    return TIE if fewer else -GAIN


def path_cost(walker: Walker, state: State, reference: State) -> float:
    """Cost of a model: its misfit in noise units, and the tolls of its effects.

    Args:
        walker: of the problem; the rows that count now count.
        state: the fitted model.
        reference: state whose noise level the misfit is measured by.

    Returns:
        The cost.
    """
    tolls = sum(price(state, key).toll for key in state.fitted.model.keys)
    return walker.misfit(state) / reference.screened.spread + tolls


def _retrace(walker: Walker, start: State, end: State, given: frozenset[str], untestable: dict[str, str]) -> Path:
    """Put the steps in the order of what each takes off, and fit the model after each of them."""
    terms = {term.effect.key: term for term in end.fitted.model.terms}
    order = in_order_of_worth(end, given)
    states, model = [], start.fitted.model
    for key in order[:-1]:
        model = model + terms[key]
        states.append(walker.look(model))
    states += [end] if order else []
    return Path(start, tuple(states), tuple(order), tuple(_alternatives(walker, end, key) for key in order), untestable)


def _alternatives(walker: Walker, state: State, key: str) -> tuple[str, ...]:
    """Effects that would do the work of one step as well, the data being what they are; refitted where it is close."""
    worth = price(state, key)
    slack = NONLINEAR * worth.worth
    now = walker.misfit(state) / state.screened.spread
    found: list[str] = []
    for swap in worth.swaps:
        if swap.change >= CLOSE + slack or len(found) >= MOST_ALTERNATIVES:
            break
        fitted = walker.fit_swapped(state, key, swap.finding)
        if walker.misfit_of(fitted) / state.screened.spread + swap.toll - now < CLOSE:
            found.append(swap.finding.trial.effect.key)
    return tuple(found)
