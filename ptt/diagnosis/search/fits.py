"""Fits of an explanation's model to the readings less the contribution of its unknown blocks."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from ptt.diagnosis.search.found import Found, carried_by
from ptt.errors import PosesError
from ptt.fitting.moment import exchanged, place_own_moments
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem

MOST_HALVINGS = 10  # of all values towards the drawing, after which next to nothing is left of any


def fit_less(
    model: Model, problem: Problem, carried: np.ndarray, gross: np.ndarray, noise: Noise, hopeless: float = np.inf
) -> FitResult:
    """Fit the model to the readings less the contribution of blocks, moments to the row.

    Args:
        model: the model.
        problem: n rows.
        carried: contribution of the blocks to the readings, (n, 3) mm.
        gross: rows to leave out, (n,) bool.
        noise: the noise floor.
        hopeless: chi-squared and prior together, above which the fit is given up.

    Returns:
        The fit.
    """
    less = _less(problem, carried, gross)
    fitted = _fit(model, less, noise, hopeless)
    dated = place_own_moments(fitted, less)
    if dated is not fitted.model:
        fitted = _fit(dated, less, noise, hopeless)
    others = [_fit(other, less, noise, hopeless) for other in exchanged(fitted)]
    return min([fitted, *others], key=lambda each: each.chi2)


def fit_dated(model: Model, problem: Problem, found: Found, hopeless: float = np.inf) -> FitResult:
    """`fit_less` beside the blocks, gross errors and noise of an explanation, moments of sudden effects as they are."""
    return _fit(model, _less(problem, found.carried, found.gross), found.noise, hopeless)


def fits_exchanged(found: Found, problem: Problem) -> list[FitResult]:
    """Fits of the explanation's model with the moments of two different sudden effects exchanged.

    Args:
        found: the best explanation.
        problem: the rows that it was found on.

    Returns:
        A fit for each pair; none for a long run.
    """
    if found.sample is not None:
        return []
    less = _less(problem, found.carried, found.gross)
    return [_fit(other, less, found.noise, np.inf) for other in exchanged(found.fitted)]


def without_carried(problem: Problem, found: Found) -> Problem:
    """The readings less the contribution of an explanation's blocks, gross errors masked.

    Args:
        problem: the rows that it was found on.
        found: the explanation.
    """
    return _less(problem, carried_by(found.state, found.system, problem), found.gross)


def _less(problem: Problem, carried: np.ndarray, gross: np.ndarray) -> Problem:
    """The readings less a contribution (n, 3) mm, gross errors masked."""
    return replace(problem, measured=problem.measured - carried).masked(gross)


def _fit(model: Model, less: Problem, noise: Noise, hopeless: float) -> FitResult:
    try:
        return fit(model, less, noise=noise, robust=False, coarse=True, hopeless=hopeless)
    except PosesError:
        return fit(_drawn_back(model, less), less, noise=noise, robust=False, coarse=True, hopeless=hopeless)


def _drawn_back(model: Model, problem: Problem) -> Model:
    """The model with its values halved until every commanded pose can be reached.

    A linearised solution may put poses beyond the reach of the links, where there is no derivative to go on from.
    """
    for _ in range(MOST_HALVINGS):
        model = replace(model, terms=tuple(_halved(term, problem) for term in model.terms))
        if is_reachable(model.terms, problem):
            break
    return model


def is_reachable(terms: Sequence[Term], problem: Problem) -> bool:
    """Whether every pose that counts can be reached with these effects.

    Args:
        terms: the effects; those without values are left aside.
        problem: the readings; rows that do not count may be anywhere.
    """
    reading = predict([(term.effect, term.theta) for term in terms if len(term.theta)], problem.view).reading
    return bool(torch.isfinite(reading[torch.as_tensor(problem.used)]).all())


def _halved(term: Term, problem: Problem) -> Term:
    """A term with its free linear values halved."""
    if not len(term.theta):
        return term
    joints = problem.view.joints
    free = [
        p.role == "linear" and p.stem not in term.fixed for p in term.effect.parameters for _ in range(p.size(joints))
    ]
    return replace(term, theta=torch.where(torch.tensor(free), 0.5 * term.theta, term.theta))
