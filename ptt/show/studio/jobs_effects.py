"""Jobs about effects: which there are, and what the card of one says."""

from collections.abc import Mapping
from typing import Any

from ptt.progress import Progress


def card(effect: str, kind: str, files: tuple[str, ...], tell: Progress) -> Mapping[str, Any]:
    """The card of an effect and its sign at usual size on the sample machine."""
    from ptt.effects.bench import sample_view
    from ptt.effects.cards import card_of
    from ptt.effects.registry import library, make_effect, parse_key
    from ptt.show.plots.atlas import effect_signature, picture_theta

    known = library(*files)
    made = make_effect(known, *parse_key(effect))
    family = kind if kind in made.mechanisms else made.mechanisms[0]
    sign = effect_signature(made, picture_theta(made, family), sample_view(family), card_of(made).on(family))
    shade = None if sign.shade is None else sign.shade.tolist()
    drawn = {
        "telling": sign.telling.tolist(),
        "residual": sign.residual.tolist(),
        "shade": shade,
        "labels": sign.labels,
    }
    return {**words_of_effect(known, effect, family), "sign": drawn}


def words_of_effect(known: Mapping[str, Any], effect: str, kind: str) -> dict[str, Any]:
    """What the card of an effect says on a family of mechanisms.

    Args:
        known: name -> effect class.
        effect: key.
        kind: of the machine.

    Returns:
        The parts of its card, with 'effect' and 'stage'.
    """
    from dataclasses import asdict

    from ptt.effects.cards import card_of
    from ptt.effects.registry import make_effect, parse_key

    made = make_effect(known, *parse_key(effect))
    family = kind if kind in made.mechanisms else made.mechanisms[0]
    return {"effect": effect, "stage": made.stage, **asdict(card_of(made).on(family))}


def names(kind: str, files: tuple[str, ...], tell: Progress) -> tuple[str, ...]:
    """Effects that fit a mechanism family."""
    from ptt.effects.registry import library

    return tuple(name for name, cls in library(*files).items() if kind in cls.mechanisms)
