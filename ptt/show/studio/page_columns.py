"""The grid of columns on Load: a preview, a meaning and a unit for each, saved as a file for --map."""

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from ptt.machine import parse_machine
from ptt.run.readers.columns import UNITS, dimension_of
from ptt.run.readers.mapping import IGNORE
from ptt.run.readers.titles import stated_unit
from ptt.show.studio.column_rows import BETWEEN
from ptt.show.studio.controller import Studio
from ptt.show.studio.page_question import show_question
from ptt.show.studio.parts import box, grid, note, tools
from ptt.show.studio.results import ORDER
from ptt.show.studio.units import unit_in_words

WORDS = {  # quantity as in a mapping file -> in words
    **{f"{a}_meas": f"reading {a}" for a in "xyz"},
    **{f"{a}_cmd": f"target {a}" for a in "xyz"},
    **{f"{a}_std": f"scatter of {a}" for a in "xyz"},
    "name": "name of the point",
    "role": "role (pose, base, datum)",
    "run": "run",
    "repeat": "repeat",
    "time": "time",
    "payload": "payload",
    "temp": "temperature",
    "feed": "feed",
    **{f"q{a}_meas": f"orientation {a}, read" for a in "xyzw"},
    **{f"q{a}_cmd": f"orientation {a}, wanted" for a in "xyzw"},
}


def choices_of(joints: int, prefix: str) -> dict[str, str]:
    """Quantities that a column may hold for a machine: name as in a mapping file -> in words."""
    who = "joint" if prefix == "q" else "slider"
    each = range(1, joints + 1)
    sent = {f"{prefix}{i}_cmd": f"command of {who} {i}" for i in each}
    more = {f"dir{i}": f"direction of {who} {i}" for i in each} | {
        f"tau{i}": f"force or torque of {who} {i}" for i in each
    }
    return {IGNORE: "\N{EN DASH} not used"} | WORDS | sent | more


class ColumnsView:
    """The grid, the question above it, and the button that opens it; it opens by itself for a question on columns."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.quantity: dict[str, ui.select] = {}
        self.unit: dict[str, ui.toggle] = {}
        self.asked = box().mark("question")
        with box().mark("columns") as self.box:
            ui.html("What the columns hold", sanitize=False, tag="h2").classes("st-title")
            self.note = note()
            self.grid = grid()
            with tools().style("margin-top: 8px"):
                ui.button("Read it so", icon="check", on_click=self._save).props("no-caps unelevated")
                ui.button("Close", on_click=lambda: self.box.set_visibility(False)).props("no-caps flat")
            note("The answers are kept as columns.toml; the command line reads them with --map.")
        with box() as self.offer:
            ui.button("Check the columns", icon="view_column", on_click=self._fill).props("no-caps flat dense")
        self.box.set_visibility(False)
        self.asked.set_visibility(False)
        studio.on("staged", self._staged)
        studio.on("session", self._offer)
        self._offer()

    def _offer(self) -> None:
        self.offer.set_visibility(bool(self.studio.staged.source or self.studio.session.source))

    def _staged(self) -> None:
        self._offer()
        self.asked.clear()
        self.asked.set_visibility(self.studio.staged.question is not None)
        question = self.studio.staged.question
        if question is None or question.about == ORDER:
            self.box.set_visibility(False)
        if question is None:
            return
        with self.asked:
            show_question(question.about, question.question, question.choices, self.studio.answer)
            if question.about != ORDER:
                ui.timer(0.01, self._fill, once=True)

    async def _fill(self) -> None:
        """Show the grid for the staged run, else for the open one."""
        source, _ = self.studio.at_hand
        if source is None:
            return
        found = await self.studio.work("looking at the columns", "peek", source, how="aside")
        if found is None:
            return
        self.box.set_visibility(True)
        self.note.set_text(f"{source.run}: {found['rows']} rows; {found['how']}")
        self.grid.clear()
        self.quantity.clear()
        self.unit.clear()
        with self.grid, ui.element("table").classes("st-plain st-stack"):
            with ui.element("thead"), ui.element("tr"):
                for title in ("column", "first rows", "holds", "unit"):
                    ui.html(title, sanitize=False, tag="th").classes("w").props("scope=col")
            with ui.element("tbody"):
                for column in found["columns"]:
                    self._row(column)

    def _row(self, column: Mapping[str, Any]) -> None:
        title = column["title"]
        joints, prefix = self._machine()
        choices = choices_of(joints, prefix)
        value = column["quantity"] if column["quantity"] in choices else IGNORE
        with ui.element("tr"):
            with ui.element("td").classes("w"):
                ui.label(title).classes("font-medium")
            with ui.element("td").classes("w"):
                note(BETWEEN.join(cell[:10] for cell in column["cells"][:3]))
            with ui.element("td").classes("w"):
                pick = ui.select(choices, value=value, on_change=lambda _, t=title: self._units(t, stated_unit(t)))
                pick.props("dense outlined options-dense").props["aria-label"] = f"what {title} holds"
                self.quantity[title] = pick.classes("w-48")
            with ui.element("td").classes("w"):
                chips = ui.toggle([]).props("dense no-caps unelevated size=sm toggle-color=primary")
                chips.props["aria-label"] = f"unit of {title}"
                self.unit[title] = chips
        self._units(title, column["unit"])

    def _units(self, title: str, known: str | None) -> None:
        """Offer the units that suit what a column holds, and choose one if it is among them."""
        units = {
            unit: unit_in_words(unit) for unit in UNITS.get(dimension_of(str(self.quantity[title].value)), {}) if unit
        }
        self.unit[title].set_options(units, value=known if known in units else next(iter(units), None))
        self.unit[title].set_visibility(bool(units))

    def _machine(self) -> tuple[int, str]:
        _, text = self.studio.at_hand
        spec = parse_machine(text, "machine.toml").machine if text else None
        return (spec.joints, spec.letter) if spec is not None else (3, "b")

    async def _save(self) -> None:
        source, _ = self.studio.at_hand
        if source is None:
            return
        quantities = {title: str(pick.value) for title, pick in self.quantity.items()}
        units = {title: str(chips.value) for title, chips in self.unit.items() if chips.value}
        units = {title: unit for title, unit in units.items() if quantities[title] != IGNORE}
        made = await self.studio.work("keeping the answers", "columns", source, quantities, units)
        if made is None:
            return
        self.box.set_visibility(False)
        _, machine = self.studio.at_hand
        if machine:
            await self.studio.open(made, machine, "Result")
        else:
            self.studio.stage(source=made)
