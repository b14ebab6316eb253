"""Numbers and words as pages show them: Greek mu for micro, prefixes of units by magnitude, probabilities in words."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ptt.dependence.said import described
from ptt.effects.phrases import UNTOLD, places, scaled

MICRO = "\N{MICRO SIGN}"
PREFIXES = {-3: "n", -2: MICRO, -1: "m", 0: "", 1: "k", 2: "M"}  # of a base unit, by thousands
UNIT = rf"(?:[n{MICRO}umk]?(?:m|rad|g|s|N)|K|h|min|days|deg|%|\N{{DEGREE SIGN}}C|\N{{PLUS-MINUS SIGN}}|MB)"
# Spaces that must not be broken: between a number and its unit, or its error.
APART = re.compile(rf"(?<=\d) (?={UNIT}(?![A-Za-z]))|(?<=\N{{PLUS-MINUS SIGN}}) (?=\d)|(?<=/N) (?=m\b)")
JOINT = re.compile(r"(b|q|direction|speed|travel|load)(\d+)")  # a variable of one joint
CHANCES = ((0.99, "almost certain"), (0.9, "very likely"), (0.7, "likely"), (0.4, "about even"), (0.0, "unlikely"))


def together(text: str) -> str:
    """A text with no-break spaces between numbers, their errors and their units."""
    return APART.sub("\N{NO-BREAK SPACE}", text)


def pretty(text: str) -> str:
    """A text of the library in typographic signs: micro in units, arrows, plus-minus, no-break spaces."""
    text = re.sub(r"(?<![A-Za-z])u(m|rad)(?![A-Za-z])", rf"{MICRO}\1", text)
    return together(text.replace(" -> ", " \N{RIGHTWARDS ARROW} ").replace("+-", "\N{PLUS-MINUS SIGN}"))


def spoken(on: str, serial: bool) -> str:
    """Name of a variable that an error depends on, the same on all pages.

    Args:
        on: the variable: 'b3', 'direction2', 'payload', ...
        serial: whether the machine is an arm.

    Returns:
        For example 'height of slider 3'.
    """
    told = described(on)
    if told:
        return told
    found = JOINT.fullmatch(on)
    if found is None:
        return on
    what = {"b": "height", "q": "angle"}.get(found[1], found[1])
    return f"{what} of {'joint' if serial else 'slider'} {found[2]}"


def in_prose(on: str, serial: bool) -> str:
    """The name of `spoken` for use in a sentence: 'the height of slider 3', but 'payload'."""
    words = spoken(on, serial)
    return f"the {words}" if JOINT.fullmatch(on) else words


def length(um: float) -> str:
    """A length to three significant figures, in um, mm or m by its size.

    Args:
        um: in micrometres.

    Returns:
        For example '54.9 um' with the real sign, or '1.19 mm'.
    """
    if not math.isfinite(um):
        return "\N{EN DASH}"
    if abs(um) >= 999.5 * 1e3:
        return together(f"{um / 1e6:.3g} m".replace("-", "\N{MINUS SIGN}"))
    if abs(um) >= 999.5:
        return together(f"{um / 1e3:.3g} mm".replace("-", "\N{MINUS SIGN}"))
    return together(f"{_short(um, 3)} {MICRO}m")


def prefixed(values: Sequence[float], unit: str) -> tuple[float, str]:
    """Factor and unit that suit the largest of some values: 12,000 um are 12 mm, 0.02 um are 20 nm.

    Args:
        values: in `unit`.
        unit: of a length or angle, with or without a prefix ('um', 'mm', 'urad'), or 's'; others stay as they are.

    Returns:
        Factor on the values, and their unit then, with the sign for micro.
    """
    if unit == "s":
        return _of_time(values)
    sign = unit.replace("u", MICRO, 1) if unit[:1] == "u" else unit
    base = next((name for name in ("rad", "m") if sign.endswith(name) and sign[: -len(name)] in PREFIXES.values()), "")
    if not base:
        return 1.0, sign
    power = next(power for power, name in PREFIXES.items() if name == sign[: -len(base)])
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if largest == 0.0:
        return 1.0, sign
    step = max(-3, min(0, power + math.floor(math.log10(largest * (1.0 + 1e-9)) / 3.0)))
    if step == power + 1 and largest < 1e4:
        step = power  # four digits read better than a change of unit
    return 10.0 ** (3 * (power - step)), f"{PREFIXES[step]}{base}"


def _of_time(values: Sequence[float]) -> tuple[float, str]:
    """Factor and unit for times in s, by the span that they cover."""
    finite = [value for value in values if math.isfinite(value)]
    span = max(finite, default=0.0) - min(finite, default=0.0)
    for least, factor, unit in (
        (3 * 86400.0, 1.0 / 86400.0, "days"),
        (3 * 3600.0, 1.0 / 3600.0, "h"),
        (600.0, 1.0 / 60.0, "min"),
    ):
        if span >= least:
            return factor, unit
    return 1.0, "s"


def _short(value: float, digits: int) -> str:
    """A value to so many significant figures, at most three decimal places."""
    if abs(value) < 0.5e-3:  # rounds to zero
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value) * (1.0 + 1e-9))))
    return f"{value:.{min(places, 3)}f}".replace("-", "\N{MINUS SIGN}")


def percent(share: float) -> str:
    """A share as a percentage, for example '12 %'."""
    return together(f"{100.0 * share:.0f} %")


def how_sure(probability: float) -> str:
    """A probability, 0 to 1, in words and as a percentage, for example 'very likely (97 %)'."""
    words = next(words for least, words in CHANCES if probability >= least)
    return f"{words} ({'> 99' if probability >= CHANCES[0][0] else f'{100.0 * probability:.0f}'} %)"


SUFFIXES = (  # ending of a parameter's name, factor from its unit to the one that pages show, and that unit
    ("_mm_per_n", 1e3, "um/N"), ("_mm_per_kg", 1e3, "um/kg"), ("_mm_per_k", 1e3, "um/K"), ("_per_kg", 1e6, "um/m/kg"),
    ("_per_k", 1e6, "um/m/K"), ("_rad_per_nmm", 1e9, "urad/N m"), ("_mm", 1.0, "mm"), ("_rad", 1.0, "rad"),
    ("_s", 1.0, "s"),
)  # fmt: skip


def parameter_in_words(name: str, value: float, error: float | None, largest: float = 0.0) -> tuple[str, str, str]:
    """A parameter of a machine file in words.

    Args:
        name: as in the file, with its unit: 'gap_mm', 'gap_mm 2', 'scale 1'.
        value: in that unit.
        error: standard error in that unit; None where it has none.
        largest: largest value or error that stands with it, so that all of them have one unit.

    Returns:
        Name without the unit, value with the unit that suits its size, and the error with a plus-minus sign or ''.
    """
    stem, _, number = name.partition(" ")
    suffix, factor, unit = next(
        (each for each in SUFFIXES if stem.endswith(each[0])), ("", 1e6, "um/m") if stem == "scale" else ("", 1.0, "")
    )
    told = f"{stem.removesuffix(suffix).replace('_', ' ')} {number}".strip()
    size = max(abs(value), error or 0.0, largest)
    times, shown = scaled([factor * size], unit) if factor != 1.0 else prefixed([size], unit)
    times, shown = (times * factor, shown.replace("u", MICRO, 1)) if factor != 1.0 else (times, shown)
    if unit == "s":
        times, shown = (1e3, "ms") if size < 1.0 else (1.0, "s")
    text = f"{times * value:.4g}"
    if error:
        digits = places(times * error)
        text, said = f"{times * value:.{digits}f}", f"{times * error:.{digits}f}"
    return (
        told,
        together(f"{text} {shown}".strip().replace("-", "\N{MINUS SIGN}")),
        together(f"\N{PLUS-MINUS SIGN} {said}") if error else "",
    )


def value_in_words(value: Mapping[str, Any]) -> str:
    """A value of a finding with its standard error, for example '201 +- 4 um' in typographic signs."""
    factor, unit = scaled([value["size"]], value["unit"])
    size, error = factor * value["size"], value["error"]
    if error is None or not error > 0.0:
        return together(f"{_short(size, 2)} {unit}")
    if error > UNTOLD * value["size"]:
        return f"{together(f'{_short(size, 2)} {unit}')}, give or take many times that"
    digits = places(factor * error)
    return together(f"{size:.{digits}f} \N{PLUS-MINUS SIGN} {factor * error:.{digits}f} {unit}")


def by_part(values: Iterable[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """The values of a finding, grouped by the part that has them.

    Args:
        values: values of the finding (`ptt.show.card.result.CauseValue` as plain values).

    Returns:
        For each part, such as 'tower 3', its values in words, each with its direction on a second line.
    """
    parts: dict[str, list[str]] = {}
    for value in values:
        parts.setdefault(value["who"], []).append(f"{value_in_words(value)}\n{value.get('side', '')}".strip())
    return list(parts.items())
