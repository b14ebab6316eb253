"""Jobs about effects: their names, and the card of one."""

from collections.abc import Mapping
from typing import Any

from ptt.progress import Progress


def card(effect: str, kind: str, files: tuple[str, ...], tell: Progress) -> Mapping[str, Any]:
    """The card of an effect, with its signature ('sign') at usual size on the sample machine."""
    from ptt.effects.bench import sample_view
    from ptt.effects.cards import card_of
    from ptt.effects.registry import library, make_effect, parse_key
    from ptt.show.plots.atlas import effect_signature, picture_theta

    known = library(*files)
    made = make_effect(known, *parse_key(effect))
    family = kind if kind in made.mechanisms else made.mechanisms[0]
    sign = effect_signature(
        made, picture_theta(made, family), sample_view(family, made.least_joints), card_of(made).on(family)
    )
    shade = None if sign.shade is None else sign.shade.tolist()
    drawn = {
        "telling": sign.telling.tolist(),
        "residual": sign.residual.tolist(),
        "shade": shade,
        "labels": sign.labels,
    }
    return {**words_of_effect(known, effect, family), "sign": drawn}


def words_of_effect(known: Mapping[str, Any], effect: str, kind: str) -> dict[str, Any]:
    """The card of an effect in words for a family of mechanisms.

    Args:
        known: name -> effect class.
        effect: key of the effect.
        kind: kind of the machine; where the effect does not fit it, one that it fits is taken.

    Returns:
        Fields of the card, with 'effect' and 'stage'.
    """
    from dataclasses import asdict

    from ptt.effects.cards import card_of
    from ptt.effects.registry import make_effect, parse_key

    made = make_effect(known, *parse_key(effect))
    family = kind if kind in made.mechanisms else made.mechanisms[0]
    return {"effect": effect, "stage": made.stage, **asdict(card_of(made).on(family))}


def names(kind: str, files: tuple[str, ...], tell: Progress) -> tuple[str, ...]:
    """Names of the effects that fit a kind of machine."""
    from ptt.effects.registry import library

    return tuple(name for name, cls in library(*files).items() if kind in cls.mechanisms)
