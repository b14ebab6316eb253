"""The box of an unknown: the curve of its leading dependence, and writing effects from all its dependences."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from nicegui import ui

from ptt.dependence.said import who_is_off
from ptt.diagnosis.search.excess import remaining_error
from ptt.effects.phrases import listed
from ptt.show.card.words import percent
from ptt.show.studio.card_figures import unknown_figure
from ptt.show.studio.controller import Studio
from ptt.show.studio.parts import box, note, tools
from ptt.show.studio.picture import Picture
from ptt.show.studio.results import Diagnosed

HOW = {  # shape of a dependence -> in words
    "levels": "level by level", "smooth": "smoothly", "step": "in a step", "bump": "near one place",
    "period": "periodically", "varying": "more at one end than at the other",
    "gradual": "gradually after each reversal",
}  # fmt: skip


class UnknownView:
    """The box of an unknown's curve."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.shown: Diagnosed | None = None
        self.file, self.names = "", list[str]()
        with box("The curve that it follows").mark("unknown") as self.box:
            self.plot = Picture("what the unknown follows").classes("w-full").style("height: 340px")
            self.how = note()
            with tools().style("margin: 8px 0"):
                self.name = ui.input("name of the effect", value="my-effect").props("dense outlined").classes("w-48")
                ui.button("Write this as an effect", icon="edit_note", on_click=self._write).props("no-caps unelevated")
                self.add = ui.button("Add it to the model", icon="add", on_click=self._add).props("no-caps outline")
            self.code = ui.label().classes("st-mono st-code").mark("effect-file")
            self.code.props("tabindex=0")
        studio.when("Result", "session", self.show)
        self.show()

    def show(self) -> None:
        """Take over a changed session."""
        diagnosis = self.studio.session.diagnosis
        self.box.set_visibility(diagnosis is not None and diagnosis.unknown is not None)
        if diagnosis is None or diagnosis.unknown is None or diagnosis is self.shown:
            return
        self.shown = diagnosis
        self.plot.show(unknown_figure(diagnosis.unknown, self.studio.session.kind == "serial"))
        unknown = diagnosis.unknown
        rivals = f"; {', '.join(unknown['rivals'])} would explain it about as well" if unknown["rivals"] else ""
        self.how.set_text(f"{how_it_follows(unknown)}{rivals}.{_seen_as(unknown)}")
        self.code.set_visibility(False)
        self.add.set_visibility(False)

    async def _write(self) -> None:
        diagnosis = self.studio.session.diagnosis
        name = re.sub(r"[^a-z0-9]+", "-", str(self.name.value or "").lower()).strip("-") or "my-effect"
        if diagnosis is None or diagnosis.unknown is None:
            return
        found = diagnosis.data["depends_on"]
        made = await self.studio.work("writing the effect", "write_effects", name, found, how="asked")
        if made is None:
            return
        self.name.set_value(name)
        self.file, self.names = made["file"], made["names"]
        self.code.set_text(made["text"])
        self.code.set_visibility(True)
        self.add.set_visibility(True)
        ui.download.content(made["text"], made["file"])

    async def _add(self) -> None:
        """Add the effects of the file that was written here to the model."""
        source = self.studio.session.source
        if source is None or not self.file:
            return
        if self.file not in source.effects:
            self.studio.with_source(replace(source, effects=(*source.effects, self.file)))
        await self.studio.change("add", *self.names)


def how_it_follows(unknown: Mapping[str, Any]) -> str:
    """How much of the error the curve describes; of what takes several variables, these and the curve's own part.

    Args:
        unknown: an entry of `depends_on`.

    Returns:
        A sentence without its stop.
    """
    left = remaining_error(unknown["residual"])
    if not unknown["together"]:
        return f"{percent(unknown['share'])} of the variance of {left} depends on it ({HOW[unknown['shape']]})"
    several = f"{percent(unknown['share'])} of the variance of {left} depends on {listed(unknown['together'])} together"
    return f"{several}; this curve over {unknown['on']} alone shows {percent(unknown['alone_share'])}"


def _seen_as(unknown: Mapping[str, Any]) -> str:
    """A sentence where the picture's residual is of another part than the one at fault, so that its figures differ."""
    acts = unknown["acts_on"]
    if acts in (None, "set-up", "mount", "load", unknown["residual"]):
        return ""
    return (
        f" The picture shows it as an error of {unknown['residual']}, the sentence above as one of {who_is_off(acts)}."
    )
