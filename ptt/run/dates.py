"""The date that a file's name holds: one rule for the fleet's store, the page and whoever else sorts runs by it."""

import re
from contextlib import suppress
from datetime import date

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
