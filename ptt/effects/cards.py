"""The card of every effect: its own, or one made of its docstring."""

import inspect

from ptt.effects.base import Effect
from ptt.effects.card import Card

UNSAID = "not stated"


def card_of(effect: Effect | type[Effect]) -> Card:
    """The card of an effect: the class's own, else one made of its docstring.

    Args:
        effect: an effect or its class.

    Returns:
        The card.
    """
    cls = effect if isinstance(effect, type) else type(effect)
    return cls.card if isinstance(cls.card, Card) else _from_docstring(cls)


def _from_docstring(cls: type[Effect]) -> Card:
    first, _, rest = (inspect.cleandoc(cls.__doc__) if cls.__doc__ else cls.name).partition("\n")
    residual = "joint" if cls.stage in ("drive", "geometry") else "x"
    return Card(
        cause=first.strip(),
        equation=" ".join(rest.split()) or UNSAID,
        source=UNSAID,
        size=_sizes(cls, "three-ptt"),
        arm_size=_sizes(cls, "serial"),
        fingerprint=UNSAID,
        confused_with=(),
        remedy=UNSAID,
        needs=", ".join(cls.requires) or "-",
        residual=residual,
        telling="b" if residual == "joint" else "x",
    )


def _sizes(cls: type[Effect], kind: str) -> str:
    """Usual sizes of the parameters as the class states them, for a mechanism family."""
    own = [parameter.on(kind) for parameter in cls.parameters]
    return ", ".join(f"{each.stem} {each.usual:g} {each.unit}".removesuffix(" 1") for each in own)
