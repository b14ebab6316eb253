"""The panels of the page's views: one is shown, the others are built and drawn while the page is idle.

A picture in space takes a browser half a second to create; this way it is there before its view is opened.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from ptt.show.studio.controller import Studio

BEHIND = ""  # stands for the view of what is never shown at once, such as closed dialogs
REST = 0.6  # s after a change in which nothing is drawn in the background, so that the person's next step comes first
PAUSE = 0.2  # s between two background drawings, so that the browser can react to the person
# JavaScript that shows one panel. Hidden ones keep their place and size, so that nothing has to be drawn again.
SWITCH = """document.querySelectorAll('.st-panel')
  .forEach(panel => panel.classList.toggle('st-here', panel.dataset.view === 'VIEW'))"""


class DrawQueue:
    """Drawing requests of views: of the one that is shown done at once, of the others while the page is idle."""

    def __init__(self, studio: "Studio") -> None:
        """Begin with an empty queue.

        Args:
            studio: of this session.
        """
        self._studio = studio
        self._due: dict[Callable[[], None], str] = {}
        self._from = 0.0
        self._clock: ui.timer | None = None

    def request(self, view: str, draw: Callable[[], None]) -> None:
        """Draw now if the view is shown, else later; a function that is requested again meanwhile runs once.

        Args:
            view: name of the view.
            draw: draws the state at the time it is called.
        """
        if view == self._studio.view:
            draw()
            return
        self._due.setdefault(draw, view)
        if self._clock is None:  # created on the page itself, not in a part of it that may be removed
            with self._studio.client:
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
        sent = self._studio.client.outbox
        while self._studio.idle and self._due and time.monotonic() > self._from:
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


class Panels:
    """The views, each in its panel."""

    def __init__(self, studio: "Studio", views: "Mapping[str, Callable[[Studio], object]]") -> None:
        """Lay out empty panels; a view is built when it is shown, or while the page is idle.

        Args:
            studio: of this session.
            views: name -> function that builds the view.
        """
        self._studio = studio
        self._panels: dict[str, ui.element] = {}
        with ui.element("div").classes("st-panels"):
            for name, build in views.items():
                panel = ui.element("div").classes("st-panel")
                panel.props(f'role=tabpanel data-view={name} aria-label="{name}"')
                self._panels[name] = panel
                studio.draw_queue.request(name, partial(self._build, panel, partial(build, studio)))

    @staticmethod
    def _build(panel: ui.element, build: Callable[[], object]) -> None:
        with panel:
            build()

    def see(self, view: str) -> None:
        """Show a view; what of it was not built and drawn yet is done now.

        Args:
            view: its name.
        """
        for name, panel in self._panels.items():
            panel.classes(add="st-here") if name == view else panel.classes(remove="st-here")
        self._studio.draw_queue.seen(view)
