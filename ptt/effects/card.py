"""Card of an effect: cause, equation, source, fingerprint, what it is confused with, how it is mended."""

import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ptt.effects.base import Effect

TELLING: dict[str, str] = {
    "b": "joint command [mm or rad]",
    "phase": "joint command modulo a turn [turns]",
    "direction": "direction of arrival",
    "travel": "travel since reversal [mm or rad]",
    "speed": "joint velocity [mm/s or rad/s]",
    "payload": "payload [kg]",
    "load": "load of the axis [N or N mm]",
    "link force": "pull in the link [N]",
    "link angle": "angle of the link to its rail [rad]",
    "temperature": "temperature above the reference [K]",
    "time": "time [s]",
    "radius": "distance of the tool from the middle axis [mm]",
    "x": "x [mm]",
    "y": "y [mm]",
    "z": "z [mm]",
}
RESIDUALS = ("joint", "x", "y", "z")
UNSAID = "not stated"


@dataclass(frozen=True)
class Card:
    """One effect as a machinist reads it.

    Attributes:
        cause: what is physically wrong.
        equation: the additive shift, as the code works it out.
        source: where the equation comes from.
        size: what is usual on real machines.
        fingerprint: what it looks like in the residual.
        confused_with: pairs of an effect, or another thing, and the measurement that tells the two apart.
        remedy: how one mends it on the machine.
        needs: what the data must hold for it to be tested; '-' for nothing beyond poses.
        residual: component of the residual that shows it, one of `RESIDUALS`; 'joint' is J e, in the joints' own space.
        telling: variable that the residual follows, one of `TELLING`.
        shade: second variable that matters, one of `TELLING`, or ''.
    """

    cause: str
    equation: str
    source: str
    size: str
    fingerprint: str
    confused_with: tuple[tuple[str, str], ...]
    remedy: str
    needs: str = "-"
    residual: str = "joint"
    telling: str = "b"
    shade: str = ""


def card_of(effect: "Effect | type[Effect]") -> Card:
    """The card of an effect: the class's own, else one made of its docstring.

    Args:
        effect: an effect or its class.

    Returns:
        The card.
    """
    cls = effect if isinstance(effect, type) else type(effect)
    return cls.card if isinstance(cls.card, Card) else _from_docstring(cls)


def _from_docstring(cls: "type[Effect]") -> Card:
    first, _, rest = (inspect.cleandoc(cls.__doc__) if cls.__doc__ else cls.name).partition("\n")
    residual = "joint" if cls.stage in ("drive", "geometry") else "x"
    return Card(
        cause=first.strip(),
        equation=" ".join(rest.split()) or UNSAID,
        source=UNSAID,
        size=", ".join(f"{p.stem} {p.usual:g} {p.unit}".removesuffix(" 1") for p in cls.parameters),
        fingerprint=UNSAID,
        confused_with=(),
        remedy=UNSAID,
        needs=", ".join(cls.requires) or "-",
        residual=residual,
        telling="b" if residual == "joint" else "x",
    )
