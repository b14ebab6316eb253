"""Delimiter, decimal sign and thousands separator: inference from sample lines."""

import csv
import re
from collections.abc import Sequence

import numpy as np

from ptt.run.readers.mapping import Ask, answer

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
COLUMNS = 3  # the fewest that a file of positions has
_POINT_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


def find_thousands(lines: Sequence[str], delimiter: str) -> tuple[str, str]:
    """Thousands separator and, where the same numbers show it, the decimal sign; '' for what is not known."""
    cells = [cell for line in lines for cell in split_line(line, delimiter)]
    for sign, pattern in _GROUPED.items():
        found = [cell for cell in cells if pattern.fullmatch(cell)]
        if found:
            tail = found[0].rsplit(sign, 1)[1]
            return sign, next((mark for mark in ".," if mark != sign and mark in tail), "")
    return "", ""


def plain_number(cell: str, decimal: str, thousands: str) -> str | None:
    """A number with a decimal point and its thousands not grouped.

    Args:
        cell: as written.
        decimal: sign.
        thousands: sign that groups thousands in the file, '' for none.

    Returns:
        The number, if it is one; None where that sign does anything else: 12.5 beside 1.234,56 is not 125; and where a
        point beside decimal commas may group thousands: 1.234.
    """
    if decimal == "," and not thousands and _POINT_GROUPS.fullmatch(cell):
        return None
    if thousands and thousands in cell:
        if not re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}([{thousands}]\d{{3}})+([{decimal}]\d+)?", cell, re.ASCII):
            return None
        cell = cell.replace(thousands, "")
    return cell.replace(decimal, ".")


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
    """The delimiter with which most cells are numbers; among equals the one with most cells."""

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


def cell_counts(body: Sequence[str], delimiter: str) -> np.ndarray:
    """(n,) number of cells of each line."""
    if delimiter == " ":
        return np.fromiter((len(split_line(line, delimiter)) for line in body), dtype=np.int64, count=len(body))
    counts = np.fromiter((line.count(delimiter) for line in body), dtype=np.int64, count=len(body)) + 1
    for index in [i for i, line in enumerate(body) if '"' in line]:
        counts[index] = len(split_line(body[index], delimiter))
    return counts
