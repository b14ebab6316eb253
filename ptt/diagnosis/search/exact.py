"""Exact comparisons of nonlinear effects (play), by refits where a linearisation is not enough."""

from dataclasses import replace
from functools import partial

import numpy as np
import torch

from ptt.diagnosis.evidence.atoms import Atom, is_effect, is_plain, is_sudden
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.asked import Asked, scorer_at
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.found import Found, is_better, moved
from ptt.diagnosis.search.improve import HOPEFUL_NATS, improve
from ptt.diagnosis.search.instead import refilled
from ptt.diagnosis.search.moves import SEEN_NATS, TRIED, added, droppable
from ptt.diagnosis.search.plainest import plainest
from ptt.effects import Effect
from ptt.fitting.gauss_newton import HOPELESS
from ptt.fitting.result import FitResult
from ptt.model.model import Model
from ptt.run.problem import Problem

# Usual sizes from which second-order terms are worth a look: a joint that sits half a millimetre aside
LARGE_SIZES = 10.0


def without_needless(found: Found, problem: Problem) -> Model:
    """A model with a nonlinear effect, less the effects that it does without once everything is refitted.

    Play takes up its gap along the travel, which its tangent does not show: a wind-up may stand in for that in the
    linearised problem, though the nonlinear model does not need it.

    Args:
        found: the best explanation.
        problem: the readings.

    Returns:
        The model, refitted where an effect was dropped; as it was where none was.
    """
    whole, scorer, state, atoms = found.fitted, found.scorer, found.state, found.system.atoms
    terms = whole.model.terms
    if not any(is_nonlinear(term.effect) for term in terms):
        return whole.model
    lenders = {name for term in terms for parameter in term.effect.parameters for name in parameter.lent}
    # Effects whose values a curve beside them would take over stay as well.
    held = [key for key in droppable(scorer, state) if key in whole.model.keys and key not in lenders]
    while held and len(whole.model.terms) > 1:
        fits = {key: _fit_without(found, whole, problem, key) for key in sorted(held, key=state.worth)}
        less = {key: fewer for key, fewer in fits.items() if fewer is not None}
        if not less:
            break
        # Of two that may replace each other, that one goes without which the fit is better.
        gone = min(less, key=lambda key: less[key].chi2 - 2.0 * state.posterior.phi * atoms[key].odds)
        whole, held = less[gone], [key for key in less if key != gone]
    return whole.model


def _fit_without(found: Found, whole: FitResult, problem: Problem, key: str) -> FitResult | None:
    """The fit without an effect; None where it loses more than the effect's prior odds."""
    most = whole.chi2 + 2.0 * found.state.posterior.phi * found.system.atoms[key].odds
    pull = whole.prior.cost(whole.unknowns)  # part of the cost that `hopeless` is compared with
    less = _model_without(whole.model, key)
    fewer = fit_less(less, problem, found.carried, found.gross, found.noise, most + pull)
    return fewer if fewer.chi2 < most and fewer.status != HOPELESS else None


def _model_without(model: Model, key: str) -> Model:
    """The model without an effect; where that reverses, gradual reversals are to be opened anew.

    Beside play, a wind-up has fitted what play leaves over, with a length from which no descent leads to its own.
    """
    gone = next(term.effect for term in model.terms if term.effect.key == key)
    less = model.without(key)
    if not gone.reverses:
        return less
    terms = (replace(t, theta=t.theta[:0]) if _is_gradual(t.effect) and not t.fixed else t for t in less.terms)
    return replace(less, terms=tuple(terms))


def by_names(asked: Asked, found: Found, problem: Problem) -> Found:
    """Refit with named effects alone where one of them is nonlinear, and take that explanation if it is better.

    A block may only stand in for what the tangent of a nonlinear effect leaves: of play taken up over several rows.

    Args:
        asked: what is to be explained.
        found: the best explanation so far.
        problem: the readings without those that open a run.

    Returns:
        The better explanation.
    """
    scorer, state, atoms = found.scorer, found.state, found.system.atoms
    kept = [key for key in state.keys if atoms[key].effect is not None]
    if state.memory.pose == 0.0 and len(kept) == len(state.keys):
        ways = [*_with_play(scorer, state), *_with_commoner(scorer, state)]
        there = [_at_names(asked, found, way, problem) for way in ways]
        return max((one for one in there if one is not None and is_better(one, found)), key=_total, default=found)
    alone = scorer.score(kept, WHITE)
    more = improve(scorer, alone, is_effect, swaps=False)
    nonlinear = [key for key in kept if is_nonlinear(atoms[key].effect)]
    stood_in = [key for key in kept if key not in nonlinear and _reverses(atoms[key].effect)]
    ways = [alone] if nonlinear else []
    # A gradual reversal, too, may only stand in for what the tangent of play leaves.
    ways += [scorer.score([key for key in kept if key not in stood_in], WHITE)] if nonlinear and stood_in else []
    ways += [more] if any(key not in kept and is_nonlinear(atoms[key].effect) for key in more.keys) else []
    there = [_at_names(asked, found, named, problem) for named in ways]
    best = max((one for one in there if one is not None), key=_total, default=found)
    return best if is_better(best, found) else found


