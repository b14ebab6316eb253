"""The queue of what a page has to draw: views that are not shown are drawn while the page is idle."""

import time
from collections.abc import Callable

from nicegui import Client, ui

BEHIND = ""  # stands for the view of what is never shown at once, such as closed dialogs
REST = 0.6  # s after a change in which nothing is drawn in the background, so that the person's next step comes first
PAUSE = 0.2  # s between two background drawings, so that the browser can react to the person


class DrawQueue:
    """Drawing requests of views: of the one that is shown done at once, of the others while the page is idle."""

    def __init__(self, client: Client, shown: Callable[[], str], idle: Callable[[], bool]) -> None:
        """Begin with an empty queue.

        Args:
            client: of the page.
            shown: gives the name of the view that is shown.
            idle: tells whether no job of the person is running.
        """
        self._client, self._shown, self._idle = client, shown, idle
        self._due: dict[Callable[[], None], str] = {}
        self._from = 0.0
        self._clock: ui.timer | None = None

    def request(self, view: str, draw: Callable[[], None]) -> None:
        """Draw now if the view is shown, else later; a function that is requested again meanwhile runs once.

        Args:
            view: name of the view.
            draw: draws the state at the time it is called.
        """
        if view == self._shown():
            draw()
            return
        self._due.setdefault(draw, view)
        if self._clock is None:  # created on the page itself, not in a part of it that may be removed
            with self._client:
                self._clock = ui.timer(PAUSE, self._one)
        self._clock.active = True

    def seen(self, view: str) -> None:
        """Draw everything that is queued for a view, as it is now shown."""
        for draw in [draw for draw, of in self._due.items() if of == view]:
            self._draw(draw)

    def rest(self) -> None:
        """Draw nothing in the background for `REST` seconds."""
        self._from = time.monotonic() + REST

    def _one(self) -> None:
        """Run queued functions until one sends something to the browser; none while a person's job is running."""
        sent = self._client.outbox
        while self._idle() and self._due and time.monotonic() > self._from:
            self._draw(next(iter(self._due)))
            if sent.updates or sent.messages:
                break

    def _draw(self, draw: Callable[[], None]) -> None:
        """Run a queued function; what it requests in turn is put first in the queue."""
        del self._due[draw]
        others, self._due = self._due, {}
        draw()
        self._due |= others
        if self._clock is not None:
            self._clock.active = bool(self._due)
