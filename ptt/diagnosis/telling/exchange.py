"""A slip and a knock whose moments may be exchanged: effect on the stated values and on the machine afterwards."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch

from ptt.diagnosis.evidence.at_tool import without_rigid_motion
from ptt.diagnosis.evidence.probability import TEMPER
from ptt.diagnosis.search.fits import fits_exchanged
from ptt.diagnosis.search.found import Found
from ptt.effects.sudden import ALWAYS, Sudden
from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.problem import Problem


class Exchange(NamedTuple):
    """The model with the moments of a slip and a knock exchanged: odds against the reported one, at most one; terms."""

    odds: float
    terms: tuple[Term, ...]


def exchanges(found: Found, problem: Problem) -> tuple[Exchange, ...]:
    """Refits of an explanation's model with exchanged moments.

    Args:
        found: the best explanation.
        problem: the rows that it was found on.

    Returns:
        One for each pair of a slip and a knock.
    """
    fits = fits_exchanged(found, problem)
    odds = [float(np.exp(-max(other.chi2 - found.fitted.chi2, 0.0) / (2.0 * TEMPER))) for other in fits]
    return tuple(Exchange(own, other.model.terms) for own, other in zip(odds, fits, strict=True))


def exchanged_errors(found: Found, others: Sequence[Exchange]) -> dict[str, np.ndarray]:
    """Mean squares that possible exchanges add to the stated variances.

    Args:
        found: the best explanation.
        others: its model with moments exchanged.

    Returns:
        Key of an effect -> mean square of each parameter's change, in its unit squared, (p,).
    """
    told = found.fitted.model.terms
    added = {term.effect.key: np.zeros(len(term.theta)) for term in told}
    for odds, terms in others:
        for one, two in zip(told, terms, strict=True):
            added[one.effect.key] += odds / (1.0 + odds) * np.square((two.theta - one.theta).numpy())
    return added


def exchanged_doubt(found: Found, others: Sequence[Exchange], problem: Problem) -> float:
    """Root mean square doubt in the tool's position after the run by possible exchanges, mm.

    Args:
        found: the best explanation.
        others: its model with moments exchanged.
        problem: the rows, whose commands are used.
    """
    if not others:
        return 0.0
    told, square = _tool_after(found.fitted.model.terms, problem), 0.0
    for odds, terms in others:
        apart = without_rigid_motion(_tool_after(terms, problem) - told, problem)
        square += odds / (1.0 + odds) * float(np.square(apart).sum(axis=1).mean())
    return float(np.sqrt(square))


def _tool_after(terms: Sequence[Term], problem: Problem) -> np.ndarray:
    """Tool positions (n, 3) mm with all sudden effects of the machine acting."""
    lasting = [_lasting(term) for term in terms if term.effect.stage != "metrology"]
    return predict([(term.effect, term.theta) for term in lasting], problem.view).p.numpy()


def _lasting(term: Term) -> Term:
    if not isinstance(term.effect, Sudden):
        return term
    return replace(term, theta=torch.cat([term.theta[:-1], ALWAYS["after"]]))
