"""Straight lines and arcs as a program states them, and points along them.

Source: RS274/NGC 3.5.1 to 3.5.3: an arc turns about the normal of its plane, anticlockwise seen from the normal's
positive end for G3, and moves uniformly along it (helix); LinuxCNC's P is the number of turns begun. A centre that is
not exactly as far from the end as from the start gives a spiral whose radius changes linearly.
"""

import math
from dataclasses import dataclass

import numpy as np

from ptt.correct.program.words import at_line
from ptt.errors import InputError

Array = np.ndarray

PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}  # first and second axis of the plane, and its normal
CENTRES = "IJK"
UNEVEN, UNEVEN_SHARE = 0.05, 0.001  # mm, and of the radius: LinuxCNC's limits of the difference of both radii
NONE_MM = 1e-9  # points closer together coincide


@dataclass(frozen=True, eq=False)
class Arc:
    """Circular part of a move.

    Attributes:
        axes: first and second axis of its plane.
        centre: (2,) mm.
        begin: angle at the start, rad.
        sweep: angle that is turned through, rad, anticlockwise positive.
        radius: at the start and at the end, mm.
    """

    axes: tuple[int, int]
    centre: Array
    begin: float
    sweep: float
    radius: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Move:
    """A move of the tool, in the program's own coordinates.

    Attributes:
        block: index of the block it comes from.
        rapid: whether it is G0.
        start: (3,) mm.
        end: (3,) mm.
        known: (3,) bool, axes whose place the program has stated by the end of the move.
        begun: whether all of them were stated before the move.
        arc: its circular part; None for a straight line.
        feed: mm/s; NaN where the program has not said, and for G0.
        absolute: whether the program states positions (G90), not increments (G91).
        unit: mm per unit of the program.
        machine: whether it is in machine coordinates (G53).
        carried: letter of a further axis -> its start and end, and whether the program states increments.
    """

    block: int
    rapid: bool
    start: Array
    end: Array
    known: Array
    begun: bool
    arc: Arc | None
    feed: float
    absolute: bool
    unit: float
    machine: bool
    carried: dict[str, tuple[float, float, bool]]

    @property
    def length(self) -> float:
        """Path length, mm."""
        if self.arc is None:
            return float(np.linalg.norm(self.end - self.start))
        along = float(np.delete(self.end - self.start, self.arc.axes)[0])
        return math.hypot(abs(self.arc.sweep) * 0.5 * sum(self.arc.radius), along)

    def points(self, share: Array) -> Array:
        """Positions along the move.

        Args:
            share: (m,), travelled fraction, 0 to 1.

        Returns:
            (m, 3) mm.
        """
        place = self.start + share[:, None] * (self.end - self.start)
        if self.arc is None:
            return np.asarray(place)
        first, second = self.arc.axes
        angle = self.arc.begin + share * self.arc.sweep
        radius = self.arc.radius[0] + share * (self.arc.radius[1] - self.arc.radius[0])
        place[:, first] = self.arc.centre[0] + radius * np.cos(angle)
        place[:, second] = self.arc.centre[1] + radius * np.sin(angle)
        place[share >= 1.0] = self.end
        return np.asarray(place)


def find_arc(
    start: Array,
    end: Array,
    plane: int,
    clockwise: bool,
    words: dict[str, float],
    *,
    unit: float,
    centre_absolute: bool,
    where: tuple[str, int],
) -> Arc:
    """The arc that the words of a block state.

    Args:
        start: (3,) mm.
        end: (3,) mm.
        plane: 17, 18 or 19.
        clockwise: whether it is G2.
        words: I, J, K, R, P of the block.
        unit: mm per unit of the program.
        centre_absolute: whether I, J, K are positions (G90.1), not offsets from the start.
        where: file and line for messages.

    Returns:
        The arc.

    Raises:
        InputError: there is no such arc.
    """
    first, second, _ = PLANES[plane]
    a, b = start[[first, second]], end[[first, second]]
    if "R" in words:
        centre = _centre_by_radius(a, b, unit * words["R"], clockwise, where)
    else:
        centre = _centre_by_words((first, second), a, words, unit, centre_absolute, where)
    radius, last = float(np.linalg.norm(a - centre)), float(np.linalg.norm(b - centre))
    if radius < NONE_MM:
        raise _no_arc("its centre is its start", where)
    if abs(radius - last) > max(UNEVEN, UNEVEN_SHARE * radius):
        raise _no_arc(f"its centre is {radius:.4f} mm from its start and {last:.4f} mm from its end", where)
    begin = math.atan2(*(a - centre)[::-1])
    sweep = (math.atan2(*(b - centre)[::-1]) - begin) % (2.0 * math.pi)
    if sweep < 1e-12 or sweep > 2.0 * math.pi - 1e-12 or np.allclose(a, b, rtol=0.0, atol=NONE_MM):
        sweep = 0.0  # a whole turn
    turns = words.get("P", 1.0)
    if turns < 1.0 or turns != round(turns):
        raise _no_arc(f"P{turns:g} is not a number of turns", where)
    whole = 2.0 * math.pi * (turns - 1.0)
    sweep = (sweep - 2.0 * math.pi if clockwise else sweep or 2.0 * math.pi) + (-whole if clockwise else whole)
    return Arc((first, second), centre, begin, sweep, (radius, last))


def _centre_by_radius(a: Array, b: Array, radius: float, clockwise: bool, where: tuple[str, int]) -> Array:
    """Centre (2,) of the arc of a given radius; a negative radius means the longer arc."""
    way = b - a
    half = 0.5 * float(np.linalg.norm(way))
    if half < NONE_MM:
        raise _no_arc("R gives no centre where the end is the start", where)
    if half > abs(radius) + UNEVEN:
        raise _no_arc(f"its end is {2 * half:.4f} mm away, more than twice R {abs(radius):g} mm", where)
    rise = math.sqrt(max(radius**2 - half**2, 0.0))
    left = np.array([-way[1], way[0]]) / (2.0 * half)
    return np.asarray(a + 0.5 * way + (rise if clockwise == (radius < 0.0) else -rise) * left)


def _centre_by_words(
    axes: tuple[int, int],
    start: Array,
    words: dict[str, float],
    unit: float,
    absolute: bool,
    where: tuple[str, int],
) -> Array:
    letters = [CENTRES[axis] for axis in axes]
    stray = [letter for letter in CENTRES if letter in words and letter not in letters]
    if stray and any(words[letter] for letter in stray):
        raise _no_arc(f"{stray[0]} is not one of its plane's {' and '.join(sorted(letters))}", where)
    if not any(letter in words for letter in letters):
        raise _no_arc(f"neither R nor {' nor '.join(sorted(letters))} gives its centre", where)
    if absolute:
        if not all(letter in words for letter in letters):
            raise _no_arc(f"with G90.1 it needs both {' and '.join(sorted(letters))}", where)
        return np.array([unit * words[letter] for letter in letters])
    return np.asarray(start + [unit * words.get(letter, 0.0) for letter in letters])


def _no_arc(why: str, where: tuple[str, int]) -> InputError:
    return InputError(f"this is not an arc: {why}", where=at_line(*where), fix="correct the line")
