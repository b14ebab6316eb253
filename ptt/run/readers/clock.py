"""The clock of a file with the date in a column of its own, or with spreadsheet day numbers."""

import re
from collections.abc import Mapping as Dictionary

import numpy as np

from ptt.run.readers.columns import Column, split_joint
from ptt.run.readers.mapping import Mapping
from ptt.run.readers.stamps import is_date, is_dated_stamp, is_time_of_day
from ptt.run.readers.titles import normalise
from ptt.run.readers.words import DATES, TIMES

FIRST_DAY, LAST_DAY = 36_500.0, 73_000.0  # of a spreadsheet: the end of 1999 and of 2099
FASTEST = {"mm": 5e3, "rad": 1e2}  # mm/s, rad/s: no machine is faster from reading to reading with stops at both
AND = ("and", "und", "et", "of")


def names_a_date(title: str) -> bool:
    """Whether a title says `Date` or `Datum`, with or without a time of day, and nothing else."""
    words = [word for word in re.findall(r"[^\W\d_]+", normalise(title)) if word not in AND]
    return any(word in DATES for word in words) and all(word in (*DATES, *TIMES) for word in words)


def with_date_for_time(
    columns: list[Column], cells: dict[int, np.ndarray], mapping: Mapping, decimal: str
) -> tuple[list[Column], Column | None]:
    """The columns with a date as the clock, where there is no other and it has the time of day.

    Args:
        columns: what each holds.
        cells: column index -> (n,) str of those that are not read.
        mapping: known answers; what it names stays as it says.
        decimal: sign.

    Returns:
        The columns; and the column with the dates of the clock's times of day, None where there is none.
    """
    dates = [column for column in columns if not column.quantity and names_a_date(column.title)]
    dates = [column for column in dates if column.title not in mapping.columns]
    clock = next((column for column in columns if column.quantity == "time"), None)
    if clock is None:
        found = [column.index for column in dates if _is_clock(cells[column.index], decimal)]
        if len(found) != 1:
            return columns, None
        named = [
            Column(column.index, column.title, "time", "stamp") if column.index in found else column
            for column in columns
        ]
        return named, None
    if clock.unit != "stamp" or len(dates) != 1:
        return columns, None
    days, times = cells[dates[0].index].tolist(), cells[clock.index].tolist()
    apart = all(is_date(day) and is_time_of_day(time) for day, time in zip(days, times, strict=True) if time)
    return columns, dates[0] if apart and any(times) else None


def joined(days: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Days and times of day as stamps, (n,) str; empty where there is no time."""
    return np.array([f"{day} {time}" if time else "" for day, time in zip(days.tolist(), times.tolist(), strict=True)])


def goes_back(seconds: np.ndarray | None) -> bool:
    """Whether a clock, (n,) s or None, is earlier in some row than in the one before."""
    return seconds is not None and bool((np.diff(seconds[~np.isnan(seconds)]) < 0.0).any())


def counts_days(title: str, seconds: np.ndarray, columns: Dictionary[str, np.ndarray]) -> bool:
    """Whether a column of plain numbers counts days as a spreadsheet does: 46298.986 is 3 October 2026, 23:40.

    Args:
        title: of the column.
        seconds: (n,) its numbers, NaN where unknown.
        columns: quantity -> (n,) of the other columns.

    Returns:
        Whether they are day numbers, by the title or because the machine would be impossibly fast if they were seconds.
    """
    known = seconds[~np.isnan(seconds)]
    if not known.size or known.min() < FIRST_DAY or known.max() > LAST_DAY or not (known % 1.0).any():
        return False
    return names_a_date(title) or _is_too_fast(seconds, columns)


def _is_clock(cells: np.ndarray, decimal: str) -> bool:
    filled = [cell for cell in cells.tolist() if cell]
    if not filled:
        return False
    if all(map(is_dated_stamp, filled)):
        return True
    try:
        days = np.array([float(cell.replace(decimal, ".")) for cell in filled])
    except ValueError:
        return False
    return bool(((days >= FIRST_DAY) & (days <= LAST_DAY)).all() and (days % 1.0).any())


def _is_too_fast(seconds: np.ndarray, columns: Dictionary[str, np.ndarray]) -> bool:
    """Whether the machine would be faster than any, from one reading to the next."""
    sets = ([f"{axis}_{role}" for axis in "xyz"] for role in ("meas", "cmd"))
    joints = sorted(name for name in columns if split_joint(name))
    names = next((names for names in (*sets, joints) if names and all(name in columns for name in names)), None)
    if names is None:
        return False
    place = np.column_stack([columns[name] for name in names])
    rows = np.isfinite(place).all(axis=1) & np.isfinite(seconds)
    way, step = np.linalg.norm(np.diff(place[rows], axis=0), axis=1), np.diff(seconds[rows])
    moved = (way > 0.0) & (step > 0.0)
    fastest = FASTEST["rad" if names[0].startswith("q") else "mm"]
    return bool(moved.any() and np.median(way[moved] / step[moved]) > fastest)
