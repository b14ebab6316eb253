"""From the text of a file to rows of cells: comment lines, preamble, titles, line numbers."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ptt.errors import TableError
from ptt.files import read_bytes
from ptt.run.readers.columns import canonical
from ptt.run.readers.encoding import decode
from ptt.run.readers.mapping import Ask, Mapping
from ptt.run.readers.separators import find_decimal, find_delimiter, find_thousands, is_number, split_line
from ptt.run.readers.titles import meaning_of

COMMENT_MARKS = ("#", "//", "%")

LONGEST = 100_000  # characters of a line: a row of a thousand columns of a hundred characters
SAMPLE = 400  # lines from the start, and as many of the rest, from which signs and delimiter are inferred
PREAMBLE = 12  # lines that an export may have above its titles
_EXCEL_HINT = re.compile(r"sep=.\s*")
_ASIDE = {mark[0] for mark in (*COMMENT_MARKS, "sep=")}


@dataclass(frozen=True)
class RawText:
    """A file as lines, not yet parsed into numbers.

    Attributes:
        source: file name for messages.
        encoding: codec it was read with.
        delimiter: character between cells; ' ' is any run of blanks.
        decimal: '.' or ','.
        comments: comment lines without their marks.
        header: cells of the title row, or None where the file has none.
        body: data lines.
        line: (n,) int, line numbers of `body` in the file, the first line is 1.
        thousands: sign that groups thousands, '' where none does.
    """

    source: str
    encoding: str
    delimiter: str
    decimal: str
    comments: tuple[str, ...]
    header: tuple[str, ...] | None
    body: list[str]
    line: np.ndarray
    thousands: str = ""

    def part(self, first: int, stop: int) -> "RawText":
        """A part of the data lines, with their numbers."""
        return replace(self, body=self.body[first:stop], line=self.line[first:stop])


def read_text(path: str | Path, mapping: Mapping, ask: Ask | None = None) -> RawText:
    """Read a file and infer its encoding, delimiter and decimal sign.

    Args:
        path: the file.
        mapping: answers that need no finding out.
        ask: who answers where two readings are possible.

    Returns:
        The lines with what was found out.

    Raises:
        TableError: no file, no text, empty, only a header, or ambiguous with nobody to ask.
    """
    source = str(path)
    return raw_text(*decode(read_bytes(path, TableError), source, mapping, ask), source, mapping, ask)


def raw_text(text: str, encoding: str, source: str, mapping: Mapping, ask: Ask | None = None) -> RawText:
    """Infer delimiter, decimal sign, preamble and titles of a text.

    Args:
        text: what is in a file.
        encoding: codec it was read with.
        source: the file's name.
        mapping: answers that need no finding out.
        ask: who answers where two readings are possible.

    Returns:
        The lines with what was found out.

    Raises:
        TableError: empty, only a header, or ambiguous with nobody to ask.
    """
    comments, body, line = _cut_lines(text)
    if not body:
        raise TableError("the file is empty", where=source, fix="export it again; a header and two rows are the least")
    _refuse_long(body, line, source)
    delimiter = _given_delimiter(mapping) or find_delimiter(_sample(body))
    above = _preamble(body, delimiter)
    comments, body, line = (*comments, *body[:above]), body[above:], line[above:]
    _refuse_quotes(body, line, delimiter, source)
    first = split_line(body[0], delimiter)
    known = sum(canonical(cell) is not None for cell in first)
    header = tuple(first) if known > 2 or not any(is_number(cell, delimiter) for cell in first) else None
    if header:
        body, line = body[1:], line[1:]
    if not body:
        raise TableError("only a header, no rows", where=source, fix="export it again with its readings")
    thousands, grouped = find_thousands(_sample(body), delimiter)
    if thousands not in ",.":
        joint = re.compile(rf"(?<=\d){thousands}(?=\d{{3}}(?!\d))")
        body, thousands = [joint.sub("", text) for text in body], ""
    decimal = mapping.decimal or grouped or find_decimal(_sample(body), delimiter, source, ask)
    thousands = "" if thousands == decimal else thousands
    return RawText(source, encoding, delimiter, decimal, comments, header, body, line, thousands)


def _refuse_long(body: Sequence[str], line: np.ndarray, source: str) -> None:
    """Bound the length of a line, so that searches in it take bounded time."""
    for text, number in zip(body, line, strict=True):
        if len(text) > LONGEST:
            what = f"a line of {len(text)} characters, more than {LONGEST}"
            raise TableError(what, where=f"{source} row {number}", fix="is this the right file? Export it again")


def _refuse_quotes(body: Sequence[str], line: np.ndarray, delimiter: str, source: str) -> None:
    """A quote that is not closed would swallow the rows after it."""
    for text, number in zip(body, line, strict=True):
        if '"' in text:
            try:
                next(csv.reader([text], delimiter=delimiter, skipinitialspace=True, strict=True))
            except csv.Error:
                what = "a quote is opened and not closed before the cell ends"
                raise TableError(what, where=f"{source} row {number}", fix="close or remove it") from None


def _preamble(body: Sequence[str], delimiter: str) -> int:
    """Number of lines above the row of titles, such as project, date and operator."""
    for place, line in enumerate(body[: PREAMBLE + 1]):
        cells = split_line(line, delimiter)
        if sum(is_number(cell, delimiter) for cell in cells) > 2:
            return 0
        if sum(meaning_of(cell) is not None for cell in cells) > 2:
            return place
    return 0


def _cut_lines(text: str) -> tuple[tuple[str, ...], list[str], np.ndarray]:
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    kept, comments = [], []
    for index, line in enumerate(lines):
        stripped = line.lstrip()
        if not stripped:
            continue
        if stripped[0] in _ASIDE and (stripped.startswith(COMMENT_MARKS) or _EXCEL_HINT.fullmatch(line)):
            comments.append(stripped.lstrip("#/%").strip())
        else:
            kept.append(index)
    return tuple(comments), [lines[index] for index in kept], np.asarray(kept, dtype=np.int64) + 1


def _sample(body: Sequence[str]) -> list[str]:
    return [*body[:SAMPLE], *body[SAMPLE :: max(1, len(body) // SAMPLE)]]


def _given_delimiter(mapping: Mapping) -> str | None:
    return " " if mapping.delimiter == "space" else mapping.delimiter
