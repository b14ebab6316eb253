"""What a page is made of: sections of words, tables, pictures and commands, all plain text until they are rendered."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Words:
    """A paragraph; 'lack' says why something is not there, 'note' is small print, 'verdict' stands out."""

    text: str
    look: Literal["plain", "lack", "note", "verdict"] = "plain"
    kind: str = "words"


@dataclass(frozen=True)
class Grid:
    """A table.

    Attributes:
        title: what it shows, with units.
        head: titles of the columns.
        rows: cells.
        left: leading columns that hold words.
        wordy: last column holds words too.
        strong: index of rows that stand out.
        code: last column is set in letters of one width.
        kind: which template draws it; so of every block.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1
    wordy: bool = False
    strong: frozenset[int] = frozenset()
    code: bool = False
    kind: str = "grid"

    @property
    def whole(self) -> bool:
        """Whether the table fits on a page with room to spare and is kept in one piece."""
        return len(self.rows) <= 12


@dataclass(frozen=True)
class Picture:
    """A picture by its name, and the words under it."""

    name: str
    words: str
    kind: str = "picture"


@dataclass(frozen=True)
class Lines:
    """A list: of findings, or of commands to be typed."""

    items: tuple[str, ...]
    code: bool = False
    kind: str = "lines"


Block = Words | Grid | Picture | Lines


@dataclass(frozen=True)
class Section:
    """A part of the report.

    Attributes:
        key: for links.
        title: its heading.
        blocks: what is in it.
    """

    key: str
    title: str
    blocks: tuple[Block, ...]


def grid(title: str, head: Sequence[str], rows: Iterable[Sequence[str]], **look: object) -> Grid:
    """A table from any sequences.

    Args:
        title: what it shows, with units.
        head: titles of the columns.
        rows: cells.
        **look: further fields of `Grid`.

    Returns:
        The table.
    """
    return Grid(title, tuple(head), tuple(tuple(row) for row in rows), **look)  # type: ignore[arg-type]


def side_by_side(rows: Sequence[tuple[str, str, str]]) -> list[tuple[str, ...]]:
    """Rows of three cells as rows of six, down the left half first.

    Args:
        rows: any number of them.

    Returns:
        Half as many; the last one filled up with empty cells.
    """
    half = -(-len(rows) // 2)
    right = [*rows[half:], ("", "", "")][:half]
    return [(*one, *other) for one, other in zip(rows[:half], right, strict=True)]
