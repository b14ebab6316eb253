"""How the values of an effect are said: with the side that each of them means, in the units of a workshop."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

SHOWN_UNITS = {  # unit -> factor and unit in words
    "mm": (1e3, "um"),
    "rad": (1e6, "urad"),
    "1": (1e6, "um/m"),
    "s": (1e3, "ms"),
    "1/K": (1e6, "um/m/K"),
    "mm/K": (1e3, "um/K"),
    "mm/N": (1e3, "um/N"),
    "rad/Nmm": (1e9, "urad/N m"),
    "mm/kg": (1e3, "um/kg"),
    "1/kg": (1e6, "um/m/kg"),
}
SHARE_OF_TURN = (1e6, "urad/rad")  # what a joint that turns does too much
UNIT = re.compile("(?P<prefix>[nmu\N{MICRO SIGN}]?)(?P<base>rad|m|s)(?P<per>[/ ].*)?")
PREFIXES = ("n", "u", "m", "")  # of m, rad and s, by thousands
LARGE, LARGEST = 1e3, 1e4  # the least and the largest of some sizes from which the next prefix is said
LEAST_SIZE = 1e-2  # the largest of some, below which the prefix before is said
FULL = 720.0  # deg from which the turns of a screw are said
UNTOLD = 20.0  # times a value: an error beyond that says that nothing is known, however large it is
MOST_VALUES = 6  # of one effect that anybody reads
SMALL = 0.02  # share of the largest value below which nobody would turn a screw
ONE = {"s": "s", "es": "es", "is_": "is", "has": "has"}
MANY = {"s": "", "es": "", "is_": "are", "has": "have"}
ABSURD = 30.0  # usual sizes that no machine is off by, but a drawing with a wrong sign or figure is
SIGNIFICANT = 3.0  # standard errors from which a value is worth a word


@dataclass(frozen=True)
class Phrase:
    """What it means that one parameter is above or below zero.

    `{what}` is the size with its unit, `{axis}` x, y or z of a vector's component; `{s}`, `{es}`, `{is_}`, `{has}` are
    the verb for one or several joints. What sets it right has `{who}`, `{what}` and `{turn}`, how far a screw turns.

    Attributes:
        stem: of the parameter.
        plus: what a value above zero does, as in '{is_} {what} too long'.
        minus: what a value below zero does.
        who: the subject, where it is no joint.
        arm: the same two on a serial arm, where they differ.
        arm_who: the subject there.
        times: the size said, as a multiple of the value.
        mend: what sets a value above and one below zero right, as in 'shorten {who} by {what}'; '' for nothing.
        arm_mend: the same on a serial arm.
    """

    stem: str
    plus: str
    minus: str
    who: str = ""
    arm: tuple[str, str] | None = None
    arm_who: str = ""
    times: float = 1.0
    mend: tuple[str, str] = ("", "")
    arm_mend: tuple[str, str] = ("", "")

    def along(self, axis: str) -> "Phrase":
        """The phrase of one component of a vector."""
        plus, minus = (text.replace("{axis}", axis) for text in (self.plus, self.minus))
        arm = self.arm and (self.arm[0].replace("{axis}", axis), self.arm[1].replace("{axis}", axis))
        return replace(self, plus=plus, minus=minus, arm=arm)

    def on(self, kind: str) -> tuple[str, str]:
        """Plus and minus on a mechanism family."""
        return self.arm if self.arm is not None and kind == "serial" else (self.plus, self.minus)


@dataclass(frozen=True)
class ValuePhrase:
    """One value in words.

    Attributes:
        who: the subject; '' where it is a joint.
        joint: number of the joint or leg, from 1; 0 where it is none.
        text: what it does, with {what} still to be filled in.
        size: not negative, in `unit`.
        error: its standard error; NaN where none is known.
        unit: as said.
        worth: size in usual sizes, which tells what matters most.
        mend: what sets it right; '' for nothing.
    """

    who: str
    joint: int
    text: str
    size: float
    error: float
    unit: str
    worth: float
    mend: str = ""

    @property
    def sure(self) -> bool:
        """Whether the value is beyond what chance makes of zero."""
        return self.size > SIGNIFICANT * np.nan_to_num(self.error)


def said(
    phrase: Phrase, value: float, error: float, unit: str, usual: float, joint: int = 0, kind: str = "",
    lead: float | None = None,
) -> ValuePhrase:  # fmt: skip
    """Say one value.

    Args:
        phrase: of its parameter.
        value: in the unit of the file.
        error: its standard error, NaN where none is known.
        unit: of the file.
        usual: usual size.
        joint: number of the joint, from 1; 0 where it belongs to none.
        kind: mechanism family.
        lead: of the screws, mm; None where it is not known.

    Returns:
        The words.
    """
    side, arm = int(value < 0.0), kind == "serial"
    who = phrase.arm_who or phrase.who if arm else phrase.who
    factor, shown = SHARE_OF_TURN if arm and not who and unit == "1" else SHOWN_UNITS.get(unit, (1.0, unit))
    factor *= phrase.times
    mend = (phrase.arm_mend if arm else phrase.mend)[side]
    turn = "" if lead is None else f" ({_turned(abs(value) / lead * 360.0)} of its screw)"
    return ValuePhrase(
        who, joint, phrase.on(kind)[side], abs(value) * factor, error * factor, shown, abs(value) / usual,
        mend.replace("{turn}", turn),
    )  # fmt: skip


def worth_saying(parts: Sequence[ValuePhrase]) -> list[ValuePhrase]:
    """What is beyond chance and not small beside the rest, the largest first."""
    most = max((part.worth for part in parts), default=0.0)
    sure = [part for part in parts if part.sure and part.worth > SMALL * most]
    return sorted(sure, key=lambda part: -part.worth)


def remedies(parts: Sequence[ValuePhrase], noun: str) -> str:
    """What sets right all that is worth saying.

    Args:
        parts: what can be said.
        noun: 'slider', 'tower', 'link', 'joint'.

    Returns:
        For example 'raise slider 2 by 250 um (18 deg of its screw)'; '' where nothing can be turned.
    """
    worth = [part for part in worth_saying(parts) if part.mend][:MOST_VALUES]
    each = [part.mend.format(who=f"{noun} {part.joint}", what=sizes_in_words([part])) for part in worth]
    return listed(each) if each else ""


def smaller_ones(count: int) -> str:
    """How many smaller ones there are besides, in words: '1 smaller one', '3 smaller ones'."""
    return f"{count} smaller one{'' if count == 1 else 's'}"


def compose(parts: Sequence[ValuePhrase], noun: str) -> str:
    """One sentence without its end: subjects of the same side together, only what is beyond chance.

    Args:
        parts: what can be said.
        noun: 'slider', 'tower', 'link', 'joint'.

    Returns:
        For example 'links 1 and 3 are 200 and 120 um too long, link 2 is 90 um too short'; '' for no parts.
    """
    if not parts:
        return ""
    sure = worth_saying(parts)
    shown = sure or [max(parts, key=lambda part: part.worth)]
    few = f" (and {smaller_ones(len(shown) - MOST_VALUES)})" if len(shown) > MOST_VALUES else ""
    first = {part.text: index for index, part in reversed(list(enumerate(shown)))}
    shown = sorted(shown[:MOST_VALUES], key=lambda part: (part.who, first[part.text], part.joint))
    words, before = "", ""
    for (who, text), group in groupby(shown, key=lambda part: (part.who, part.text)):
        subject, rest = _clause(who, text, list(group), noun)
        words += f" and {rest}" if subject == before else f"{', ' if words else ''}{subject} {rest}"
        before = subject
    if sure:
        return f"{words}{few}"
    # Several values may be sure together though no single one is, and that is no word on whether they are.
    within = "none of these alone is beyond chance" if len(parts) > 1 else "no more than chance"
    if np.isnan(shown[0].error):
        return f"{words}, {within}"
    if shown[0].error > UNTOLD * shown[0].size > 0.0:
        return f"{words}, give or take many times that ({within})"
    return f"{words}, give or take {sizes_in_words([replace(shown[0], size=shown[0].error)])} ({within})"


def doubt(parts: Sequence[ValuePhrase]) -> str:
    """A word on sizes that no machine has; '' where there are none.

    Args:
        parts: what can be said.

    Returns:
        For example ' (105 x its usual size: is the drawing right?)'.
    """
    most = max((part.worth for part in worth_saying(parts)), default=0.0)
    return f" ({most:.0f} x its usual size: is the drawing right?)" if most > ABSURD else ""


def _clause(who: str, text: str, group: Sequence[ValuePhrase], noun: str) -> tuple[str, str]:
    many = len(group) > 1
    subject = who or f"{noun}{'s' if many else ''} {listed([str(part.joint) for part in group])}"
    return subject, text.format(what=sizes_in_words(group), **(MANY if many else ONE))


def sizes_in_words(group: Iterable[ValuePhrase]) -> str:
    """Sizes with their unit, as in '41 and 38 um'."""
    parts = list(group)
    factor, unit = scaled([part.size for part in parts], parts[0].unit)
    return f"{listed([figure(factor * part.size) for part in parts])} {unit}"


def scaled(sizes: Sequence[float], unit: str) -> tuple[float, str]:
    """The prefix that suits some sizes.

    Args:
        sizes: not negative, in `unit`.
        unit: of a length, an angle or a time with its prefix, by itself or per something: 'um', 'urad', 'um/m/K'.

    Returns:
        What sizes are multiplied by, and the unit then; another unit is left as it is.
    """
    found = UNIT.fullmatch(unit)
    said = [size for size in sizes if size > 0.0 and np.isfinite(size)]
    if found is None or not said:
        return 1.0, unit
    micro, factor = unit[:1] if unit[:1] in "u\N{MICRO SIGN}" else "u", 1.0
    at = PREFIXES.index(found["prefix"].replace("\N{MICRO SIGN}", "u"))
    while at < PREFIXES.index("") and factor * (1.0 + 1e-9) >= min(LARGE / min(said), LARGEST / max(said)):
        at, factor = at + 1, factor / 1e3
    while at > 0 and factor * max(said) < LEAST_SIZE:
        at, factor = at - 1, factor * 1e3
    return factor, f"{PREFIXES[at].replace('u', micro)}{found['base']}{found['per'] or ''}"


def _turned(degrees: float) -> str:
    return f"{figure(degrees)} deg" if degrees < FULL else f"{figure(degrees / 360.0)} turns"


def figure(value: float) -> str:
    """A number with at least two figures that count, and no more behind the point than those."""
    if value == 0.0 or not np.isfinite(value):
        return f"{value:.0f}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(abs(value) * (1.0 + 1e-9)))))}f}"


def capital(text: str) -> str:
    """A text that begins a sentence."""
    return f"{text[:1].upper()}{text[1:]}"


def listed(items: Sequence[str], last: str = " and ") -> str:
    """Items with commas, and a word before the last; '' of none."""
    return last.join(part for part in (", ".join(items[:-1]), *items[-1:]) if part)
