"""A picture of a residual against a variable, with the controls that choose both and another model beside."""

from collections.abc import Callable, Mapping, Sequence

from nicegui import ui

from ptt.show.studio.figures import against_figure, empty_figure, label_of
from ptt.show.studio.looks import Look
from ptt.show.studio.parts import heading
from ptt.show.studio.picture import Picture

NOTHING = "nothing"


class AgainstPicture:
    """The controls and the picture."""

    def __init__(self, redraw: Callable[[], None], label: str, title: str = "") -> None:
        """Build it.

        Args:
            redraw: called when something else is chosen.
            label: what the picture shows, for screen readers.
            title: heading; '' for none.
        """
        with ui.element("div").classes("st-tools st-line"):
            if title:
                heading(title)
            self.view = ui.select(["x"], value="x", label="residual in", on_change=redraw)
            self.context = ui.select(["time"], value="time", label="against", on_change=redraw)
            self.beside = ui.select([NOTHING], value=NOTHING, label="beside it", on_change=redraw)
            for select in (self.view, self.context, self.beside):
                select.props("dense outlined options-dense")
            self.context.classes("st-longer")
        self.plot = Picture(label).classes("st-plot")

    @property
    def chosen(self) -> tuple[str, str]:
        """Component of the residual, and variable, '' for none."""
        return self.view.value, self.context.value or ""

    def offer(self, look: Look, view: str, context: str) -> None:
        """Set the choices to what a run has, and choose.

        Args:
            look: the run.
            view: component of the residual.
            context: variable; '' where the run has none.
        """
        self.view.set_options(list(look.views), value=view)
        self.context.set_options({name: label_of(name, look) for name in look.contexts}, value=context or None)

    def offer_beside(self, others: Sequence[str], chosen: str) -> None:
        """Set the choices of other models to be drawn beside, and choose one if it is among them."""
        self.beside.set_options([NOTHING, *others], value=chosen if chosen in others else NOTHING)

    def draw(self, look: Look, others: Mapping[str, Look], picked: Sequence[int]) -> bool:
        """Draw what is chosen.

        Args:
            look: the run.
            others: looks at other models, by words.
            picked: row numbers to highlight.

        Returns:
            Whether the run has the chosen component and variable; otherwise the picture is empty.
        """
        view, context = self.chosen
        if view not in look.views or context not in look.contexts:
            self.plot.show(empty_figure())  # not that of a run before
            return False
        beside = (self.beside.value, others[self.beside.value]) if self.beside.value in others else None
        self.plot.show(against_figure(look, view, context, picked, beside))
        return True
