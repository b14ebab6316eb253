"""Dates and times of day to seconds."""

import re
from datetime import datetime
from itertools import pairwise

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.readers.mapping import Ask, answer
from ptt.run.readers.separators import POINT_NUMBER, plain_number
from ptt.run.readers.text import RawText
from ptt.run.readers.words import MONTHS

_CLOCK = (
    r"(?P<hour>\d{1,2})[:h](?P<minute>[0-5]\d)(?:(?::|m|min)(?P<second>(?:[0-5]\d|60)(?:[.,]\d+)?)s?)?"
    r"\s*(?P<half>[AaPp][Mm])?"
)
_MONTH = "|".join(sorted(map(re.escape, MONTHS), key=len, reverse=True))  # the longest first: `mars` is not `mar`
_ZONE = r"(?P<zone>Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)"
_YEAR_FIRST = re.compile(
    rf"(?P<year>\d{{4}})[-/.年](?P<a>\d{{1,2}})[-/.月](?P<b>\d{{1,2}})日?[ T]*{_CLOCK}(?:\s*{_ZONE})?"
)
_YEAR_LAST = re.compile(rf"(?P<a>\d{{1,2}})[-/.](?P<b>\d{{1,2}})[-/.](?P<year>\d{{4}}|\d{{2}})[ T]+{_CLOCK}")
_YEAR = r"(?P<year>\d{4}|\d{2})"
_DAY_NAMED = re.compile(rf"(?P<a>\d{{1,2}})[-/. ]+(?P<month>{_MONTH})[-/., ]+{_YEAR}[ T,]+{_CLOCK}", re.IGNORECASE)
_NAMED_DAY = re.compile(rf"(?P<month>{_MONTH})[-/. ]+(?P<a>\d{{1,2}})[-/., ]+{_YEAR}[ T,]+{_CLOCK}", re.IGNORECASE)
_COMPACT = re.compile(
    r"(?P<year>(?:19|20)\d\d)(?P<a>\d\d)(?P<b>\d\d)(?P<hour>\d\d)(?P<minute>[0-5]\d)(?P<second>[0-5]\d(?:[.,]\d+)?)"
)
_TIME_ONLY = re.compile(_CLOCK)
_EXAMPLES = (
    "2026-11-27 11:40:03",
    "2026-11-27T11:40:03+01:00",
    "27.11.2026 11:40:03",
    "27-Nov-2026 11:40:03",
    "11:40:03",
    "11h40m03s",
)
_SHORTENED = re.compile(r"[12][.,]\d+[eE]\+?1[23]|20\d{6}0{6}")

DAY, HOUR = 86400.0, 3600.0  # s
STAMPED = "date and time, in seconds from the first row"
DAY_FIRST, MONTH_FIRST = "day-first", "month-first"


def read_seconds(
    cells: np.ndarray, raw: RawText, title: str, dates: str | None, ask: Ask | None
) -> tuple[np.ndarray | None, str, str | None]:
    """Seconds from cells that hold plain numbers, dates with a time of day, or a time of day.

    Args:
        cells: (n,) str; empty where unknown.
        raw: the lines of the file.
        title: of the column.
        dates: 'day-first', 'month-first' or None.
        ask: who answers when the order of day and month matters and cannot be seen.

    Returns:
        (n,) s, NaN where empty, from the first stamp on, plain numbers as they are, or None where the stamps are
        damaged; what was understood; the order of day and month where it was needed.

    Raises:
        TableError: a cell that is no time.
    """
    filled = [cell for cell in cells.tolist() if cell]
    if filled and all(_SHORTENED.fullmatch(cell) for cell in filled):
        return (
            None,
            "stamps lost their digits in a spreadsheet and are not used; the order of rows stands for time",
            None,
        )
    numbers = _plain_numbers(cells, raw, title)
    if numbers is not None:
        seconds, night = through_a_night(_checked_epoch(numbers, ask, raw.source, title))
        return seconds, f"plain numbers, taken as seconds{night}", None
    places = [_place(raw, row, title) for row in range(len(cells))]
    matches = [_match(cell, place) for cell, place in zip(cells.tolist(), places, strict=True)]
    _refuse_half_zoned(matches, places)
    dates = _order_of_day_and_month(matches, dates, ask, raw.source)
    told = zip(matches, places, strict=True)
    values = np.array([_seconds(match, dates == DAY_FIRST, place) for match, place in told], dtype=np.float64)
    values, note = _past_midnight(matches, values)
    first = values[~np.isnan(values)]
    return values - (first[0] if first.size else 0.0), f"{STAMPED}{note}", dates


