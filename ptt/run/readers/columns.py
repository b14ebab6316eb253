"""The columns a tracker CSV may have: their names, dimensions and units.

Inside the program a column is known by its quantity, the name without a unit (`x_meas`, `q1_cmd`, `time`), and is kept
in mm, rad, s, kg, deg C and mm/s. In a file a suffix says another unit: `x_meas_um`, `q1_cmd_deg`, `time_ms`.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "length": {"mm": (1.0, 0.0), "um": (1e-3, 0.0), "cm": (10.0, 0.0), "m": (1000.0, 0.0), "in": (25.4, 0.0)},
    "angle": {"rad": (1.0, 0.0), "deg": (np.pi / 180.0, 0.0), "mrad": (1e-3, 0.0)},
    "time": {"s": (1.0, 0.0), "ms": (1e-3, 0.0), "min": (60.0, 0.0), "h": (3600.0, 0.0), "day": (86400.0, 0.0),
             "stamp": (1.0, 0.0)},
    "mass": {"kg": (1.0, 0.0), "g": (1e-3, 0.0), "lb": (0.45359237, 0.0)},  # lb: the international pound of 1959
    "temperature": {"c": (1.0, 0.0), "k": (1.0, -273.15), "f": (1.0 / 1.8, -32.0 / 1.8)},
    "speed": {"mm_s": (1.0, 0.0), "mm_min": (1.0 / 60.0, 0.0), "m_s": (1000.0, 0.0), "m_min": (1000.0 / 60.0, 0.0),
              "in_min": (25.4 / 60.0, 0.0)},
    "effort": {"": (1.0, 0.0), "n": (1.0, 0.0), "nm": (1.0, 0.0), "kn": (1e3, 0.0), "knm": (1e3, 0.0),
               "ncm": (1e-2, 0.0), "nmm": (1e-3, 0.0)},  # of a joint: N of a slider, N m of one that turns
    "number": {"": (1.0, 0.0)},
    "text": {"": (1.0, 0.0)},
}  # fmt: skip
"""Per dimension: unit -> (factor, offset), standard value = factor * value + offset; the standard unit comes first."""

GREATEST = {
    "length": 1e9,  # mm: a thousand km; a drawing in um taken for mm is a thousand times less, and is found as that
    "angle": 1e9,  # rad
    "time": 1e20,  # s: an epoch in ns is 1e18
    "mass": 1e9,  # kg
    "temperature": 1e6,  # deg C: the sun has 5,500 at its surface
    "speed": 1e12,  # mm/s: light has 3e11
    "effort": 1e12,  # N, N m
    "number": 1e12,  # counts
}
"""Per dimension: bound, in the standard unit, beyond every machine and every mistake of units; sums stay finite."""

LEAST_VALUES = {"temp": -273.15, "payload": -0.01, "feed": 0.0}
"""Per quantity: least possible value. -999 is a missing-value mark of other programs; an empty scale may read
some grams below zero. A tared load has to be stated as payload: load effects are zero at zero payload."""

UNSTATED_IS_ASKED = ("angle", "speed")
"""Dimensions whose unit must be stated: rad and deg, mm/s and mm/min are equally common."""

_QUANTITIES = (
    (re.compile(r"[xyz]_(cmd|meas|std)|b[1-9]\d*_cmd"), "length", True),
    (re.compile(r"q[1-9]\d*_cmd"), "angle", False),
    (re.compile(r"tau[1-9]\d*"), "effort", True),
    (re.compile(r"q[xyzw]_(cmd|meas)|dir[1-9]\d*|repeat"), "number", True),
    (re.compile(r"time"), "time", False),
    (re.compile(r"payload"), "mass", False),
    (re.compile(r"temp"), "temperature", False),
    (re.compile(r"feed"), "speed", False),
    (re.compile(r"name|role|run"), "text", True),
)


@dataclass(frozen=True)
class Meaning:
    """Meaning of a column.

    Attributes:
        quantity: name without unit, for instance `x_meas`.
        unit: a key of `UNITS[dimension]`; None where the file does not say.
        note: how the unit is known, where it is not written.
        likely: whether the title alone is no proof, so that any other column takes precedence (`Motor 1 [mm]`).
    """

    quantity: str
    unit: str | None
    note: str = ""
    likely: bool = False


@dataclass(frozen=True)
class Column:
    """One column of a file.

    Attributes:
        index: place in the row, from 0.
        title: as in the file, or 'column 1' where there are no titles.
        quantity: what it holds, '' for a column that is kept as text.
        unit: a key of `UNITS`.
        note: how that is known, where the title does not say it all.
    """

    index: int
    title: str
    quantity: str = ""
    unit: str = ""
    note: str = ""


def dimension_of(quantity: str) -> str:
    """Dimension of a quantity, a key of `UNITS`; '' for a name that is no quantity."""
    return next((dimension for pattern, dimension, _ in _QUANTITIES if pattern.fullmatch(quantity)), "")


def standard_unit(quantity: str) -> str:
    """Unit that the program keeps a quantity in."""
    return next(iter(UNITS[dimension_of(quantity)]))


def greatest(quantity: str) -> float:
    """Bound of a quantity, in its standard unit; infinity for a text."""
    return GREATEST.get(dimension_of(quantity), np.inf)


def least(quantity: str) -> float:
    """Least possible value of a quantity, in its standard unit."""
    return max(LEAST_VALUES.get(quantity, -np.inf), -greatest(quantity))


def file_title(quantity: str) -> str:
    """Column name that a written file uses: `x_meas`, `q1_cmd_rad`, `time_s`."""
    bare = next(plain for pattern, _, plain in _QUANTITIES if pattern.fullmatch(quantity))
    return quantity if bare else f"{quantity}_{standard_unit(quantity)}"


def canonical(title: str) -> Meaning | None:
    """Meaning of a column named as the file format prescribes; None for any other name."""
    if dimension_of(title):
        return Meaning(title, standard_unit(title) if file_title(title) == title else None)
    for units in UNITS.values():
        for unit in units:
            quantity = title.removesuffix(f"_{unit}") if unit else title
            if quantity != title and unit in UNITS.get(dimension_of(quantity), {}) and unit != "stamp":
                return Meaning(quantity, unit)
    return None


def begun(title: str) -> tuple[str, str] | None:
    """Split a title that begins with a known quantity and ends with an unknown unit: `payload_st`, `feed_ft_min`.

    Args:
        title: as in the file.

    Returns:
        The quantity and the rest; None for any other title, for one of a number or a text, and where a digit follows,
        for no unit has one (`temp_2`).
    """
    text = title.strip().lower()
    for place in (match.start() for match in re.finditer("_", text)):
        quantity, rest = text[:place], text[place + 1 :]
        if dimension_of(quantity) not in ("", "number", "text") and re.fullmatch(r"[^\W\d_][^\W\d]*", rest):
            return quantity, rest
    return None


def of_axis(meaning: Meaning) -> Meaning:
    """An axis in a unit of length is a slider, whatever its name: `Axis 1 [mm]` is `b1_cmd`, not an angle.

    Args:
        meaning: of a column.

    Returns:
        The meaning for a slider, or unchanged.
    """
    turns = re.fullmatch(r"q[1-9]\d*_(cmd|bare)", meaning.quantity)
    slides = turns and meaning.unit in UNITS["length"]
    return replace(meaning, quantity=f"b{meaning.quantity[1:]}") if slides else meaning


def to_standard(values: np.ndarray, quantity: str, unit: str) -> np.ndarray:
    """Values in the program's unit.

    Args:
        values: (n,) in `unit`.
        quantity: what they are.
        unit: a key of `UNITS[dimension_of(quantity)]`.

    Returns:
        (n,) in `standard_unit(quantity)`.
    """
    factor, offset = UNITS[dimension_of(quantity)][unit]
    return values if (factor, offset) == (1.0, 0.0) else values * factor + offset


def split_joint(quantity: str) -> tuple[str, int] | None:
    """`b2_cmd` -> ('b', 2); None for anything that is not a joint command."""
    match = re.fullmatch(r"([bq])([1-9]\d*)_cmd", quantity)
    return (match[1], int(match[2])) if match else None
