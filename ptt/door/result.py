"""What every verb hands back: plain figures, text, a page for a notebook, a picture."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ptt.notebook import InNotebook
from ptt.record import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Note = Callable[[str], None]


class Result(InNotebook):
    """Base of all results.

    A result of a verb says what the verb says: `to_dict()` is what `--json` prints, `str()` what a person is shown.
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


def unheard(text: str) -> None:
    """Take a note where nobody listens."""


class Heard:
    """A listener that keeps what it is told, and passes it on.

    Attributes:
        lines: what it was told.
    """

    def __init__(self, note: Note) -> None:
        self.lines: list[str] = []
        self._note = note

    def __call__(self, text: str) -> None:
        """Take a note."""
        self.lines.append(text)
        self._note(text)
