"""Given: what the model holds while it is asked what is missing beside it."""

from dataclasses import replace

import numpy as np

from ptt.diagnosis.telling.enough import enough
from ptt.effects import Library, library
from ptt.fitting.opening import opening_rows
from ptt.fitting.solve import hold
from ptt.model.model import Model
from ptt.run.problem import Problem


def at_its_word(model: Model) -> Model:
    """The model with effects of the user's own held at their values.

    A law that somebody wrote for what nobody knew has many values, and an unknown that bends with fewer would take its
    place and be told as if the law were not there.

    Args:
        model: as given.

    Returns:
        The model that is searched from.
    """
    built_in = library()
    held = (hold(term) if len(term.theta) and term.effect.name not in built_in else term for term in model.terms)
    return replace(model, terms=tuple(held))


def as_free_as(given: Model, model: Model) -> Model:
    """A model whose effects are as free to be fitted as those of the same name as given.

    Args:
        given: the model as given.
        model: what was found from it.

    Returns:
        The model that is told.
    """
    fixed = {term.effect.key: term.fixed for term in given.terms}
    terms = (replace(term, fixed=fixed.get(term.effect.key, term.fixed)) for term in model.terms)
    return replace(model, terms=tuple(terms))


def taken_up(model: Model, problem: Problem, known: Library | None) -> tuple[Model, Problem, Library, np.ndarray]:
    """What a diagnosis begins with.

    Args:
        model: as given.
        problem: the readings.
        known: effects by name; None for the library.

    Returns:
        The model at its word; the readings without those that open a run; the effects; which rows open one, (n,) bool.

    Raises:
        TableError: too few readings for any verdict.
    """
    enough(problem)
    opening = opening_rows(problem)
    return at_its_word(model), problem.masked(opening), library() if known is None else known, opening
