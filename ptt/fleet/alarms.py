"""Alarms: a drift that leads beyond its usual size, a jump, a machine unlike its sisters, a run that cannot be used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

from ptt.effects.phrases import SHOWN_UNITS, figure
from ptt.fleet.trends import ALPHA, Movement, Moves
from ptt.record import Record
from ptt.run.dates import day_at
from ptt.run.tails import median_sigma

Trend = Literal["drift", "jump", "unlike", "new", "changed", "setup", "failed"]
MONTH = 30.44  # days
REPAIRED_SHARE = 0.2  # a jump to less than this share of the value before it looks like a repair
MOST_EXTRAPOLATION = 10.0  # a drift is extrapolated over at most so many times the time that was watched
SISTERS = 6  # least number of machines with one drawing for one of them to be called unlike the others
# A distance from the median, over the median absolute deviation, follows Student's t with FREEDOM_AT_NONE degrees of
# freedom and FREEDOM_PER_PAIR more for each two machines: fitted to simulated quantiles of the farthest of 6 to 50
# normal values, at chances of 1e-2 to 1e-4. The asymptotic efficiency (`ptt.fleet.scatter.MEDIAN_EFFICIENCY`) gives
# fewer: it would ask 30 deviations of six machines, where 10 are right.
FREEDOM_PER_PAIR, FREEDOM_AT_NONE = 0.8, 0.7


@dataclass(frozen=True)
class Alarm(Record):
    """One thing that somebody should look at.

    Attributes:
        effect: name of the effect; where the alarm is about none, what it is about ('error', 'run', ...).
        parameter: of the effect; '' where the alarm is about no single one.
        trend: 'drift', 'jump', 'unlike' (its sisters), 'new' (physics), 'changed' (in the last run), 'setup' (a
            mistake in it) or 'failed'.
        words: for a person.
        size: of a drift per month, of a jump in all, of 'unlike' the value, in `unit`; None for the others.
        std: standard error of the size.
        unit: as in the machine file.
        when: ISO date of a jump or of a run, or on which a drift passes the usual size; None where there is none.
    """

    effect: str
    parameter: str
    trend: Trend
    words: str
    size: float | None = None
    std: float | None = None
    unit: str = ""
    when: str | None = None


@dataclass(frozen=True)
class Names:
    """What the p values of one machine are called.

    Attributes:
        names: 'effect parameter' of each.
        labels: the same for a person.
        units: of each, as in the machine file.
        usual: usual size of each, (p,) in those units.
    """

    names: Sequence[str]
    labels: Sequence[str]
    units: Sequence[str]
    usual: np.ndarray


def alarm_of_movement(movement: Movement, moves: Moves, names: Names, days: np.ndarray) -> Alarm | None:
    """The alarm that a movement is; None for a drift that would take too long to reach its usual size."""
    return (_drift if movement.kind == "drift" else _jump)(movement, moves, names, days)


def _drift(movement: Movement, moves: Moves, names: Names, days: np.ndarray) -> Alarm | None:
    place = movement.place
    usual = float(names.usual[place])
    now = float(moves.course[-1, place])
    left = (np.sign(movement.size) - now) / movement.size  # days until the usual size: one, as values are in its units
    span = float(np.ptp(days))
    if abs(now) < 1.0 and left > MOST_EXTRAPOLATION * span:
        return None
    size, std = (value * MONTH * usual for value in (movement.size, movement.std))
    way, end, when = ("grows" if movement.size * now > 0 else "shrinks"), "", None
    if abs(now) >= 1.0 and movement.size * now > 0:
        end = f", already beyond its usual size of {amount(usual, names.units[place])}"
    elif movement.size * now < 0:
        end = ", toward zero"
    else:
        when = day_at(days[-1] + left).isoformat()
        end = f", and will pass its usual size of {amount(usual, names.units[place])} about {when}"
    pace = amount(abs(size), names.units[place], std)
    words = f"{names.labels[place]} {way} by {pace} a month, {amount(now * usual, names.units[place])} now{end}"
    return _alarm(names, place, "drift", words, size, std, when)


def _jump(movement: Movement, moves: Moves, names: Names, days: np.ndarray) -> Alarm:
    place = movement.place
    usual, unit = float(names.usual[place]), names.units[place]
    size, std = movement.size * usual, movement.std * usual
    runs = np.flatnonzero(days >= movement.day)
    after = float(moves.course[runs[0], place]) * usual
    when = day_at(movement.day).isoformat()
    back = ", as after a repair" if abs(after) < REPAIRED_SHARE * abs(after - size) else ""
    words = (
        f"{names.labels[place]} jumped by {amount(size, unit, std, sign=True)} between {day_at(movement.before)} and "
        f"{when}, from {amount(after - size, unit)} to {amount(after, unit)}{back}"
    )
    return _alarm(names, place, "jump", words, size, std, when)


def unlike(values: Mapping[str, tuple[float, float]], compared: int = 1) -> dict[str, float]:
    """Machines whose value is an outlier among those of their sisters.

    Args:
        values: machine -> value and its standard error.
        compared: number of values that are compared between these machines, for Bonferroni's bound.

    Returns:
        Machine -> its distance from the sisters' median in robust standard deviations. Only those machines whose
        chance, times all machines and all values that are compared, is below `ALPHA`; none of fewer than `SISTERS`.
    """
    if len(values) < SISTERS:
        return {}
    own = np.array([value for value, _ in values.values()])
    std = np.array([error for _, error in values.values()])
    middle = float(np.median(own))
    spread = float(median_sigma(own - middle))
    scale = np.hypot(spread, np.nan_to_num(std))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(scale > 0.0, (own - middle) / scale, 0.0)
    freedom = FREEDOM_PER_PAIR * (len(own) // 2) + FREEDOM_AT_NONE
    chance = 2.0 * stats.t.sf(np.abs(distance), freedom) * len(own) * compared
    return {name: float(far) for name, far, p in zip(values, distance, chance, strict=True) if p < ALPHA}


def unlike_alarm(effect: str, parameter: str, label: str, unit: str, value: float, middle: float, far: float) -> Alarm:
    """The alarm for a machine unlike its sisters: its value, their median, and the distance that `unlike` gives."""
    words = (
        f"{label} is {amount(value, unit)}, {abs(far):.1f} robust standard deviations from its sister machines' median "
        f"of {amount(middle, unit)}"
    )
    return Alarm(effect, parameter, "unlike", words, value, None, unit)


def _alarm(names: Names, place: int, trend: Trend, words: str, size: float, std: float, when: str | None) -> Alarm:
    effect, _, parameter = names.names[place].partition(" ")
    return Alarm(effect, parameter, trend, words, size, std, names.units[place], when)


def amount(value: float, unit: str, std: float | None = None, *, sign: bool = False) -> str:
    """A value in words: in a workshop's unit (um for mm), with its standard error where one is given."""
    factor, name = SHOWN_UNITS.get(unit, (1.0, unit))
    text = figure(abs(value) * factor)
    if std is not None:  # two figures of the error, and the value to its last one: GUM, JCGM 100:2008, 7.2.6
        error = figure(std * factor)
        text = f"{abs(value) * factor:.{len(error.partition('.')[2])}f} +- {error}"
    return f"{'-' if value < 0 else '+' if sign else ''}{text} {name}".strip()
