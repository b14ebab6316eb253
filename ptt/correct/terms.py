"""Which effects of a model are compensated, and whether by the commands or by the controller."""

from typing import Literal

from ptt.effects import Effect
from ptt.effects.dated import RunPlace, at_place, has_date
from ptt.model.chain import EffectTerms
from ptt.model.model import Model, Term

Reversal = Literal["software", "none"]


def split_terms(model: Model, reversal: Reversal | None = None) -> tuple[EffectTerms, EffectTerms, str]:
    """Split the effects that commands compensate into steady and reversing ones.

    Args:
        model: effects with their parameters; those of the metrology do not move the tool and are left out.
        reversal: 'software', the default, includes the reversing effects, 'none' leaves them out. What the machine file
            says its controller compensates is never among them.

    Returns:
        Steady effects (they depend on pose and context alone) and reversing ones (on direction or travel before), with
        their flat parameters, and words on who compensates the latter.
    """
    terms = [(_now(term), term.theta) for term in model.terms if term.effect.stage != "metrology" and len(term.theta)]
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


def _now(term: Term) -> Effect:
    """The effect as it is now: a change at some moment of a run is in force from the first row on."""
    return at_place(term.effect, RunPlace(())) if has_date(term.effect, term.theta) else term.effect


def _keys(terms: EffectTerms) -> str:
    return ", ".join(effect.key for effect, _ in terms)
