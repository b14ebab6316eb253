"""HTML tables with escaped cells."""

from collections.abc import Iterable, Sequence
from html import escape

from ptt.show.card.words import together


def table_html(head: Sequence[str], rows: Iterable[Sequence[str]], words: int = 1, caption: str = "") -> str:
    """A table as HTML.

    Args:
        head: titles of the columns; empty for a list of facts, whose first column then holds the titles.
        rows: cells.
        words: number of leading columns that hold words.
        caption: caption for screen readers.

    Returns:
        HTML.
    """

    def wordy(column: int) -> str:
        return ' class="w"' if column < words else ""

    top = "".join(f'<th scope="col"{wordy(i)}>{escape(title)}</th>' for i, title in enumerate(head))
    body = "".join(
        "<tr>"
        + "".join(
            f'<th scope="row" class="w">{escape(together(str(cell)))}</th>'
            if not head and i == 0
            else f"<td{wordy(i)}>{escape(together(str(cell)))}</td>"
            for i, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    said = f"<caption class='sr-only'>{escape(caption)}</caption>" if caption else ""
    return (
        f"<table class='st-plain'>{said}{f'<thead><tr>{top}</tr></thead>' if head else ''}<tbody>{body}</tbody></table>"
    )