def _place(raw: RawText, row: int, title: str) -> str:
    return f"{raw.source} row {raw.line[row]}, column {shown(title)}"


def _refuse_half_zoned(matches: list[re.Match[str] | None], places: list[str]) -> None:
    """Stamps with an offset from UTC and stamps without any are of two clocks."""
    zones = [match.groupdict().get("zone") if match else "" for match in matches]
    if any(map(_offset, zones)) and None in zones:
        what = "a time without an offset from UTC, although others have one"
        raise TableError(what, where=places[zones.index(None)], fix="write the offset in every row, or in none")


def _offset(zone: str | None) -> float:
    """How far a clock is ahead of UTC, s."""
    if not zone or zone[0] not in "+-":
        return 0.0
    hours, minutes = zone[1:3], zone[3:].lstrip(":") or "0"
    return float(f"{zone[0]}1") * (int(hours) * HOUR + int(minutes) * 60.0)


def _past_midnight(matches: list[re.Match[str] | None], values: np.ndarray) -> tuple[np.ndarray, str]:
    """Times of day without a date go on past midnight: a fall by more than half a day is a new day."""
    known = np.flatnonzero(~np.isnan(values))
    if any(match and match.re is not _TIME_ONLY for match in matches):
        return values, ""
    nights = np.cumsum(np.diff(values[known], prepend=values[known][:1]) < -DAY / 2.0)
    whole = values.copy()
    whole[known] += DAY * nights
    last = int(nights[-1]) if len(nights) else 0
    return whole, f", on past midnight {'once' if last == 1 else f'{last} times'}" if last else ""


def through_a_night(seconds: np.ndarray) -> tuple[np.ndarray, str]:
    """Seconds of the day that fall from its last hour to its first go on past midnight.

    A clock that is restarted falls from anywhere, and rows out of order more than once.

    Args:
        seconds: (n,), NaN where unknown.

    Returns:
        (n,) s, and a word where they do.
    """
    known = np.flatnonzero(~np.isnan(seconds))
    clock = seconds[known]
    falls = np.flatnonzero(np.diff(clock) < 0.0)
    if len(falls) != 1 or clock.min() < 0.0 or not clock[-1] < clock[0] < DAY:
        return seconds, ""
    (last,) = falls
    if not DAY - HOUR <= clock[last] < DAY or clock[last + 1] >= HOUR:
        return seconds, ""
    whole = seconds.copy()
    whole[known[last + 1 :]] += DAY
    return whole, " of the day, on past midnight"


def _plain_numbers(cells: np.ndarray, raw: RawText, title: str) -> np.ndarray | None:
    """Cells as plain numbers, NaN where empty; None where they begin with a stamp."""
    texts = cells.tolist()
    begins = next(filter(None, texts), "")
    if not begins:
        return np.full(len(cells), np.nan)
    if _COMPACT.fullmatch(begins) or not _is_plain(begins, raw):
        return None
    for row, text in enumerate(texts):
        if text and not _is_plain(text, raw):
            raise _no_time(text, _place(raw, row, title))
    return np.array([float(plain_number(text, raw.decimal, raw.thousands) or "nan") for text in texts])


def _is_plain(text: str, raw: RawText) -> bool:
    return POINT_NUMBER.fullmatch(plain_number(text, raw.decimal, raw.thousands) or "") is not None


