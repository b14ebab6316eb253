"""Which effects of a model a command puts right, and who does it."""

from typing import Literal

from ptt.effects import Effect
from ptt.effects.dated import RunPlace, at_place, is_dated
from ptt.model.chain import EffectTerms
from ptt.model.model import Model

Reversal = Literal["software", "none"]


def split_terms(model: Model, reversal: Reversal | None = None) -> tuple[EffectTerms, EffectTerms, str]:
    """Effects that depend on the pose and its context, those that depend on the way there, and who does the latter.

    Args:
        model: effects with their parameters; those of the metrology move no tool and are left out.
        reversal: 'software', the default, takes the effects that depend on the way along, 'none' leaves them out. What
            the machine file says its controller compensates is never among them.

    Returns:
        Both, with their flat parameters, and words for a person.
    """
    terms = [
        (_now(term.effect), term.theta) for term in model.terms if term.effect.stage != "metrology" and len(term.theta)
    ]
    steady = [item for item in terms if not item[0].reverses and not _is_left(item[0], model)]
    reversing = [item for item in terms if item[0].reverses]
    if not reversing:
        return steady, [], "the model has no reversal effect"
    if reversal == "none":
        return steady, [], f"none, as requested: {_keys(reversing)} left out"
    done = [item for item in reversing if _is_left(item[0], model)]
    mine = [item for item in reversing if item not in done]
    words = [f"in these commands: {_keys(mine)}"] if mine else []
    words += [f"left to the controller: {_keys(done)}"] if done else []
    return steady, mine, "; ".join(words)


def left_to_controller(model: Model) -> list[str]:
    """Keys of the effects that commands leave alone because the controller compensates them already."""
    effects = [term.effect for term in model.terms if term.effect.stage != "metrology"]
    return [effect.key for effect in effects if _is_left(effect, model)]


def _is_left(effect: Effect, model: Model) -> bool:
    return not {effect.name, effect.key}.isdisjoint(model.file.controller.compensates)


def _now(effect: Effect) -> Effect:
    """What happened to the machine at some moment of a run is the state that it is in now."""
    return at_place(effect, RunPlace(())) if is_dated(effect) else effect


def _keys(terms: EffectTerms) -> str:
    return ", ".join(effect.key for effect, _ in terms)
