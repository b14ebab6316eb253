"""Moments of a fitted model's own sudden effects: moved to the best row, or exchanged."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import torch

from ptt.effects.sudden import EDGE, Sudden, dated
from ptt.fitting.result import FitResult
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.problem import Problem, apply_frames


def place_own_moments(fitted: FitResult, problem: Problem) -> Model:
    """Move the moments of a model's own sudden effects to the best rows, their sizes held.

    Linearised at a jump that is one row early, a second jump would be needed to make up for that row.

    Args:
        fitted: the model; its residual tells which rows count.
        problem: the readings that it was fitted to.

    Returns:
        The model, the same one where no moment moved.
    """
    used, read = problem.used & ~fitted.outliers, rows_read(problem)
    if read.sum() < 2 * EDGE:  # no moment has enough on either side
        return fitted.model
    for index, term in enumerate(fitted.layout.terms):
        if not isinstance(term.effect, Sudden):
            continue
        never, always = (at_rows(put_after(fitted, index, end), problem).residual for end in (np.inf, -np.inf))
        squares = [np.square(np.nan_to_num(left) @ fitted.noise.whitener.T).sum(axis=1) for left in (never, always)]
        moment = last_before(problem.view.clock.numpy()[read], np.where(used, squares[0] - squares[1], 0.0)[read])
        if moment != float(term.theta[-1]):
            fitted = put_after(fitted, index, moment)
    return fitted.model


def exchanged(fitted: FitResult) -> Iterator[Model]:
    """The model with the moments of two different sudden effects exchanged, for each pair, their sizes at zero.

    A slip of three sliders and a knock of the tripod look alike but for rotations and curvature, so each may have been
    found first at the other's moment, and moving one alone does not help.

    Args:
        fitted: the model.

    Yields:
        Models to be fitted.
    """
    sudden = [term for term in fitted.model.terms if isinstance(term.effect, Sudden)]
    for one, two in combinations(sudden, 2):
        if one.effect.name != two.effect.name and float(one.theta[-1]) != float(two.theta[-1]):
            moments = {one.effect.key: two.theta[-1:], two.effect.key: one.theta[-1:]}
            terms = [_begun_at(term, moments.get(term.effect.key)) for term in fitted.model.terms]
            yield replace(fitted.model, terms=tuple(terms))


def _begun_at(term: Term, moment: torch.Tensor | None) -> Term:
    return term if moment is None else replace(term, theta=torch.cat([torch.zeros_like(term.theta[:-1]), moment]))


def rows_read(problem: Problem) -> np.ndarray:
    """Rows that have a reading, base reflectors included, (n,) bool: only these date an event."""
    read = problem.view.read
    return np.ones(problem.table.rows, dtype=bool) if read is None else read.numpy()


def last_before(clock: np.ndarray, gained: np.ndarray) -> float:
    """The time of the last row before a jump.

    Args:
        clock: (n,), which never goes back.
        gained: sum of squares by which each row with a reading is better with the jump than without it, (n,).

    Returns:
        By the clock.
    """
    inner = dated(len(clock))
    return float(clock[inner][int(np.argmin(np.cumsum(gained)[inner]))])


def put_after(fitted: FitResult, index: int, moment: float) -> FitResult:
    """Move the moment of one of a model's terms.

    Args:
        fitted: the model.
        index: of the term.
        moment: of the last row before it.

    Returns:
        The same with the moment moved; what it predicts is as it was.
    """
    terms = list(fitted.layout.terms)
    theta = terms[index].theta.clone()
    theta[-1] = moment
    terms[index] = replace(terms[index], theta=theta)
    own = tuple(
        replace(term, theta=torch.cat([term.theta[:-1], theta[-1:]]))
        if term.effect.key == terms[index].effect.key
        else term
        for term in fitted.model.terms
    )
    return replace(fitted, layout=replace(fitted.layout, terms=tuple(terms)), model=replace(fitted.model, terms=own))


def at_rows(fitted: FitResult, problem: Problem) -> FitResult:
    """The same model and frames on other rows.

    Args:
        fitted: on any rows of the run.
        problem: the rows.

    Returns:
        With their prediction and residual.
    """
    layout, unknowns = fitted.layout, fitted.unknowns
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
    prediction = predict(terms, layout.see(problem, unknowns))
    reading = prediction.reading
    if layout.frames:
        reading, _ = apply_frames(reading, problem.frame, layout.frame_parameters(unknowns))
    outliers = np.zeros(problem.table.rows, dtype=bool)
    return replace(fitted, prediction=prediction, residual=problem.measured - reading.numpy(), outliers=outliers)
