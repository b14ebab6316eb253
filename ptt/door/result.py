"""What every verb hands back: plain figures, text, a page for a notebook, a picture."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ptt.notebook import InNotebook
from ptt.record import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Note = Callable[[str], None]


class Result(InNotebook):
    """Base of the results of all verbs.

    `to_dict()` is what the command prints with `--json`, `str()` what it prints without.
    """

    def to_dict(self) -> dict[str, Any]:
        """The figures that the command prints with `--json`; what is not finite is None."""
        figures: dict[str, Any] = plain(self._figures())
        return figures

    def plot(self) -> "Figure":
        """Draw it.

        Returns:
            A matplotlib figure, which belongs to no window.
        """
        raise NotImplementedError

    def _figures(self) -> Mapping[str, Any]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return str(self)


def ignore_note(text: str) -> None:
    """Ignore a note."""


class NoteCollector:
    """Collects notes, and passes them on.

    Attributes:
        lines: the notes so far.
    """

    def __init__(self, note: Note) -> None:
        self.lines: list[str] = []
        self._note = note

    def __call__(self, text: str) -> None:
        """Take a note."""
        self.lines.append(text)
        self._note(text)