def _checked_epoch(numbers: np.ndarray, ask: Ask | None, source: str, title: str) -> np.ndarray:
    if np.isinf(numbers).any() or np.nanmax(np.abs(numbers), initial=0.0) < 1e11:
        return numbers
    question = f"which unit is a time of {np.nanmax(numbers):.0f} in?"
    unit = answer(question, ("ms", "s"), ask, f"{source}, column {shown(title)}", f'[units] "{title}"')
    return numbers * 1e-3 if unit == "ms" else numbers


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a date with a time of day, or a time of day.

    Args:
        cell: its text.
    """
    return any(pattern.fullmatch(cell) for pattern in (_YEAR_FIRST, _YEAR_LAST, _DAY_NAMED, _NAMED_DAY, _TIME_ONLY))


def is_time_of_day(cell: str) -> bool:
    """Whether a cell holds a time of day and no date."""
    return _TIME_ONLY.fullmatch(cell) is not None


def is_dated_stamp(cell: str) -> bool:
    """Whether a cell holds a date with a time of day."""
    return is_stamp(cell) and not is_time_of_day(cell)


def is_date(cell: str) -> bool:
    """Whether a cell holds a date without a time of day."""
    return not is_stamp(cell) and is_dated_stamp(f"{cell} 00:00")


def _match(cell: str, where: str) -> re.Match[str] | None:
    if not cell:
        return None
    for pattern in (_YEAR_FIRST, _YEAR_LAST, _DAY_NAMED, _NAMED_DAY, _COMPACT, _TIME_ONLY):
        match = pattern.fullmatch(cell)
        if match and _is_of_day(match.groupdict()):
            return match
    raise _no_time(cell, where)


def _is_of_day(part: dict[str, str | None]) -> bool:
    """Whether the hour is one of a day, as it must be beside a date; a clock alone may count on."""
    most = 12 if part.get("half") else 24 if part.get("year") else 99
    return int(part["hour"] or 0) <= most


def _no_time(cell: str, where: str) -> TableError:
    fix = f"empty the cell, or write seconds or a time such as {', '.join(_EXAMPLES)}"
    return TableError(f"not a time ('{shown(cell)}')", where=where, fix=fix)


def _order_of_day_and_month(
    matches: list[re.Match[str] | None], dates: str | None, ask: Ask | None, where: str
) -> str | None:
    """Needed for 02/12/25; seen from a number above 12 or a run that goes on past midnight, else asked.

    Within one day it has no consequence.
    """
    days = [(int(m["a"]), int(m["b"]), m["year"]) for m in matches if m and m.re is _YEAR_LAST]
    if not days or dates:
        return dates
    if any(a > 12 for a, _, _ in days):
        return DAY_FIRST
    if any(b > 12 for _, b, _ in days):
        return MONTH_FIRST
    if len(set(days)) == 1:
        return DAY_FIRST if days[0][0] else None
    going = [order for order in (DAY_FIRST, MONTH_FIRST) if _goes_on(matches, order == DAY_FIRST, where)]
    if len(going) == 1:
        return going[0]
    example = next(day for day, other in pairwise(days) if day != other)
    question = f"is {example[0]:02d}/{example[1]:02d}/{example[2]} written day first or month first?"
    return answer(question, (DAY_FIRST, MONTH_FIRST), ask, where, "dates")


def _goes_on(matches: list[re.Match[str] | None], day_first: bool, where: str) -> bool:
    """Whether a run goes on through its nights: no stamp is earlier than the one before, or later by half a day."""
    values = np.array([_seconds(match, day_first, where) for match in matches if match])
    return bool(((np.diff(values) >= 0.0) & (np.diff(values) < DAY / 2.0)).all())


def _seconds(match: re.Match[str] | None, day_first: bool, where: str) -> float:
    if match is None:
        return np.nan
    part = match.groupdict()
    hour = int(part["hour"]) % 12 + 12 * (part["half"].lower() == "pm") if part.get("half") else int(part["hour"])
    clock = hour * 3600.0 + int(part["minute"]) * 60.0 + float((part["second"] or "0").replace(",", "."))
    clock -= _offset(part.get("zone"))
    if "year" not in part:
        return clock
    if part.get("month"):
        month, day = MONTHS[part["month"].lower()], int(part["a"])
    else:
        month, day = int(part["a"]), int(part["b"])
    if day_first and match.re is _YEAR_LAST:
        month, day = day, month
    year = int(part["year"]) + (2000 if len(part["year"]) == 2 else 0)
    try:
        return (datetime(year, month, day) - datetime(2000, 1, 1)).total_seconds() + clock
    except ValueError as error:
        what = f"not a date ('{match[0]}': {error})"
        raise TableError(what, where=where, fix="check the order of day and month") from None
