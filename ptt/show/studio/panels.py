"""The views of the page: one is seen, the others are built and drawn behind it as soon as nothing is asked for.

A picture in space takes half a second to come into being in a browser; whoever opens its view finds it there already.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from ptt.show.studio.controller import Studio

BEHIND = ""  # the view of what nobody sees before it is asked for
REST = 0.6  # s after a step in which nothing unseen is drawn: what a person does next comes first
PAUSE = 0.2  # s between two things that a browser draws unseen, so that what a person does comes first
# A hidden view keeps its place and size: what was drawn there is right when it is seen, and nothing is drawn anew.
SWITCH = """document.querySelectorAll('.st-panel')
  .forEach(panel => panel.classList.toggle('st-here', panel.dataset.view === 'VIEW'))"""


class DrawQueue:
    """What is still to be drawn: the view that is seen at once, the others when there is time."""

    def __init__(self, studio: "Studio") -> None:
        """Begin with nothing to draw.

        Args:
            studio: of this session.
        """
        self._studio = studio
        self._due: dict[Callable[[], None], str] = {}
        self._from = 0.0
        self._clock: ui.timer | None = None

    def ask(self, view: str, draw: Callable[[], None]) -> None:
        """Draw now if the view is seen, else later; asked twice, it is drawn once.

        Args:
            view: name of the view.
            draw: draws what is known by then.
        """
        if view == self._studio.view:
            draw()
            return
        self._due.setdefault(draw, view)
        if self._clock is None:  # of the page, which lives longer than any part of it
            with self._studio.client:
                self._clock = ui.timer(PAUSE, self._one)
        self._clock.active = True

    def seen(self, view: str) -> None:
        """Draw everything that a view lacks."""
        for draw in [draw for draw, of in self._due.items() if of == view]:
            self._draw(draw)

    def rest(self) -> None:
        """Draw nothing unseen for a moment."""
        self._from = time.monotonic() + REST

    def _one(self) -> None:
        """Draw of a view that is not seen until there is something for the browser to do, unless a person waits."""
        sent = self._studio.client.outbox
        while self._studio.idle and self._due and time.monotonic() > self._from:
            self._draw(next(iter(self._due)))
            if sent.updates or sent.messages:
                break

    def _draw(self, draw: Callable[[], None]) -> None:
        """Draw; what that asks for in its turn comes next."""
        del self._due[draw]
        others, self._due = self._due, {}
        draw()
        self._due |= others
        if self._clock is not None:
            self._clock.active = bool(self._due)


class Panels:
    """The views, each in its panel."""

    def __init__(self, studio: "Studio", views: "Mapping[str, Callable[[Studio], object]]") -> None:
        """Lay out empty panels; a view is built when it is seen or when there is time.

        Args:
            studio: of this session.
            views: name -> what builds it.
        """
        self._studio = studio
        self._panels: dict[str, ui.element] = {}
        with ui.element("div").classes("st-panels"):
            for name, build in views.items():
                panel = ui.element("div").classes("st-panel")
                panel.props(f'role=tabpanel data-view={name} aria-label="{name}"')
                self._panels[name] = panel
                studio.later.ask(name, partial(self._build, panel, partial(build, studio)))

    @staticmethod
    def _build(panel: ui.element, build: Callable[[], object]) -> None:
        with panel:
            build()

    def see(self, view: str) -> None:
        """Show a view, built and drawn as far as it was not.

        Args:
            view: its name.
        """
        for name, panel in self._panels.items():
            panel.classes(add="st-here") if name == view else panel.classes(remove="st-here")
        self._studio.later.seen(view)
