"""The view Model: ladder of errors, effects with their switches, and the residual with and without them."""

from collections.abc import Mapping, Sequence

from nicegui import ui

from ptt.machine_schema import EffectEntry
from ptt.run.axes import AXES
from ptt.show.card.words import parameter_in_words, pretty, together
from ptt.show.studio.controller import Studio
from ptt.show.studio.figures import empty_figure
from ptt.show.studio.ladder_figures import ladder_figure
from ptt.show.studio.page_against import NOTHING, AgainstPicture
from ptt.show.studio.page_look import first_of
from ptt.show.studio.parts import box, heading, note, tools
from ptt.show.studio.picture import Picture
from ptt.show.studio.session import Session
from ptt.show.studio.snapshot import Rung, Snapshot, parameter_rows
from ptt.show.studio.tables import table_html


class ModelView:
    """The view of the ladder, the effects and the residual with and without them."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.asked, self.led = "", ("", "")
        self.listed: Snapshot | None = None
        with ui.element("div").classes("st-two st-wide-left"):
            with ui.element("div").classes("st-col"):
                with box().classes("st-col").style("height: auto; flex: 6 1 0"):
                    self._build_ladder()
                with box().classes("st-col").style("height: auto; flex: 5 1 0"):
                    self._build_against()
            with box().classes("st-col st-scroll").props("tabindex=0"):
                self._build_add()
                self.list = ui.element("div").classes("w-full")
        studio.when("Model", "session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _build_ladder(self) -> None:
        with tools():
            heading("Error after each step")
            ui.space()
            self.axis = ui.toggle(["total", *AXES], value="total", on_change=self.redraw)
            self.axis.props('dense no-caps aria-label="axis of the ladder"')
        self.figures = note().mark("ladder")
        self.ladder = Picture("ladder of errors").classes("st-plot st-ladder")

    def _build_against(self) -> None:
        self.against = AgainstPicture(self.redraw, "residual with and without", "With and without")

    def _build_add(self) -> None:
        with tools():
            self.which = ui.select([], label="effect", with_input=True).props("dense outlined options-dense")
            self.which.classes("w-48")
            self.add = ui.button("Add", icon="add", on_click=self._add).props("no-caps dense")
            self.refit = ui.button("Refit", icon="refresh", on_click=lambda: self.studio.change("fit"))
            self.refit.props("no-caps dense outline")

    def _enable(self) -> None:
        idle = self.studio.idle and self.studio.session.ready
        for button in (self.add, self.refit):
            button.set_enabled(idle)

    def show(self) -> None:
        """Take over a changed session."""
        self._enable()
        session = self.studio.session
        asked = f"{session.kind} {session.source.effects if session.source else ''}"
        if session.ready and self.asked != asked:
            self.asked = asked
            ui.timer(0.01, self._fetch_names, once=True)
        self._fill_selects()
        self.redraw()
        if session.now is not self.listed:  # never rebuilt under the pointer for the same model
            self.listed = session.now
            self.list.clear()
            with self.list:
                if session.now is not None:
                    self._fill_list(session.now)

    def redraw(self) -> None:
        """Draw both pictures again, one after the other where they are not seen."""
        for draw in (self._draw_ladder, self._draw_against):
            self.studio.draw_queue.request("Model", draw)

    async def _fetch_names(self) -> None:
        session = self.studio.session
        files = () if session.source is None else session.source.effect_files
        known = await self.studio.work("effects", "names", session.kind, files, how="spare")
        if known is not None:
            self.which.set_options(list(known))

    def _fill_list(self, now: Snapshot) -> None:
        entries = now.file.effect
        if not entries:
            note("The model has no effects yet: it is the drawing as it is.")
        for entry in entries:
            self._effect(entry, entry.key not in now.off)
        if now.fit:
            with ui.expansion("The fit in words").classes("w-full").props("dense"):
                ui.label(pretty(now.fit)).classes("st-mono")

    def _effect(self, entry: EffectEntry, on: bool) -> None:
        key = entry.key
        with box().style("margin-top: 6px; padding: 4px 8px").mark(f"effect {key}"):
            with tools().style("flex-wrap: nowrap"):
                ui.switch(key, value=on, on_change=lambda event: self.studio.switch(key, bool(event.value)))
                ui.space()
                remove = ui.button("Remove", icon="delete", on_click=lambda: self.studio.change("remove", key))
                remove.props("flat dense no-caps size=sm").props["aria-label"] = f"remove {key}"
                remove.set_enabled(on)
            rows = rows_in_words(parameter_rows(entry))
            with ui.element("div").classes("st-grid"):
                ui.html(table_html((), rows), sanitize=False).classes("w-full")

    def _draw_ladder(self) -> None:
        session = self.studio.session
        rungs, noise = ladder_of(self.studio)
        if not rungs:
            self.figures.set_text(
                "The ladder appears once a run is compared." if session.ready else "Load a run first."
            )
            self.ladder.show(empty_figure())
            return
        self.ladder.show(ladder_figure(rungs, noise, str(self.axis.value)))
        self.figures.set_text(words_of(session, rungs[-1], noise, str(self.axis.value)))

    def _fill_selects(self) -> None:
        look = self.studio.session.look
        if look is None:
            return
        if self.against.view.options != list(look.views) or self.against.chosen == self.led:
            self.led = first_of(self.studio.session, look)
            self.against.offer(look, *self.led)
        others = list(self.studio.session.others())
        self.against.offer_beside(others, others[-1] if others else NOTHING)

    def _draw_against(self) -> None:
        session = self.studio.session
        if session.look is not None:
            self.against.draw(session.look, session.others(), self.studio.picked)

    async def _add(self) -> None:
        if self.which.value:
            await self.studio.change("add", str(self.which.value))


def rows_in_words(rows: Sequence[tuple[str, float, float | None, str]]) -> list[tuple[str, str, str, str]]:
    """Rows of a table of parameters, the values of one parameter in one unit.

    Args:
        rows: of `ptt.show.studio.snapshot.parameter_rows`.

    Returns:
        Name, value with its unit, error, and note.
    """
    largest: dict[str, float] = {}
    for name, value, std, _ in rows:
        stem = name.partition(" ")[0]
        largest[stem] = max(largest.get(stem, 0.0), abs(value), std or 0.0)
    return [
        (*parameter_in_words(name, value, std, largest[name.partition(" ")[0]]), word)
        for name, value, std, word in rows
    ]


def ladder_of(studio: Studio) -> tuple[tuple[Rung, ...], dict[str, float]]:
    """The ladder of the session; where its last step is not the active model, the error of that is added as a step.

    Args:
        studio: of this session.

    Returns:
        The steps, and axis or 'total' -> noise floor, um; both empty where nothing is known yet.
    """
    now, found = studio.session.now, studio.session.comparison
    rungs: tuple[Rung, ...] = () if now is None else now.rungs
    noise = dict(now.noise_um) if now is not None and rungs else dict(found.data["noise_um"]) if found else {}
    if now is None or noise.get("total") is None:
        return (), {}
    error = studio.session.error_um
    if now.fitted != now.active and error is not None:
        rungs = (*rungs, Rung(_switched(now) or "as given", error, None))
    return rungs, noise


def words_of(session: Session, last: Rung, noise_um: Mapping[str, float], axis: str) -> str:
    """The error of the active model in words, with the held-out error if there is one.

    Args:
        session: the session.
        last: the last step of the ladder.
        noise_um: axis or 'total' -> noise floor, um.
        axis: 'x', 'y', 'z' or 'total'.

    Returns:
        One sentence.
    """
    now, micro = session.now, "\N{MICRO SIGN}m"
    assert now is not None
    left = f"; switched off: {', '.join(sorted(now.off))}; the figures are without it" if now.off else ""
    if last.heldout_rms_um is None:
        after = (
            "no held-out figure, because nothing was fitted" if not now.rungs else "nothing was refitted or held out"
        )
        noise = f"noise {noise_um[axis]:.2f} {micro}"
        return together(f"Now {last.rms_um[axis]:.2f} {micro} over all rows (plain RMS; {after}); {noise}{left}")
    if now.fitted != now.active:
        return f"{_switched(now)}: the figures for that are being computed"
    return together(
        f"Now {last.rms_um[axis]:.2f} {micro} on training rows, {last.heldout_rms_um[axis]:.2f} {micro} held out; "
        f"noise {noise_um[axis]:.2f} {micro}{_doubt(now.rungs)}{left}"
    )


def _doubt(rungs: Sequence[Rung]) -> str:
    """A remark on the last step if it did not help, or removed what is needed; '' otherwise, and for a refit."""
    last = rungs[-1]
    if last.helped or last.heldout_rms_um is None:
        return ""
    if last.words.startswith("\N{MINUS SIGN}"):
        return " (what this step removed is needed)"
    before = rungs[-2].heldout_rms_um if last.words.startswith("+") and len(rungs) > 1 else None
    if before is None:
        return ""
    fell = last.heldout_rms_um["total"] < before["total"]
    return f" (this step {'may not have helped' if fell else 'did not help: the held-out error did not fall'})"


def _switched(now: Snapshot) -> str:
    """What was switched since the last fit, in words; '' where nothing was fitted and nothing is off."""
    if now.off:
        return f"{', '.join(sorted(now.off))} off"
    return "switched on again" if now.rungs else ""
