"""Places, values and sizes of a dependence in words, with units and significant digits."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ptt.dependence.size import Size
from ptt.effects.curve_basis import LOAD
from ptt.effects.phrases import SIGNIFICANT, capital, figure, listed, places, scaled

NO_CHANCE = 1e-12  # smaller p-values are shown as below this one
ELSEWHERE = 2.0  # ratio of the rms at the tool to a size along the variable, from which the error mostly lies elsewhere
NOTHING = 0.01  # share of a size, below which a second one is none
FINEST = {"mm": 2, "rad": 4, "s": 0, "C": 2, "kg": 2}  # decimals that are shown, at most
UNLIKE = 9  # decimals that distinguish any two values of a table
MOST_MOMENTS = 6  # moments that a sentence lists
ROW = "row"  # the time of a run without a clock
WAYS = {
    "way": "the {} component of the tool's direction of travel",
    "turn": "the {} component of the tool's change of direction",
    "gravity": "the {} component of gravity in the tool's own frame",
}
MOVES = {f"{word} {axis}": text.format(axis) for word, text in WAYS.items() for axis in "xyz"} | {
    "step": "the length of the tool's last move",
    "pause": "the time since the last reading elsewhere",
    "reversal": "the travel since the last reversal",
}  # variables that are no columns of a table, by what they are

LOADED = {"force": "slider", "torque": "joint"}  # name of a load, without the joint's number, and on what it acts


def described(on: str) -> str | None:
    """What a variable is that is no column of a table, as 'the load on slider 2' of 'force2'; None for a column."""
    load = LOAD.fullmatch(on)
    return f"the load on {LOADED[load[1]]} {load[2]}" if load else MOVES.get(on)


def _toward(axis: str, whose: str = "") -> tuple[str, str, str]:
    return f"further toward +{axis}{whose}", f"further toward -{axis}{whose}", f"furthest toward +{axis}{whose}"


SIDES: Mapping[str, tuple[str, str, str]] = {  # place -> above zero, below zero, where it is largest
    "slider": ("higher", "lower", "highest"),
    "joint": ("further forward", "further back", "furthest forward"),
    "link": ("longer", "shorter", "longest"),
    "outward": ("further outward", "further inward", "furthest outward"),
    "sideways": (
        "further counter-clockwise (seen from above)",
        "further clockwise (seen from above)",
        "furthest counter-clockwise (seen from above)",
    ),
    **{axis: _toward(axis) for axis in "xyz"},
    **{f"mount {axis}": _toward(axis, " of its own frame") for axis in "xyz"},
}


def by_chance(p_value: float) -> str:
    """A p-value as a reader can use it.

    Args:
        p_value: 0 to 1.

    Returns:
        For example 'p = 0.003', 'p < 1e-12'.
    """
    return f"p < {NO_CHANCE:.0e}" if p_value < NO_CHANCE else f"p = {p_value:.1g}"


def between(low: float, high: float, unit: str) -> str:
    """An interval with as many decimals as distinguish its ends; a single value where `FINEST` does not.

    Args:
        low: its lower end.
        high: its upper end.
        unit: of both; '' for none.

    Returns:
        For example '15.9 to 62.1 mm', or '16.01 mm'.
    """
    digits = _apart(low, high, FINEST.get(unit, UNLIKE))
    one, two = (f"{value:z.{digits}f}" for value in (low, high))
    return f"{one if one == two else f'{one} to {two}'} {unit}".strip()


def _apart(low: float, high: float, most: int = UNLIKE) -> int:
    """Decimals that distinguish two values."""
    return int(np.clip(1 - np.floor(np.log10(max(abs(high - low), 1e-9))), 0, most))


def middle(low: float, high: float, unit: str) -> str:
    """The middle of an interval with its unit, with decimals by the interval's width."""
    digits = int(np.clip(np.ceil(-np.log10(max(high - low, 1e-9))), 0, FINEST.get(unit, UNLIKE)))
    return f"{0.5 * (low + high):z.{digits}f} {unit}".strip()


def switched_at(moments: Sequence[float], unit: str) -> str:
    """When something switched: moments in ascending order, of more than `MOST_MOMENTS` the first ones.

    Args:
        moments: since the first row; without a unit they lie between rows, counted from 0.
        unit: of the moments; '' without a clock.

    Returns:
        For example '526 and 746 s after the first row'; without a unit the rows before, counted from 1.
    """
    told = [f"{moment:.0f}" if unit else _row(moment) for moment in moments[:MOST_MOMENTS]]
    more = len(moments) - len(told)
    some = f"{', '.join(told)} {unit}".strip() + f" and {more} more" if more else f"{listed(told)} {unit}".strip()
    return f"{some} after the first row" if unit else f"after row{'s' * (len(moments) > 1)} {some}"


def changed_at(low: float, high: float, unit: str) -> str:
    """When something changed once: the readings before and after it, as of `switched_at`."""
    if not unit:
        return f"between rows {_row(low)} and {_row(high)}"
    return f"{between(low, high, unit)} after the first row"


def _row(moment: float) -> str:
    """Number of the row at or before a moment of a run without a clock, counted from 1."""
    return f"{int(moment) + 1}"


def _by_row(size: Size) -> Size:
    """A size along the time of a run without a clock by its rows, counted from 1; any other one as it is."""
    if size.along != "time" or size.unit:
        return size
    on = ROW if size.on == "time" else size.on
    return replace(size, on=on, along=ROW, low=size.low + 1.0, high=size.high + 1.0)


