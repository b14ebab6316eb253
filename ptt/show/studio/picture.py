"""A picture of plotly on the page; the same figure is not drawn again."""

from nicegui import json, ui

from ptt.show.studio.figures import Figure, empty_figure


class Picture(ui.plotly, component="picture.js"):
    """A picture; what is heard of it are plotly_click, _selected, _hover and _unhover, with the points' customdata."""

    def __init__(self, figure: Figure | None = None) -> None:
        """Make it.

        Args:
            figure: as plotly has it, of plain values; None for an empty one.
        """
        super().__init__(figure or empty_figure())

    def show(self, figure: Figure) -> None:
        """Draw a figure, unless it is the one that is seen."""
        if figure != self.figure:
            self.update_figure(figure)

    def update(self) -> None:
        """Send it as text: page and browser else watch each of its numbers, which takes longer than drawing them."""
        with self._props.suspend_updates():
            self._props["options"] = json.dumps(self.figure)
        super(ui.plotly, self).update()
