"""Parameter values in words: what a positive and a negative one mean, with sizes in workshop units (um, urad, ms)."""

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
SHARE_OF_TURN = (1e6, "urad/rad")  # unit of a share ("1") where it is of a revolute joint's angle
UNIT = re.compile("(?P<prefix>[nmu\N{MICRO SIGN}]?)(?P<base>rad|m|s)(?P<per>[/ ].*)?")
PREFIXES = ("n", "u", "m", "")  # of m, rad and s, by thousands
LARGE, LARGEST = 1e3, 1e4  # smallest and largest of several sizes from which they are said with the next prefix
LEAST_SIZE = 1e-2  # largest of several sizes below which they are said with the prefix before
FULL = 720.0  # deg from which a screw's rotation is said in turns
UNTOLD = 20.0  # ratio of standard error to value beyond which the error is said as "many times that"
MOST_VALUES = 6  # of one effect in a sentence
SMALL = 0.02  # share of the largest value below which a value is not worth an adjustment
ONE = {"s": "s", "es": "es", "is_": "is", "has": "has"}
MANY = {"s": "", "es": "", "is_": "are", "has": "have"}
ABSURD = 30.0  # usual sizes: no machine is off by as much, only a drawing with a wrong sign or number
SIGNIFICANT = 3.0  # standard errors from which a value is worth a word


@dataclass(frozen=True)
class Phrase:
    """What a positive and a negative value of one parameter mean, as templates.

    `{what}` is the size with its unit, `{axis}` x, y or z of a vector's component; `{s}`, `{es}`, `{is_}`, `{has}` are
    the verb for one or several joints. Remedies have `{who}`, `{what}`, and `{turn}`, how far a screw is to be turned.

    Attributes:
        stem: of the parameter.
        plus: predicate for a positive value, as in '{is_} {what} too long'.
        minus: predicate for a negative value.
        who: the subject; '' for the joint.
        arm: plus and minus on a serial arm, where they differ.
        arm_who: the subject on a serial arm.
        times: the size that is said, as a multiple of the value.
        mend: remedies for a positive and a negative value, as in 'shorten {who} by {what}'; '' for none.
        arm_mend: the remedies on a serial arm.
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
        joint: number of the joint or leg, from 1; 0 where it belongs to none.
        text: predicate, with {what} still to be filled in.
        size: magnitude in `unit`.
        error: its standard error in `unit`; NaN where none is known.
        unit: the unit that is said.
        worth: magnitude in usual sizes, by which values are ranked.
        mend: the remedy; '' for none.
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
        """Whether the value differs from zero by more than `SIGNIFICANT` standard errors."""
        return self.size > SIGNIFICANT * np.nan_to_num(self.error)


def said(
    phrase: Phrase, value: float, error: float, unit: str, usual: float, joint: int = 0, kind: str = "",
    lead: float | None = None,
) -> ValuePhrase:  # fmt: skip
    """Put one value into words.

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
    """The significant values that are not small beside the largest, in order of worth."""
    most = max((part.worth for part in parts), default=0.0)
    sure = [part for part in parts if part.sure and part.worth > SMALL * most]
    return sorted(sure, key=lambda part: -part.worth)


def remedies(parts: Sequence[ValuePhrase], noun: str) -> str:
    """The remedies of all values that are worth saying, in words.

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
    """One sentence without its full stop on the significant values, subjects of the same predicate together.

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
    # An effect may be significant as a whole although no single value is; this speaks of single values only.
    within = "none of these alone is beyond chance" if len(parts) > 1 else "no more than chance"
    if np.isnan(shown[0].error):
        return f"{words}, {within}"
    if shown[0].error > UNTOLD * shown[0].size > 0.0:
        return f"{words}, give or take many times that ({within})"
    return f"{words}, give or take {sizes_in_words([replace(shown[0], size=shown[0].error)])} ({within})"


def doubt(parts: Sequence[ValuePhrase]) -> str:
    """Remark on values beyond `ABSURD` usual sizes; '' where there are none.

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
    """The metric prefix in which several sizes are said together.

    Args:
        sizes: not negative, in `unit`.
        unit: of a length, an angle or a time with its prefix, by itself or per something: 'um', 'urad', 'um/m/K'.

    Returns:
        Factor that sizes are multiplied by, and the unit then; (1, unit) for any other unit.
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
    """A number with two significant figures, or all of those before the decimal point where there are more."""
    if value == 0.0 or not np.isfinite(value):
        return f"{value:.0f}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(abs(value) * (1.0 + 1e-9)))))}f}"


def places(error: float) -> int:
    """Decimal places that leave a standard error one significant digit, two where it begins with 1 or 2."""
    power = int(np.floor(np.log10(error)))
    return max(0, int(error < 3.0 * 10.0**power) - power)


def capital(text: str) -> str:
    """A text that begins a sentence."""
    return f"{text[:1].upper()}{text[1:]}"


def listed(items: Sequence[str], last: str = " and ") -> str:
    """Items with commas, and a word before the last; '' of none."""
    return last.join(part for part in (", ".join(items[:-1]), *items[-1:]) if part)