def say_size(size: Size) -> str:
    """Sentence on the size and sign of a dependence.

    Args:
        size: the size.

    Returns:
        One sentence, for example 'Slider 1 is 38 +- 2 um higher after moving up than after moving down.'
    """
    size = _by_row(size)
    what = size.of if size.of in SIDES else size.of.split()[-1 if size.of[-1].isalpha() else 0]
    who, (more, less, most) = who_is_off(size.of), SIDES[what]
    side = more if size.value >= 0.0 or not size.known else less
    at_most = f"at most {_amount(size, _bound(size), 0.0)}"
    what = _amount(size, size.value, size.std) if size.known else f"{at_most} {less} or"
    low, high = (f"{size.along} = {value}" for value in _values(size.low, size.high, size.unit))
    scattered = size.kind == "law" and not size.known and _is_elsewhere(size, _bound(size))
    far, ways = f"{who} is {what} {side}", _arrival(size)
    match size.kind:
        case "side":
            told = f"{far} {ways}"
        case "turn":
            turned = f"after a reversal {who} turns over gradually by"
            told = f"{turned} {what}, {side} {ways}" if size.known else f"{turned} {at_most}, either way"
        case "varying":
            told = f"{far} {ways} at {high}, {_then(size, more, less)} at {low.partition(' = ')[2]}"
        case "step":
            told = f"{far} above {size.on} = {_passed(size)} than below it"
        case "bump":
            told = f"{far} near {size.on} = {middle(size.low, size.high, size.unit)} than on either side of it"
        case "period" if size.known:
            each = f"{size.high - size.low:.4g} {size.unit}".strip()
            turn = f", {2.0 * np.pi / (size.high - size.low):.4g} times a turn" if size.unit == "rad" else ""
            told = f"{who} varies by {what} to either side, {most} at {low} and every {each} from there{turn}"
        case "period":
            told = f"{who} varies by {at_most} to either side"
        case _ if scattered:
            both = f"at {high} and {low.partition(' = ')[2]}, within {_amount(size, _bound(size), 0.0)}"
            told = f"on average {who} has the same {size.of.removeprefix('mount ')} {both}, though single places differ"
        case _:
            told = f"{far} at {high} than at {low.partition(' = ')[2]}"
    open_ended = "" if size.known or size.kind in ("period", "turn") or scattered else ": this run does not tell which"
    told = f"{capital(told)}{open_ended}"
    if size.rms is None:
        return f"{told}."
    elsewhere = size.known and _is_elsewhere(size, abs(size.value))
    mean = " on average, though single places differ" if elsewhere else ""
    return f"{told}{mean}; {_in_um(1e3 * size.rms)} rms at the tool."


def _passed(size: Size) -> str:
    """Where a step is: of rows the last one before it."""
    return f"{size.low:.0f}" if size.on == ROW else middle(size.low, size.high, size.unit)


def _is_elsewhere(size: Size, value: float) -> bool:
    """Whether a tool error's rms is much larger than a value: most of it then varies with something else."""
    return who_is_off(size.of) == "the tool" and size.rms is not None and size.rms > ELSEWHERE * value


def _then(size: Size, more: str, less: str) -> str:
    """Words on the reversal error at the other end of the second variable."""
    value, std = size.other or 0.0, size.other_std or 0.0
    if abs(value) <= SIGNIFICANT * std or abs(value) < NOTHING * abs(size.value):
        bound = abs(value) + 2.0 * std
        within = f"and at most {_amount(size, bound, 0.0)} either way"
        return "with no difference" if bound < NOTHING * abs(size.value) else within
    return f"and {_amount(size, value, std)} {more if value > 0.0 else less}"


def _bound(size: Size) -> float:
    """Bound of a size whose sign is not significant: two standard errors beyond it."""
    return abs(size.value) + 2.0 * size.std


def who_is_off(of: str) -> str:
    """The part that is off, in words: 'rail 2' for 'rail 2 outward', 'the tool' for 'x' and 'mount x'."""
    return (
        "the tool"
        if of.removeprefix("mount ") in ("x", "y", "z")
        else of.removesuffix(" outward").removesuffix(" sideways")
    )


def _arrival(size: Size) -> str:
    """The two directions in which a joint may have moved to a pose."""
    who = f"{size.noun} {size.on.removeprefix('direction')}"
    one, other = ("forward", "back") if size.noun == "joint" else ("up", "down")
    if who == size.of:
        return f"after moving {one} than after moving {other}"
    return f"after {who} moves {one} than after it moves {other}"


def _values(low: float, high: float, unit: str) -> tuple[str, str]:
    """Two values of a variable with their unit, with enough decimals to distinguish them."""
    apart = _apart(low, high)
    digits = min(apart, FINEST.get(unit, apart))
    if f"{low:z.{digits}f}" == f"{high:z.{digits}f}":  # the usual decimals do not distinguish them
        digits = apart
    one, two = (f"{value:z.{digits}f}" for value in (low, high))
    return f"{one} {unit}".strip(), f"{two} {unit}".strip()


def _amount(size: Size, value: float, std: float) -> str:
    """A size with its standard error, as '38 +- 2 um'."""
    fine, micro = (1e6, "urad") if size.of.startswith("joint") else (1e3, "um")
    factor, unit = scaled([fine * abs(value)], micro)
    shown, error = factor * fine * abs(value), factor * fine * std
    if not error > 0.0:
        return f"{figure(shown)} {unit}"
    digits = min(places(error), 2 if shown < 10.0 else 1)
    return f"{shown:.{digits}f} +- {max(error, 10.0**-digits):.{digits}f} {unit}"


def _in_um(size: float) -> str:
    """A length in um with the prefix that suits it."""
    factor, unit = scaled([size], "um")
    return f"{figure(factor * size)} {unit}"
