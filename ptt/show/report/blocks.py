"""Building blocks of a page: sections of paragraphs, tables, pictures and lists, as plain text until rendered."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Words:
    """A paragraph; its look is 'lack' (why something is missing), 'note' (small print) or 'verdict' (emphasised)."""

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
        left: number of leading columns that hold words and are aligned left.
        wordy: whether the last column holds words too.
        strong: indices of rows that are emphasised.
        code: whether the last column is set in a monospaced font.
        kind: name of the template that renders it, as of every block.
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
        """Whether the table is short enough to be kept on one page in print."""
        return len(self.rows) <= 12


@dataclass(frozen=True)
class Picture:
    """A picture, by its name in `ptt.show.report.pictures`, and its caption."""

    name: str
    words: str
    kind: str = "picture"


@dataclass(frozen=True)
class Lines:
    """A list of findings, or of commands (`code`)."""

    items: tuple[str, ...]
    code: bool = False
    kind: str = "lines"


Block = Words | Grid | Picture | Lines


@dataclass(frozen=True)
class Section:
    """A part of the report.

    Attributes:
        key: its anchor for links.
        title: its heading.
        blocks: its contents in order.
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
    """Rows of three cells in two columns: rows of six cells, of which the left half is read first.

    Args:
        rows: any number of them.

    Returns:
        Half as many, the last one filled up with empty cells.
    """
    half = -(-len(rows) // 2)
    right = [*rows[half:], ("", "", "")][:half]
    return [(*one, *other) for one, other in zip(rows[:half], right, strict=True)]
