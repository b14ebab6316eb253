"""The view Look: error field in space, residual against any variable and over time, and a table of readings."""

import math
from collections.abc import Sequence

import numpy as np
from nicegui import events, ui

from ptt.show.card.words import length, together
from ptt.show.studio.arrow_figure import SHOWN_ARROWS as ARROWS
from ptt.show.studio.arrow_figure import mean_arrows, usual_scale
from ptt.show.studio.controller import Studio
from ptt.show.studio.figures import against_figure, empty_figure, unit_of
from ptt.show.studio.looks import Look
from ptt.show.studio.machine_figure import empty_space, machine_figure
from ptt.show.studio.page_against import AgainstPicture
from ptt.show.studio.parts import box, note, tools, warning
from ptt.show.studio.picture import Picture
from ptt.show.studio.session import Session
from ptt.show.studio.tables import table_html

# What a click picks: distance in mm from the reading, or -1 for it alone -> in words.
PICKS = {0.0: "pose, all its visits", -1.0: "one reading", 10.0: "region of 10 mm", 25.0: "region of 25 mm"}
SHOWN_ROWS = 60  # of the table
PLACES = {"mm": 4, "m": 6, "mrad": 4, "rad": 6}  # decimal places by unit; one for um and urad
# JavaScript handlers of pictures: the rows of clicked or selected points; and, of the picture in space, those that
# remember the point under the pointer and where a button was pressed, and send it if the pointer did not move.
ROWS = "e => emit((e?.points ?? []).map(p => p.customdata).filter(row => row !== undefined))"
POINTED = "e => { getElement(ID).pointed = e?.points?.[0]?.customdata; }"
LEFT = "() => { getElement(ID).pointed = undefined; }"
PRESSED = "e => { getElement(ID).pressed = [e.clientX, e.clientY]; }"
CLICKED = """e => { const own = getElement(ID), [x, y] = own.pressed ?? [0, 0];
  if (own.pointed !== undefined && Math.hypot(e.clientX - x, e.clientY - y) < 4) emit([own.pointed]); }"""


