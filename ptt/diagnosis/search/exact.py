"""Exact: laws that bend are held against unknowns and other effects where they are fitted, not along a tangent."""

from dataclasses import replace
from functools import partial

import numpy as np
import torch

from ptt.diagnosis.evidence.atoms import Atom, is_effect, is_sudden
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.asked import Asked, scorer_at
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.found import Found, is_better, moved
from ptt.diagnosis.search.improve import HOPEFUL_NATS, improve
from ptt.diagnosis.search.instead import is_plain, refilled
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
    """A model with a law that bends less the effects without which it does as well, once everything is refitted.

    Play takes up its gap along the travel, which no tangent shows: a wind-up that took the place of the bend is still
    needed where the system is linearised with it, but not in truth.

    Args:
        found: the best explanation.
        problem: the readings.

    Returns:
        The model, refitted where anything went; as it was where nothing did.
    """
    whole, scorer, state, atoms = found.fitted, found.scorer, found.state, found.system.atoms
    terms = whole.model.terms
    if not any(bends(term.effect) for term in terms):
        return whole.model
    lenders = {name for term in terms for parameter in term.effect.parameters for name in parameter.lent}
    # What a curve beside it would take over stays as well.
    held = [key for key in droppable(scorer, state) if key in whole.model.keys and key not in lenders]
    while held and len(whole.model.terms) > 1:
        fits = {key: _spared(found, whole, problem, key) for key in sorted(held, key=state.worth)}
        less = {key: fewer for key, fewer in fits.items() if fewer is not None}
        if not less:
            break
        # Of two that may stand in each other's place the one goes without which the readings are told better.
        gone = min(less, key=lambda key: less[key].chi2 - 2.0 * state.posterior.phi * atoms[key].odds)
        whole, held = less[gone], [key for key in less if key != gone]
    return whole.model


def _spared(found: Found, whole: FitResult, problem: Problem, key: str) -> FitResult | None:
    """The fit without an effect; None where that says too little."""
    most = whole.chi2 + 2.0 * found.state.posterior.phi * found.system.atoms[key].odds
    pull = whole.prior.cost(whole.unknowns)  # which a fit counts while it is under way
    less = _searched_anew(whole.model, key)
    fewer = fit_less(less, problem, found.carried, found.gross, found.noise, most + pull)
    return fewer if fewer.chi2 < most and fewer.status != HOPELESS else None


def _searched_anew(model: Model, key: str) -> Model:
    """The model without an effect; where it reverses, lengths over which others do are as if nothing were known.

    Beside play a wind-up has what play leaves of it, over a length from which no tangent leads to its own.
    """
    gone = next(term.effect for term in model.terms if term.effect.key == key)
    less = model.without(key)
    if not gone.reverses:
        return less
    terms = (replace(t, theta=t.theta[:0]) if _is_gradual(t.effect) and not t.fixed else t for t in less.terms)
    return replace(less, terms=tuple(terms))


def by_names(asked: Asked, found: Found, problem: Problem) -> Found:
    """Linearise at what names alone explain, where one of them has a law that bends, and take that if it is better.

    A block may do no more than what a tangent leaves of such a law: of play that is taken up over several rows.

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
        ways = [*_bent(scorer, state), *_plainer(scorer, state)]
        there = [_at_names(asked, found, way, problem) for way in ways]
        return max((one for one in there if one is not None and is_better(one, found)), key=_total, default=found)
    alone = scorer.score(kept, WHITE)
    more = improve(scorer, alone, is_effect, swaps=False)
    bent = [key for key in kept if bends(atoms[key].effect)]
    stood_in = [key for key in kept if key not in bent and _reverses(atoms[key].effect)]
    ways = [alone] if bent else []
    # What reverses gradually may be no more than what a tangent leaves of play, as a block may.
    ways += [scorer.score([key for key in kept if key not in stood_in], WHITE)] if bent and stood_in else []
    ways += [more] if any(key not in kept and bends(atoms[key].effect) for key in more.keys) else []
    there = [_at_names(asked, found, named, problem) for named in ways]
    best = max((one for one in there if one is not None), key=_total, default=found)
    return best if is_better(best, found) else found


def _total(found: Found) -> float:
    return found.state.total


def _bent(scorer: Scorer, state: State) -> list[State]:
    """A set with play in the place of what reverses gradually, where it has none.

    Along the tangent of play that its rows have not taken up yet, wind-up says more.
    """
    atoms = scorer.system.atoms
    gradual = [key for key in droppable(scorer, state) if _is_gradual(atoms[key].effect)]
    if not gradual or any(_is_play(atoms[key].effect) for key in state.keys):
        return []
    rest = scorer.score(without(state, *gradual), state.memory, state.variances)
    found = scorer.screen(rest, lambda atom: _is_play(atom.effect))[:1]
    return [added(scorer, rest, gain) for gain in found if gain.nats > SEEN_NATS]


def _plainer(scorer: Scorer, state: State) -> list[State]:
    """Sets with a commoner effect in the place of one that is many usual sizes large.

    A zero that is a millimetre off is a joint that sits as far off, but for squares of which no tangent at the other
    knows: which of them is said would hang on which of them came first.
    """
    atoms, ways = scorer.system.atoms, list[State]()
    for key in droppable(scorer, state):
        own = atoms[key]
        if own.effect is None or is_sudden(own) or np.abs(state.posterior.values[state.of(key)]).max() < LARGE_SIZES:
            continue
        rest = scorer.score(without(state, key), state.memory, state.variances)
        others = scorer.screen(rest, partial(_is_commoner, own))[:TRIED]
        ways += [added(scorer, rest, gain) for gain in others if gain.nats > SEEN_NATS]
    return ways


def _is_commoner(own: Atom, other: Atom) -> bool:
    """Whether an atom is a plain effect with less odds against it than another."""
    return is_plain(other) and not is_sudden(other) and other.name != own.name and other.odds < own.odds


def _at_names(asked: Asked, found: Found, named: State, problem: Problem) -> Found | None:
    """What is found where names alone are fitted; None where that lies too far behind."""
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
    """The model with laws that bend as large as names alone have them along the tangent: a block had a part of that."""
    system, terms = found.system, []
    for term in current.terms:
        atom = system.atoms.get(term.effect.key)
        if atom is not None and bends(term.effect) and atom.key in named.keys:
            theta, size = term.theta.clone(), atom.amplitudes(named.posterior.values[named.of(atom.key)], system.scale)
            theta[: len(size)] = torch.as_tensor(size)
            term = replace(term, theta=theta)
        terms.append(term)
    return replace(current, terms=tuple(terms))


def bends(effect: Effect | None) -> bool:
    """Whether an effect has a law that no tangent shows."""
    return effect is not None and type(effect).shift is not Effect.shift


def _reverses(effect: Effect | None) -> bool:
    return effect is not None and effect.reverses


def _is_play(effect: Effect | None) -> bool:
    """Whether an effect reverses by a law that bends."""
    return _reverses(effect) and bends(effect)


def _is_gradual(effect: Effect | None) -> bool:
    """Whether an effect reverses along what its tangent shows."""
    return _reverses(effect) and not bends(effect)
