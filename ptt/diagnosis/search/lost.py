"""Lost motion: whether play or wind-up has it is asked where either is fitted, for no tangent tells."""

from collections.abc import Iterator
from dataclasses import replace

import torch
from torch import Tensor

from ptt.diagnosis.search.fits import fit_dated
from ptt.diagnosis.search.found import UNUSUAL_MEANING_NATS, Found
from ptt.effects.reversal import Backlash, Windup, gap_of
from ptt.fitting.gauss_newton import HOPELESS
from ptt.model.model import Model, Term
from ptt.run.problem import Problem


def lost_by_one(model: Model, given: Model, found: Found, problem: Problem) -> Model:
    """The model with one of play and wind-up in the place of the other, or of both, where that tells more.

    Along tangents a wind-up over a short travel is much like play that its rows have not taken up yet.

    Args:
        model: moved to what was found.
        given: as given; what it has stays.
        found: names.
        problem: the readings.

    Returns:
        The model, refitted where it has either; else as it was.
    """
    ways = list(_ways(model)) if not {Backlash.name, Windup.name} & set(given.keys) else []
    if not ways:
        return model
    phi, atoms = found.state.posterior.phi, found.system.atoms
    both = {Backlash.name, Windup.name} <= set(model.keys)
    odds = next((atoms[key].odds for key in found.state.keys if atoms[key].name == Windup.name), 0.0) if both else 0.0
    best = fit_dated(model, problem, found)
    most = best.chi2 + 2.0 * phi * odds
    for way in ways:
        # What a prior pulls at is counted while a fit is under way, and sizes are learned in between.
        other, anew = fit_dated(way, problem, found, 2.0 * most), {Backlash.name, Windup.name} <= set(way.keys)
        # One of them alone saves the other's name; the lengths of a wind-up that takes all of it are free besides.
        cost = other.chi2 + (2.0 * phi * odds if anew else 0.0)
        dearer = 2.0 * phi * UNUSUAL_MEANING_NATS if Windup.name in way.keys and not anew else 0.0
        if other.status != HOPELESS and cost < most - dearer:
            best, most = other, cost
    return best.model


def _ways(model: Model) -> Iterator[Model]:
    """The models in which one of both has all that a joint loses on reversal: the gap, and twice the height.

    Where both are there, also both with all of it in the gap, the wind-up anew: one may have taken what is the other's.
    """
    terms = {term.effect.key: term for term in model.terms}
    play, gradual = terms.get(Backlash.name), terms.get(Windup.name)
    if play is None and gradual is None:
        return
    lost = sum((part for part in (_lost(play), _lost(gradual)) if part is not None), torch.zeros(model.joints).double())
    rest = tuple(term for key, term in terms.items() if key not in (Backlash.name, Windup.name))
    if gradual is not None:
        yield replace(model, terms=rest) + Term(Backlash(), torch.cat([lost, lost.new_ones(1)]))
    if play is not None:
        yield replace(model, terms=rest) + Windup()
    if play is not None and gradual is not None:
        yield replace(model, terms=rest) + Term(Backlash(), torch.cat([lost, lost.new_ones(1)])) + Windup()


def _lost(term: Term | None) -> Tensor | None:
    """What each joint loses on reversal, (k,) mm or rad."""
    if term is None:
        return None
    return gap_of(term.theta)[0] if term.effect.key == Backlash.name else 2.0 * term.theta[: len(term.theta) // 2]
