"""Titles of a file's columns, wherever they stand: above the rows, in a comment, with a row of units below."""

import re
from dataclasses import replace

from ptt.errors import TableError, shown
from ptt.run.readers.columns import Meaning, canonical, dimension_of
from ptt.run.readers.layout import meanings_by_order, meanings_of_titles
from ptt.run.readers.separators import cell_counts, split_line
from ptt.run.readers.text import RawText
from ptt.run.readers.titles import LONGEST_TITLE, UNIT_OF_WORD, is_unit_row, meaning_of, normalise, stated_unit

MOST_TITLES = 2_000  # bounds the time that parsing of titles takes


def titles_of(raw: RawText) -> tuple[RawText, tuple[str, ...], list[Meaning | None]]:
    """Lines without their titles, the titles, and what each says by itself; nothing is settled."""
    if raw.header is None:
        raw = _header_in_comments(raw)
    _refuse_long_titles(raw)
    if raw.header is None:
        meanings = meanings_by_order(raw)
        meanings = [_with_comment_unit(meaning, raw) for meaning in meanings]
        return raw, tuple(map(untitled, range(len(meanings)))), meanings
    titles, raw = raw.header, _without_trailing_delimiter(raw, len(raw.header))
    cells = split_line(raw.body[0], raw.delimiter)
    if len(cells) == len(titles) and is_unit_row(cells):
        titles = tuple(_with_unit(title, cell, raw) for title, cell in zip(titles, cells, strict=True))
        raw = replace(raw, body=raw.body[1:], line=raw.line[1:])
    if not raw.body:
        raise TableError("only a header, no rows", where=raw.source, fix="export it again with its readings")
    meanings = meanings_of_titles(titles, raw.source)
    return raw, tuple(title or untitled(index) for index, title in enumerate(titles)), meanings


def untitled(index: int) -> str:
    """What a column without a title is called, by its place from 0."""
    return f"column {index + 1}"


def _with_unit(title: str, cell: str, raw: RawText) -> str:
    """A title with the unit below it; a title of the program's own, such as time_s, has it already."""
    if cell in ("", "-"):
        return title
    word = normalise(cell).strip("[]() ")
    if word not in UNIT_OF_WORD and _is_aside(title, word):
        return title
    known, unit, own = canonical(title), UNIT_OF_WORD.get(word, f"({word})"), _own_unit(title)
    if unit == own or (known and unit == known.unit):
        return title
    if own is not None:
        where = f"{raw.source} row {raw.line[0]}, column {shown(title)}"
        raise TableError(f"the row of units says '{shown(cell)}'", where=where, fix="correct the title or the unit")
    return f"{title} [{cell.strip('[]()')}]"


def _is_aside(title: str, word: str) -> bool:
    """Whether a word in the row of units is none: above texts, and `dd.mm.yyyy hh:mm` above stamps."""
    meaning = meaning_of(title)
    is_stamp = meaning and meaning.quantity == "time" and re.fullmatch(r"[a-z]{1,4}([-./:, ]+[a-z]{1,4})+", word)
    return meaning is None or dimension_of(meaning.quantity) == "text" or bool(is_stamp)


def _own_unit(title: str) -> str | None:
    """The unit that a title states; brackets behind words that mean nothing may hold any word."""
    unit = stated_unit(title)
    return None if unit and unit.startswith("(") and meaning_of(title) is None else unit


def _refuse_long_titles(raw: RawText) -> None:
    """Titles are taken apart into words: their length and number are bounded."""
    titles = raw.header or ()
    if len(titles) > MOST_TITLES:
        raise TableError(
            f"{len(titles)} columns", where=raw.source, fix=f"keep those that matter, at most {MOST_TITLES}"
        )
    for index, title in enumerate(titles):
        if len(title) > LONGEST_TITLE:
            where = f"{raw.source}, title of column {index + 1}"
            raise TableError(f"{len(title)} characters ('{shown(title)}')", where=where, fix="shorten it")


def _without_trailing_delimiter(raw: RawText, width: int) -> RawText:
    """Some software ends every row, but not the titles, on a delimiter."""
    mark = raw.delimiter
    if mark == " " or not all(line.endswith(mark) for line in raw.body) or (cell_counts(raw.body, mark) == width).any():
        return raw
    return replace(raw, body=[line[:-1] for line in raw.body])


def _header_in_comments(raw: RawText) -> RawText:
    """Titles from the last comment above the data that has as many words as rows have cells and names x, y and z."""
    width = len(split_line(raw.body[0], raw.delimiter))
    for place, comment in reversed(list(enumerate(raw.comments))):
        cells = tuple(split_line(comment, raw.delimiter))
        found = {meaning.quantity[0] for meaning in map(meaning_of, cells) if meaning}
        if len(cells) == width and {"x", "y", "z"} <= found:
            return replace(raw, header=cells, comments=raw.comments[:place] + raw.comments[place + 1 :])
    return raw


def _with_comment_unit(meaning: Meaning | None, raw: RawText) -> Meaning | None:
    """A comment such as `units: mm` says the unit of a file without titles."""
    if meaning is None or meaning.quantity not in ("x", "y", "z"):
        return meaning
    for comment in raw.comments:
        words = normalise(comment).replace("=", " ").replace(":", " ").split()
        if len(words) == 2 and words[0] in ("unit", "units", "单位"):
            return Meaning(meaning.quantity, UNIT_OF_WORD.get(words[1], f"({words[1]})"))
    return meaning
