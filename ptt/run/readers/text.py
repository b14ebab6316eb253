"""From the bytes of a file to rows of cells: encoding, comment lines, delimiter, decimal sign, line numbers."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ptt.errors import TableError
from ptt.files import read_bytes
from ptt.run.readers.columns import canonical
from ptt.run.readers.mapping import Ask, Mapping, answer
from ptt.run.readers.titles import meaning_of

COMMENT_MARKS = ("#", "//", "%")
DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "space"}

POINT_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_GROUPED = {
    ",": re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+\.\d+"),
    ".": re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+,\d+"),
    "'": re.compile(r"[+-]?[1-9]\d{0,2}('\d{3})+([.,]\d+)?"),
    "\u2019": re.compile(r"[+-]?[1-9]\d{0,2}(\u2019\d{3})+([.,]\d+)?"),
    "\u00a0": re.compile(r"[+-]?[1-9]\d{0,2}(\u00a0\d{3})+([.,]\d+)?"),
    "\u202f": re.compile(r"[+-]?[1-9]\d{0,2}(\u202f\d{3})+([.,]\d+)?"),
}
LONGEST = 100_000  # characters of a line: a row of a thousand columns of a hundred characters
COLUMNS = 3  # the fewest that a file of positions has
PREAMBLE = 12  # lines that an export may have above its titles
_EXCEL_HINT = re.compile(r"sep=.\s*")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class RawText:
    """A file cut into lines, not yet into numbers.

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
        """Some of its data lines, with their numbers."""
        return replace(self, body=self.body[first:stop], line=self.line[first:stop])


def read_text(path: str | Path, mapping: Mapping, ask: Ask | None = None) -> RawText:
    """Read a file and find out how it is written.

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
    """Find out how a text is written.

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
    return RawText(source, encoding, delimiter, decimal, comments, header, body, line, thousands)


def _refuse_long(body: Sequence[str], line: np.ndarray, source: str) -> None:
    """Bound the length of a line, so that what is looked for in it takes a bounded time."""
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
    """How many lines of text stand above the row of titles: a project, a date, an operator."""
    for place, line in enumerate(body[: PREAMBLE + 1]):
        cells = split_line(line, delimiter)
        if sum(is_number(cell, delimiter) for cell in cells) > 2:
            return 0
        if sum(meaning_of(cell) is not None for cell in cells) > 2:
            return place
    return 0


def find_thousands(lines: Sequence[str], delimiter: str) -> tuple[str, str]:
    """Sign that groups thousands and, where the same numbers tell it, the decimal sign; '' for what is not known."""
    cells = [cell for line in lines for cell in split_line(line, delimiter)]
    for sign, pattern in _GROUPED.items():
        found = [cell for cell in cells if pattern.fullmatch(cell)]
        if found:
            tail = found[0].rsplit(sign, 1)[1]
            return sign, next((mark for mark in ".," if mark != sign and mark in tail), "")
    return "", ""


def decode(data: bytes, source: str, mapping: Mapping, ask: Ask | None) -> tuple[str, str]:
    """Text of a file and the codec it was read with."""
    if data.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise TableError("an Excel workbook, not text", where=source, fix="save the sheet as CSV")
    encoding = mapping.encoding or find_encoding(data, source, ask)
    try:
        text = data.decode(encoding).removeprefix("\ufeff")
    except (UnicodeDecodeError, LookupError) as error:
        what = f"not text in '{encoding}' ({error})"
        raise TableError(what, where=source, fix="say the encoding with --map FILE.toml") from None
    if re.search(r"[\x00-\x08]", text):
        raise TableError("not a text file", where=source, fix="export the readings as CSV or text")
    return text, encoding


def find_encoding(data: bytes, source: str, ask: Ask | None) -> str:
    """Codec of a file: byte-order mark, zero bytes of UTF-16, valid UTF-8, else GBK or Western by their byte pairs."""
    if data.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in data[:4000]:
        zeros = [data[offset:4000:2].count(0) for offset in (0, 1)]
        return "utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"
    try:
        data.decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        return _legacy_encoding(data, source, ask)


def _legacy_encoding(data: bytes, source: str, ask: Ask | None) -> str:
    """GBK writes high bytes in pairs; Western text has single ones, as in the degree sign or an umlaut."""
    odd = [len(run) % 2 == 1 for run in re.findall(rb"[\x80-\xff]+", data)]
    if not any(odd) and _decodes(data, "gb18030"):
        return "gb18030"
    if all(odd) and _decodes(data, "cp1252"):
        return "cp1252"
    return answer("which encoding is it?", ("gb18030", "cp1252", "utf-8"), ask, source, "encoding")


