"""Preparation of the model and the readings for a diagnosis."""

from dataclasses import replace

import numpy as np

from ptt.diagnosis.telling.enough import require_enough
from ptt.effects import Library, library
from ptt.fitting.opening import opening_rows
from ptt.fitting.solve import hold
from ptt.model.model import Model
from ptt.run.problem import Problem


def hold_own_effects(model: Model) -> Model:
    """The model with effects of the user's own held at their values.

    A user's law for formerly unknown physics has many values; a flexible unknown with fewer would replace it in the
    search and be reported although the law is in the model.
    """
    built_in = library()
    held = (hold(term) if len(term.theta) and term.effect.name not in built_in else term for term in model.terms)
    return replace(model, terms=tuple(held))


def as_free_as(given: Model, model: Model) -> Model:
    """The model that was found, with the same parameters fixed as in the model as given."""
    fixed = {term.effect.key: term.fixed for term in given.terms}
    terms = (replace(term, fixed=fixed.get(term.effect.key, term.fixed)) for term in model.terms)
    return replace(model, terms=tuple(terms))


def prepare(model: Model, problem: Problem, known: Library | None) -> tuple[Model, Problem, Library, np.ndarray]:
    """Prepare a diagnosis.

    Args:
        model: as given.
        problem: the readings.
        known: effects by name; None for the library.

    Returns:
        The model with the user's own effects held; the readings without the rows that open a run; the effects by name;
        and these rows, (n,) bool.

    Raises:
        TableError: too few readings for any verdict.
    """
    require_enough(problem)
    opening = opening_rows(problem)
    return hold_own_effects(model), problem.masked(opening), library() if known is None else known, opening
