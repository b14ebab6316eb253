"""Dates: what a file's name holds, and days as a number; one rule for the fleet's store, the page and pictures."""

import math
import re
from contextlib import suppress
from datetime import date, datetime, timedelta

FIRST = date(1970, 1, 1)  # day zero, as matplotlib counts
DATED = re.compile(r"(?<!\d)((?:19|20)\d\d)([-_.]?)(\d\d)\2(\d\d)(?!\d)")


def date_in_name(name: str) -> date | None:
    """The first date in a name, year first, as in '2026-03-15', '20260315', '2026_03_15' or '2026.03.15'.

    Args:
        name: of a file.

    Returns:
        It; None where there is none.
    """
    for found in DATED.finditer(name):
        with suppress(ValueError):
            return date(int(found[1]), int(found[3]), int(found[4]))
    return None


def days_of(when: datetime) -> float:
    """Days since the first of January 1970, with the part of the day that has passed.

    Args:
        when: UTC without a zone, as dates are kept.
    """
    return (when - datetime(FIRST.year, FIRST.month, FIRST.day)) / timedelta(days=1)


def day_at(days: float) -> date:
    """The date on which so many days since 1970 have passed; any time of a day belongs to it."""
    return FIRST + timedelta(days=math.floor(days))
