"""Merging the column mappings of several files into one, for a session that reads runs together."""

from collections.abc import Mapping as Dictionary
from collections.abc import Sequence

from ptt.run.readers import Mapping


def merge_mappings(mappings: Sequence[Mapping]) -> Mapping:
    """Merge mappings; entries in which they differ are left out, so that each file is read by itself in these.

    Args:
        mappings: one for each file.

    Returns:
        One for all of them.
    """
    targets = [each.targets for each in mappings if each.targets is not None]
    return Mapping(
        encoding=_one([each.encoding for each in mappings]),
        delimiter=_one([each.delimiter for each in mappings]),
        decimal=_one([each.decimal for each in mappings]),
        dates=_one([each.dates for each in mappings]),
        pairing=_one([each.pairing for each in mappings]),
        columns=_each([each.columns for each in mappings]),
        units=_each([each.units for each in mappings]),
        targets=merge_mappings(targets) if targets else None,
    )


def _one(values: Sequence[str | None]) -> str | None:
    """The value that all who have one share; None where they differ or none has one."""
    said = {value for value in values if value is not None}
    return said.pop() if len(said) == 1 else None


def _each(tables: Sequence[Dictionary[str, str]]) -> dict[str, str]:
    """Title -> the value that all tables which have the title share."""
    titles = dict.fromkeys(title for table in tables for title in table)
    found = {title: _one([table.get(title) for table in tables]) for title in titles}
    return {title: value for title, value in found.items() if value is not None}
