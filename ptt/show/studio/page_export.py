"""The box on Finish that exports a model to a controller's format, and shows what the format holds."""

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from ptt.correct.exports.format import ErrorLeft, said_held
from ptt.show.card.words import length, pretty
from ptt.show.studio.controller import Studio
from ptt.show.studio.parts import box, note, tools, warning

BARS = (  # key of 'error_um', words, colour
    ("drawing", "by the drawing", "#d55e00"),
    ("format", "with this format", "#0072b2"),
    ("model", "with the whole model", "#9aa3aa"),
)


class ExportView:
    """The box that exports the active model, or the compensator where one is trained."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.asked = ""
        with box("For the controller").mark("export"):
            with tools():
                self.which = (
                    ui.select({}, label="controller or format")
                    .props("dense outlined options-dense")
                    .style("flex: 1 1 220px; min-width: 0")
                )
                self.write = ui.button("Write it", icon="memory", on_click=self._write).props("no-caps unelevated")
            self.body = ui.element("div").classes("w-full")
        studio.when("Finish", "session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _enable(self) -> None:
        self.write.set_enabled(self.studio.session.ready and self.studio.idle and bool(self.which.value))

    def show(self) -> None:
        """Take over a changed session; the last export is cleared."""
        session = self.studio.session
        self._enable()
        self.body.clear()
        if session.ready and self.asked != session.kind:
            self.asked = session.kind
            ui.timer(0.01, self._formats, once=True)

    async def _formats(self) -> None:
        found = await self.studio.work("formats for controllers", "formats", self.studio.session.kind, how="spare")
        if found is not None:
            self.which.set_options(
                {name: f"{name}: {about}" for name, about in found}, value=found[0][0] if found else None
            )
            self._enable()

    async def _write(self) -> None:
        session = self.studio.session
        model = session.training.archive if session.training else session.text
        to = str(self.which.value)
        found = await self.studio.work(f"writing {to}", "export", session.source, model, to)
        if found is not None:
            self.body.clear()
            with self.body:
                self._fill(found)

    def _fill(self, found: Mapping[str, Any]) -> None:
        error = found["error_um"]
        ui.label("What the machine would still miss over its workspace").classes("font-medium").style("margin-top: 8px")
        most = max((value for value in error.values() if value), default=1.0)
        for key, words, colour in BARS:
            value = error.get(key)
            with tools().style("flex-wrap: nowrap; gap: 8px"):
                note(words).style("width: 140px; flex: none")
                ui.element("div").style(
                    f"width: {55.0 * (value or 0.0) / most:.1f}%; min-width: 2px; height: 12px; border-radius: 3px; "
                    f"background: {colour}"
                )
                ui.label(length(value) if value is not None else "\N{EN DASH}").style("white-space: nowrap")
        cannot = [item["effect"] for item in found["cannot_hold"]]
        holds = said_held(found["holds"], cannot, ErrorLeft.told(error), network=found["network"])
        note(f"Holds: {holds}.")
        for item in found["cannot_hold"]:
            warning(f"Cannot hold {item['effect']}: {pretty(item['why'])}.").style("margin-top: 3px")
        for line in found.get("notes", ()):
            note(pretty(line))
        give = ui.button(f"Download {found['name']}", icon="download")
        give.on_click(lambda: ui.download.content(found["content"], found["name"])).props("no-caps unelevated")