def _total(found: Found) -> float:
    return found.state.total


def _with_play(scorer: Scorer, state: State) -> list[State]:
    """Sets with play in the place of gradual reversals, where there is no play.

    Linearised at no play, wind-up explains more, since the tangent misses rows where play is not taken up yet.
    """
    atoms = scorer.system.atoms
    gradual = [key for key in droppable(scorer, state) if _is_gradual(atoms[key].effect)]
    if not gradual or any(_is_play(atoms[key].effect) for key in state.keys):
        return []
    rest = scorer.less(state, *gradual)
    found = scorer.screen(rest, lambda atom: _is_play(atom.effect))[:1]
    return [added(scorer, rest, gain) for gain in found if gain.nats > SEEN_NATS]


def _with_commoner(scorer: Scorer, state: State) -> list[State]:
    """Sets with a commoner effect in the place of one that is many usual sizes large.

    A joint zero a millimetre off looks like a joint placed a millimetre off but for second-order terms, which a
    linearisation at one of them holds against the other. Which is named would depend on which came first.
    """
    atoms, ways = scorer.system.atoms, list[State]()
    for key in droppable(scorer, state):
        own = atoms[key]
        if own.effect is None or is_sudden(own) or np.abs(state.posterior.values[state.of(key)]).max() < LARGE_SIZES:
            continue
        rest = scorer.less(state, key)
        others = scorer.screen(rest, partial(_is_commoner, own))[:TRIED]
        ways += [added(scorer, rest, gain) for gain in others if gain.nats > SEEN_NATS]
    return ways


def _is_commoner(own: Atom, other: Atom) -> bool:
    """Whether an atom is a plain effect with less odds against it than another."""
    return is_plain(other) and not is_sudden(other) and other.name != own.name and other.odds < own.odds


def _at_names(asked: Asked, found: Found, named: State, problem: Problem) -> Found | None:
    """The explanation with named effects alone refitted; None where it is too far behind."""
    state, nothing = found.state, np.zeros_like(found.carried)
    current = _straightened(moved(replace(found, state=named), asked.model, problem), found, named)
    most = state.posterior.penalised_square + 2.0 * state.posterior.phi * HOPEFUL_NATS
    fitted = fit_less(current, problem, nothing, found.gross, found.noise, most)
    if fitted.status == HOPELESS:
        return None
    other, untestable = scorer_at(asked, found, fitted, problem)
    first = other.score([key for key in current.keys if key in other.system.atoms], WHITE)
    if first.total < state.total - HOPEFUL_NATS:
        return None
    best = plainest(other, refilled(other, improve(other, first)))
    return replace(found, fitted=fitted, scorer=other, state=best, carried=nothing, untestable=untestable)


def _straightened(current: Model, found: Found, named: State) -> Model:
    """The model with nonlinear effects as large as the linearised set without blocks has them."""
    system, terms = found.system, []
    for term in current.terms:
        atom = system.atoms.get(term.effect.key)
        if atom is not None and is_nonlinear(term.effect) and atom.key in named.keys:
            theta, size = term.theta.clone(), atom.amplitudes(named.posterior.values[named.of(atom.key)], system.scale)
            theta[: len(size)] = torch.as_tensor(size)
            term = replace(term, theta=theta)
        terms.append(term)
    return replace(current, terms=tuple(terms))


def is_nonlinear(effect: Effect | None) -> bool:
    """Whether an effect is nonlinear in its values."""
    return effect is not None and type(effect).shift is not Effect.shift


def _reverses(effect: Effect | None) -> bool:
    return effect is not None and effect.reverses


def _is_play(effect: Effect | None) -> bool:
    """Whether an effect is play: a nonlinear reversal."""
    return _reverses(effect) and is_nonlinear(effect)


def _is_gradual(effect: Effect | None) -> bool:
    """Whether an effect is a gradual, linear reversal such as wind-up."""
    return _reverses(effect) and not is_nonlinear(effect)