class LookView:
    """The view's controls, pictures and table."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.drawn: Look | None = None
        self.led: tuple[str, str] | None = None  # component and variable that were chosen by `_lead`
        with ui.element("div").classes("st-look"):
            with box().classes("st-col"):
                self._build_field()
            with box().classes("st-col"):
                self._build_against()
            with box().classes("st-table st-col"):
                self._build_table()
        studio.when("Look", "session", self.show)
        studio.when("Look", "picked", self.redraw)
        self.show()

    def _build_field(self) -> None:
        with tools():
            self.scale = ui.number("arrows enlarged, times", value=100.0, min=1.0, on_change=self.redraw_field)
            self.scale.props("dense outlined debounce=400").classes("w-40")
            self.machine = ui.switch("machine", value=True, on_change=self.redraw_field)
            self.near = ui.switch("close up", value=True, on_change=self.redraw_field)
            self.pick = ui.select(PICKS, value=0.0, label="a click picks").props("dense outlined").classes("w-44")
        self.field_note = note().mark("field-note")
        self.field = Picture("error field in space", empty_space()).classes("st-plot st-field")
        # Plotly emits no click in space where frames are slow: so the point under the pointer at a click is taken.
        self.field.on("plotly_hover", js_handler=POINTED.replace("ID", str(self.field.id)))
        self.field.on("plotly_unhover", js_handler=LEFT.replace("ID", str(self.field.id)))
        self.field.on("pointerdown.capture", js_handler=PRESSED.replace("ID", str(self.field.id)))
        self.field.on("click", self._clicked, js_handler=CLICKED.replace("ID", str(self.field.id)))

    def _build_against(self) -> None:
        self.against = AgainstPicture(self.redraw_against, "residual against a variable")
        self.time = Picture("residual over time").classes("st-plot")
        for plot in (self.against.plot, self.time):
            plot.on("plotly_click", self._clicked, js_handler=ROWS)
            plot.on("plotly_selected", self._selected, js_handler=ROWS)

    def _build_table(self) -> None:
        with tools():
            self.table_note = ui.label().classes("st-head")
            ui.space()
            self.line = ui.number("go to line", min=1, precision=0, on_change=self._typed)
            self.line.props("dense outlined debounce=500").classes("w-28")
            ui.button("Clear", on_click=lambda: self.studio.pick([])).props("no-caps flat dense")
        self.nowhere = warning().props("role=status").mark("nowhere")
        self.nowhere.set_visibility(False)
        with ui.element("div").classes("st-scroll w-full").style("flex: 1 1 0; min-height: 0").props("tabindex=0"):
            self.table = ui.html("", sanitize=False).classes("w-full").mark("readings")

    def show(self) -> None:
        """Take over a changed session."""
        look = self.studio.session.look
        if look is None or look is self.drawn:
            return
        fresh = self.drawn is None or self.drawn.source != look.source or self.drawn.rows != look.rows
        self.drawn = look
        self.against.offer_beside(list(self.studio.session.others()), self.against.beside.value)
        if fresh:
            self.against.offer(look, *first_of(self.studio.session, look))
            self.scale.set_value(usual_scale(look))
            self.led = None
        self._lead()
        self.redraw()

    def _lead(self) -> None:
        """Choose the strongest dependence as soon as it is known, unless the person has chosen something else."""
        session = self.studio.session
        if session.comparison is None or self.led not in (None, self.against.chosen):
            return
        view, context = self.against.view, self.against.context
        for item in session.comparison.data["depends_on"][:1]:
            if item["residual"] in view.options and item["on"] in context.options:
                self.led = item["residual"], item["on"]
                view.set_value(item["residual"])
                context.set_value(item["on"])

    def redraw(self) -> None:
        """Draw everything again, as requests of their own, so that in the background they run one by one."""
        for draw in (self._draw_field, self._draw_against, self._fill_table):
            self.studio.draw_queue.request("Look", draw)

    def redraw_field(self) -> None:
        """Draw the field again."""
        self.studio.draw_queue.request("Look", self._draw_field)

    def redraw_against(self) -> None:
        """Draw residual and time line again."""
        self.studio.draw_queue.request("Look", self._draw_against)

    def _draw_field(self) -> None:
        look = self.drawn
        if look is None:
            return
        scale = float(self.scale.value or usual_scale(look))
        picked = self.studio.picked
        row = picked[0] if picked else middle_of(look)
        figure = machine_figure(
            look, row, picked=picked, scale=scale, machine=bool(self.machine.value), near=bool(self.near.value)
        )
        self.field.show(figure)
        count = mean_arrows(look).count
        share = (
            "of readings near each other"
            if len(count) and count.max() > 1 and len(count) > ARROWS // 2
            else "of a pose"
        )
        self.field_note.set_text(
            f"{int(look.kept.sum())} readings; each arrow is the mean error {share} after frame alignment, "
            + together(f"{scale:,.0f} times enlarged: 10 mm long is {length(1e4 / scale)}")
        )

    def _draw_against(self) -> None:
        look, picked = self.drawn, self.studio.picked
        if look is None:
            return
        drawn = self.against.draw(look, self.studio.session.others(), picked)
        timed = drawn and "time" in look.contexts
        self.time.show(against_figure(look, self.against.view.value, "time", picked, None) if timed else empty_figure())

    def _fill_table(self) -> None:
        look, picked = self.drawn, self.studio.picked
        if look is None:
            return
        order = np.argsort(np.where(look.kept, -look.size_um, np.inf))[: int(look.kept.sum())]
        rows = picked[:SHOWN_ROWS] if picked else order[:SHOWN_ROWS].tolist()
        what = (
            f"{len(picked)} picked reading{'s' * (len(picked) > 1)}"
            if picked
            else f"the {len(rows)} largest errors of {look.rows} readings"
        )
        cut = f", {SHOWN_ROWS} shown" if len(picked) > SHOWN_ROWS else ""
        self.table_note.set_text(what + cut)
        self.table.set_content(_table(look, rows))

    def _clicked(self, event: events.GenericEventArguments) -> None:
        if event.args:
            self._pick(int(event.args[0]))

    def _selected(self, event: events.GenericEventArguments) -> None:
        rows = sorted({int(row) for row in event.args or []})
        if rows:
            self.studio.pick(rows)

    def _typed(self) -> None:
        look = self.drawn
        if look is None or self.line.value is None:
            self.nowhere.set_visibility(False)
            return
        found = np.flatnonzero((look.line == int(self.line.value)) & look.kept)
        self.nowhere.set_visibility(not len(found))
        if len(found):
            self._pick(int(found[0]))
        else:
            self.nowhere.set_text(look.why_not_shown(int(self.line.value)))

    def _pick(self, row: int) -> None:
        look, within = self.drawn, float(self.pick.value)
        assert look is not None
        others = [] if within < 0 else [int(each) for each in look.visits_of(row, within) if each != row]
        self.studio.pick([row, *others])


def first_of(session: Session, look: Look) -> tuple[str, str]:
    """The component of the residual and the variable that are shown at first.

    Args:
        session: the session.
        look: the run.

    Returns:
        The strongest dependence with the model before any step, if that was compared; else the joint's component with
        the largest residual, and the first variable, '' where a run is too short to have any.
    """
    given = session.past[0].active if session.past else session.text
    for item in session.comparisons[given].data["depends_on"][:1] if given in session.comparisons else []:
        if item["residual"] in look.views and item["on"] in look.contexts:
            return item["residual"], item["on"]
    inner = [name for name in look.views if name not in "xyz"]
    largest = max(inner, key=lambda name: float(np.nanmean(np.square(look.views[name]))))
    return largest, next(iter(look.contexts), "")


def middle_of(look: Look) -> int:
    """Row of the reading nearest to the mean target: the pose of the machine until another is picked."""
    rows = np.flatnonzero(look.kept)
    if not len(rows):
        return 0
    place = look.target[rows]
    return int(rows[np.argmin(np.linalg.norm(place - place.mean(axis=0), axis=1))])


def _table(look: Look, rows: Sequence[int]) -> str:
    """Readings as an HTML table."""
    inner = [name for name in look.views if name not in "xyz"]
    units = [unit_of(name, look.views[name]) for name in inner]
    length_unit, factor = unit_of("x", look.residual)
    heads = ["line", "name", "run", "x [mm]", "y [mm]", "z [mm]"]
    heads += [f"{name} [{length_unit}]" for name in ("error x", "error y", "error z", "size")]
    heads += [f"{name} [{unit}]" for name, (unit, _) in zip(inner, units, strict=True)]
    cells = []
    for row in rows:
        own = [str(look.line[row]), look.name[row], look.run[row], *(_number(value, 2) for value in look.target[row])]
        size = float(np.linalg.norm(look.residual[row]))
        own += [_number(factor * value, PLACES.get(length_unit, 1)) for value in (*look.residual[row], size)]
        own += [
            _number(times * look.views[name][row], PLACES.get(unit, 1))
            for name, (unit, times) in zip(inner, units, strict=True)
        ]
        cells.append(own)
    return table_html(heads, cells, words=3, caption="readings with their errors")


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") if math.isfinite(value) else "\N{EN DASH}"
