"""The box of all candidates of a diagnosis, of effects that could not be tested, and of its text."""

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from ptt.run.noise import source_in_words
from ptt.show.card.words import length, percent, pretty
from ptt.show.studio.controller import Studio
from ptt.show.studio.draw_queue import BEHIND
from ptt.show.studio.page_effect import EffectCards
from ptt.show.studio.parts import box, grid, heading, note
from ptt.show.studio.results import Diagnosed, Source

HEADS = ("effect", "takes alone", "held-out error", "likely", "cannot be told from", "")


class OthersView:
    """The box of other candidates and of what could not be tested."""

    def __init__(self, studio: Studio, add: Callable[[str], Awaitable[None]], cards: EffectCards) -> None:
        """Build it.

        Args:
            studio: of this session.
            add: adds an effect by its key.
            cards: cards of effects, which names in the table open.
        """
        self.studio, self.add, self.cards = studio, add, cards
        self.shown: Diagnosed | None = None
        self.of: Source | None = None
        self.adds: dict[str, ui.button] = {}
        with box() as self.box, ui.expansion("What else was considered").classes("w-full").props("dense"):
            self.body = grid()
        studio.when(BEHIND, "session", self.show)
        self.show()

    def show(self) -> None:
        """Take over a changed session; the table is built again only for another diagnosis."""
        session = self.studio.session
        diagnosis = session.diagnosis
        if session.source is not self.of:  # the last diagnosis is of another run
            self.of, self.shown = session.source, None
        self.box.set_visibility(diagnosis is not None or self.shown is not None)
        if diagnosis is not None and diagnosis is not self.shown:
            self.shown = diagnosis
            self.body.clear()
            self.adds.clear()
            with self.body:
                self._fill(diagnosis)
        there = {entry.key for entry in session.effects}
        for key, button in self.adds.items():
            button.set_visibility(key not in there)

    def _fill(self, diagnosis: Diagnosed) -> None:
        data = diagnosis.data
        with ui.element("table").classes("st-plain st-keep").mark("candidates"):
            with ui.element("thead"), ui.element("tr"):
                for index, head in enumerate(HEADS):
                    ui.html(head, sanitize=False, tag="th").props("scope=col").classes("w" if index in (0, 4) else "")
            with ui.element("tbody"):
                for item in data["candidates"]:
                    self._row(item)
        note("Takes alone: the share of the squared error that the effect explains by itself.")
        if data["not_testable"]:
            heading("Could not be tested on this run", "h3").style("margin-top: 8px")
            for item in data["not_testable"]:
                note(f"{item['effect']} needs {item['needs']}")
        noise, left = data["noise_um"], len(data["outlier_rows"])
        gross = f", {left} left out as gross errors" if left else ""
        rows = data.get("rows_aside", ())  # missing in diagnoses that older versions saved
        aside = f", {len(rows)} set aside at the beginning of runs" if rows else ""
        source = source_in_words(noise["source"])
        note(f"Noise {length(noise['total'])} from {source}; {data['rows']} readings{gross}{aside}.")
        with ui.expansion("The same as the command line prints it").classes("w-full").props("dense"):
            ui.label(pretty(diagnosis.text)).classes("st-mono")

    def _row(self, item: dict[str, Any]) -> None:
        key = item["effect"]
        before, after = item["heldout_rms_um"]["before"], item["heldout_rms_um"]["after"]
        cells = (
            percent(item["explained_share"]), f"{length(before)} \N{RIGHTWARDS ARROW} {length(after)}",
            percent(item["probability"]),
        )  # fmt: skip
        with ui.element("tr"):
            with ui.element("td").classes("w"):
                name = ui.button(key).props("flat dense no-caps align=left")
                self.cards.open_on(name, key)
                name.props["aria-label"] = f"why {key}"
            for text in cells:
                ui.html(text, sanitize=False, tag="td")
            with ui.element("td").classes("w"):
                note(", ".join(item["indistinguishable_from"]) or "\N{EN DASH}")
            with ui.element("td"):
                button = ui.button("Add", on_click=lambda: self.add(key)).props("dense no-caps outline size=sm")
                button.props["aria-label"] = f"add {key} from the list"
                self.adds[key] = button.style("padding: 0 8px")
