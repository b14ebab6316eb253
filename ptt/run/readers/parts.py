"""Reading a long file in parts, all interpreted like the first: memory does not grow with the file."""

import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

from ptt.errors import TableError
from ptt.files import require_file
from ptt.run.readers.export import Export, Request, read_raw
from ptt.run.readers.mapping import Mapping
from ptt.run.readers.spatial_analyzer import is_spatial_analyzer
from ptt.run.readers.text import RawText, raw_text

LINES = 20_000  # of a part
_NO_TEXT = re.compile(r"[\x00-\x08]")


class NotInParts(Exception):
    """A file that can be interpreted only as a whole."""


def read_parts(path: str | Path, request: Request) -> Iterator[tuple[Export, Request]]:
    """Read a file some lines at a time.

    Args:
        path: a CSV in UTF-8.
        request: purpose, known answers and who to ask.

    Yields:
        The columns of some rows in order, and how they were asked for: what the first part told holds for all.

    Raises:
        NotInParts: another encoding, the blocks of SpatialAnalyzer, or time stamps, which count from the first.
        TableError: whatever cannot be read, with file, row and column.
    """
    require_file(path, TableError, float("inf"))
    if request.mapping.encoding not in (None, "utf-8", "utf-8-sig"):
        raise NotInParts
    with open(path, encoding="utf-8-sig") as file:
        yield from _parts(file, path, request)


def _parts(file: Iterator[str], path: str | Path, request: Request) -> Iterator[tuple[Export, Request]]:
    head, passed = list[str](), 0
    while lines := _some(file):
        if passed == 0:
            export = read_raw(_raw(lines, path, request), request)
            head, request = lines[: int(export.line[0]) - 1], replace(request, mapping=_settled(export), ask=None)
            yield export, request
        elif any(map(str.strip, lines)):
            raw = _raw([*head, *lines], path, request)
            yield read_raw(replace(raw, line=raw.line + (passed - len(head))), request), request
        passed += len(lines)


def _some(file: Iterator[str]) -> list[str]:
    try:
        return list(islice(file, LINES))
    except UnicodeDecodeError as error:
        raise NotInParts from error


def _raw(lines: list[str], path: str | Path, request: Request) -> RawText:
    text = "".join(lines)
    if _NO_TEXT.search(text):
        raise NotInParts
    with open(path, "rb") as file:
        encoding = "utf-8-sig" if file.read(3) == BOM_UTF8 else "utf-8"
    raw = raw_text(text, encoding, str(path), request.mapping, request.ask)
    if is_spatial_analyzer(raw):
        raise NotInParts
    return raw


def _settled(export: Export) -> Mapping:
    mapping = export.understood.mapping
    if "stamp" in mapping.units.values():
        raise NotInParts
    return mapping
