"""Lost motion: whether it is play or wind-up is decided by refits, as the linearisations are too alike."""

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
    """The model with play in the place of wind-up, the other way round, or both anew, where that fits better.

    Linearised, wind-up over a short travel is much like play that some rows have not taken up yet.

    Args:
        model: moved to the explanation.
        given: the model as given; its effects stay.
        found: an explanation by named effects.
        problem: the readings.

    Returns:
        The model, refitted where it has either; else as it was.
    """
    alternatives = list(_alternatives(model)) if not {Backlash.name, Windup.name} & set(given.keys) else []
    if not alternatives:
        return model
    phi, atoms = found.state.posterior.phi, found.system.atoms
    both = {Backlash.name, Windup.name} <= set(model.keys)
    odds = next((atoms[key].odds for key in found.state.keys if atoms[key].name == Windup.name), 0.0) if both else 0.0
    best = fit_dated(model, problem, found)
    most = best.chi2 + 2.0 * phi * odds
    for alternative in alternatives:
        # The limit is doubled, as the cost of a fit under way contains the prior, whose variances are learned
        # meanwhile.
        other, anew = (
            fit_dated(alternative, problem, found, 2.0 * most),
            {Backlash.name, Windup.name} <= set(alternative.keys),
        )
        # One of both alone saves the odds of the other; wind-up alone has free lengths besides, hence `dearer`.
        cost = other.chi2 + (2.0 * phi * odds if anew else 0.0)
        dearer = 2.0 * phi * UNUSUAL_MEANING_NATS if Windup.name in alternative.keys and not anew else 0.0
        if other.status != HOPELESS and cost < most - dearer:
            best, most = other, cost
    return best.model


def _alternatives(model: Model) -> Iterator[Model]:
    """Models in which one of play and wind-up has all of the lost motion, the gap plus twice the wind-up's height.

    Where both are there, also both anew, with all of it in the gap: one may have taken the other's part.
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
    """Lost motion of each joint on reversal by one effect, (k,) mm or rad."""
    if term is None:
        return None
    return gap_of(term.theta)[0] if term.effect.key == Backlash.name else 2.0 * term.theta[: len(term.theta) // 2]
