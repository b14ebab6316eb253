"""Given: what the model holds while it is asked what is missing beside it."""

from dataclasses import replace

from ptt.effects import library
from ptt.fitting.solve import hold
from ptt.model.model import Model


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
