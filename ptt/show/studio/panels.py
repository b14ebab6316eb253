"""The panels of the page's views: one is shown, the others are built and drawn while the page is idle.

A picture in space takes a browser half a second to create; this way it is there before its view is opened.
"""

from collections.abc import Callable, Mapping
from functools import partial

from nicegui import ui

from ptt.show.studio.controller import Studio

# JavaScript that shows one panel. Hidden ones keep their place and size, so that nothing has to be drawn again.
SWITCH = """document.querySelectorAll('.st-panel')
  .forEach(panel => panel.classList.toggle('st-here', panel.dataset.view === 'VIEW'))"""


class Panels:
    """The views, each in its panel."""

    def __init__(self, studio: Studio, views: Mapping[str, Callable[[Studio], object]]) -> None:
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