def _decodes(data: bytes, encoding: str) -> bool:
    try:
        data.decode(encoding)
    except UnicodeDecodeError:
        return False
    return True


def _cut_lines(text: str) -> tuple[tuple[str, ...], list[str], np.ndarray]:
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    kept, comments = [], []
    for index, line in enumerate(lines):
        stripped = line.lstrip()
        if stripped.startswith(COMMENT_MARKS) or _EXCEL_HINT.fullmatch(line):
            comments.append(stripped.lstrip("#/%").strip())
        elif stripped:
            kept.append(index)
    return tuple(comments), [lines[index] for index in kept], np.asarray(kept, dtype=np.int64) + 1


def _sample(body: Sequence[str], size: int = 400) -> list[str]:
    return [*body[:size], *body[size :: max(1, len(body) // size)]]


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of one line, stripped, quotes removed."""
    if '"' in line:
        line = line.strip() if delimiter == " " else line
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
        return [cell.strip() for cell in cells]
    cells = re.split("[ \t]+", line.strip(" \t")) if delimiter == " " else line.split(delimiter)
    return [cell.strip() for cell in cells]


def is_number(cell: str, delimiter: str) -> bool:
    """Whether a cell reads as a number, with a decimal comma too where commas do not separate cells."""
    if POINT_NUMBER.fullmatch(cell) or (delimiter != "," and _COMMA_NUMBER.fullmatch(cell)):
        return True
    return any(pattern.fullmatch(cell) for pattern in _GROUPED.values())


def find_delimiter(lines: Sequence[str]) -> str:
    """The delimiter under which the most cells read as numbers; among equals the one that cuts most cells."""

    def score(delimiter: str) -> tuple[int, int]:
        rows = [split_line(line, delimiter) for line in lines]
        return sum(is_number(cell, delimiter) for row in rows for cell in row), len(rows[0])

    best = max(DELIMITERS, key=score)
    return "\t" if best == " " and _blanks_are_text(lines) else best


def _blanks_are_text(lines: Sequence[str]) -> bool:
    """Whether tabs alone cut the lines into columns, so that a blank, as in 'run 1', belongs to its cell."""
    shares = []
    for delimiter in ("\t", " "):
        widths = [len(split_line(line, delimiter)) for line in lines]
        usual = max(set(widths), key=widths.count)
        shares.append(widths.count(usual))
        if delimiter == "\t" and usual < COLUMNS:
            return False
    first = split_line(next(line for line in lines if "\t" in line), "\t")
    return shares[0] > shares[1] or (shares[0] == shares[1] and all(first))


def find_decimal(lines: Sequence[str], delimiter: str, source: str, ask: Ask | None) -> str:
    """Decimal sign of the numbers; asked where commas may as well group thousands or both signs occur."""
    if delimiter == ",":
        return "."
    cells = [cell for line in lines for cell in split_line(line, delimiter)]
    comma = [cell for cell in cells if _COMMA_NUMBER.fullmatch(cell)]
    point = [cell for cell in cells if "." in cell and POINT_NUMBER.fullmatch(cell)]
    if not comma:
        return "."
    if point:
        question = f"which is the decimal sign? There are numbers such as {comma[0]} and {point[0]}"
        return answer(question, (",", "."), ask, source, "decimal")
    if all(_THOUSANDS.fullmatch(cell) for cell in comma):
        question = f"is the comma in {comma[0]} a decimal sign?"
        return answer(question, (",", "."), ask, source, "decimal")
    return ","


def _given_delimiter(mapping: Mapping) -> str | None:
    return " " if mapping.delimiter == "space" else mapping.delimiter


def cell_counts(body: Sequence[str], delimiter: str) -> np.ndarray:
    """(n,) number of cells of each line."""
    if delimiter == " ":
        return np.fromiter((len(split_line(line, delimiter)) for line in body), dtype=np.int64, count=len(body))
    counts = np.fromiter((line.count(delimiter) for line in body), dtype=np.int64, count=len(body)) + 1
    for index in [i for i, line in enumerate(body) if '"' in line]:
        counts[index] = len(split_line(body[index], delimiter))
    return counts
