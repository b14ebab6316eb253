"""An element of the page that shows a plotly figure."""

from nicegui import json, ui

from ptt.show.studio.figures import Figure, empty_figure


class Picture(ui.plotly, component="picture.js"):
    """A plotly picture; it emits plotly_click, _selected, _hover and _unhover with the customdata of points."""

    def __init__(self, label: str, figure: Figure | None = None) -> None:
        """Build it.

        Args:
            label: what it shows, for screen readers.
            figure: figure as a dictionary of plain values; None for an empty one.
        """
        super().__init__(figure or empty_figure())
        self.props("role=img").props["aria-label"] = label

    def show(self, figure: Figure) -> None:
        """Draw a figure, unless it is the one that is shown."""
        if figure != self.figure:
            self.update_figure(figure)

    def update(self) -> None:
        """Send the figure as text; as a structure, NiceGUI and Vue would observe each number, which is slow."""
        with self._props.suspend_updates():
            self._props["options"] = json.dumps(self.figure)
        super(ui.plotly, self).update()
