"""The view Result: verdict, bar of the error, findings with their cures, and the picture of the machine."""

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from ptt.effects.phrases import capital, smaller_ones
from ptt.fitting.chunks import LONG
from ptt.show.card.bar import COLOURS, MOST_FINDINGS, bar_html
from ptt.show.card.words import how_sure, length
from ptt.show.studio.controller import DIAGNOSING, Studio
from ptt.show.studio.page_effect import EffectCards
from ptt.show.studio.page_machine_picture import MachinePicture
from ptt.show.studio.page_others import OthersView
from ptt.show.studio.page_unknown import UnknownView
from ptt.show.studio.parts import box, column, note, tools, warning
from ptt.show.studio.results import Diagnosed

ICONS = {"missing": "lightbulb", "nothing-missing": "check_circle", "unknown": "help"}


class ResultView:
    """The view of a diagnosis: verdict, findings, and the machine."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.cards = EffectCards(studio)
        self.filled: Diagnosed | None = None
        self.adds: dict[str, tuple[ui.button, ui.label]] = {}
        self.rows: dict[str, ui.element] = {}
        with ui.element("div").classes("st-two st-wide-right"):
            with column():
                with box():
                    self._build_head()
                    self.card = ui.element("div").classes("w-full").mark("card")
                    self.next = tools().style("margin-top: 10px")
                    with self.next:
                        self._build_next()
                UnknownView(studio)
                OthersView(studio, self.add, self.cards)
            with box().classes("st-col"):
                self.picture = MachinePicture(studio)
        studio.when("Result", "session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _build_head(self) -> None:
        with ui.element("div").classes("st-tools st-line"):
            self.icon = ui.icon("troubleshoot", size="30px", color="primary").props('aria-hidden="true"')
            self.title = (
                ui.html("", sanitize=False, tag="h2").classes("st-title").mark("verdict").props("aria-live=polite")
            )
            self.title.style("flex: 1 1 200px; min-width: 0")
            self.sure = ui.label().classes("st-chip").mark("sure")
        self.words = ui.label().mark("words")
        self.find = ui.button("Find what is missing", icon="search", on_click=self.studio.diagnose).props(
            "no-caps unelevated"
        )

    def _build_next(self) -> None:
        self.all = ui.button("Add all", icon="done_all", on_click=self._add_all).props("no-caps unelevated")
        self.whole = ui.button("Add with all sizes of the drawing", icon="architecture", on_click=self._add_whole)
        self.whole.props("no-caps outline").tooltip("They improve commands outside the measured region")
        self.poses = ui.button("Poses to measure next (CSV)", icon="download", on_click=self._give_poses).props(
            "no-caps outline"
        )
        self.finish = ui.button("Take it to the machine", icon="task_alt", on_click=lambda: self.studio.go("Finish"))
        self.finish.props("no-caps outline")

    def diagnosis(self) -> tuple[Diagnosed | None, bool]:
        """The diagnosis to show (of the active model, else of the latest before it), and whether it is an older one."""
        session = self.studio.session
        if session.diagnosis is not None:
            return session.diagnosis, False
        before = (snapshot.active for snapshot in reversed(session.past))
        return next((session.diagnoses[text] for text in before if text in session.diagnoses), None), True

    def _enable(self) -> None:
        session, busy = self.studio.session, self.studio.busy
        diagnosis, _ = self.diagnosis()
        looking = busy is not None and busy.words.startswith(DIAGNOSING)
        self.find.set_visibility(session.ready and session.diagnosis is None and not looking)
        self.find.set_enabled(self.studio.idle)
        self.all.set_enabled(self.studio.idle)
        self.whole.set_enabled(self.studio.idle)
        if diagnosis is None:
            self._empty(looking)

    def _empty(self, looking: bool) -> None:
        """Show, before there is a diagnosis, what to do or what is being done."""
        session = self.studio.session
        self.sure.set_visibility(False)
        rows = session.look.rows if session.look else 0
        if looking:
            self._say(
                "Looking for what is missing",
                "The machine on the right shows the errors meanwhile; arrows are means of readings.",
                "hourglass_top",
            )
        elif not session.ready:
            self._say("Nothing to show yet", "Load a run and its machine, or try the sample.", "upload_file")
        elif rows > LONG:
            self._say("Not diagnosed yet", f"{rows:,} rows take a few minutes; begin when you are ready.", "search")
        else:
            self._say("Not diagnosed yet", "", "search")

    def _say(self, title: str, words: str, icon: str) -> None:
        if self.title.content != title:
            self.title.set_content(title)
        self.words.set_text(words)
        self.icon.set_name(icon)

    def show(self) -> None:
        """Take over a changed session; the card is built again only for another diagnosis."""
        diagnosis, stale = self.diagnosis()
        self._enable()
        self.next.set_visibility(diagnosis is not None)
        if diagnosis is None:
            self.card.clear()
            self.filled = None
            self.picture.show(None)
            return
        card = diagnosis.card
        if diagnosis is not self.filled:
            self.filled = diagnosis
            self.card.clear()
            self.adds.clear()
            self.rows.clear()
            with self.card:
                self._fill(diagnosis)
            self._say(card["title"], self._told(card), ICONS[card["verdict"]])
            self.sure.set_text(f"this verdict: {how_sure(card['probability'])}")
            self.sure.set_visibility(True)
            self.picture.show(diagnosis)
            self.cards.prepare(diagnosis)
        there, left = {entry.key for entry in self.studio.session.effects}, self._left()
        for key, (button, chip) in self.adds.items():
            button.set_visibility(key not in there)
            chip.set_visibility(key in there)
        self.all.set_visibility(len(left) > 1)
        self.whole.set_visibility(bool(left and diagnosis.sizes))
        self.poses.set_visibility(bool(diagnosis.measure_next))
        self.finish.set_visibility(not left and card["verdict"] != "unknown")
        if stale:
            self.words.set_text("The model has changed since; this was found before the change.")
        elif self.words.text != self._told(card):
            self.words.set_text(self._told(card))

    def _told(self, card: Mapping[str, Any]) -> str:
        """The words of the card, with the error before the first step if there was one."""
        began = self.studio.session.began_um
        return f"{card['words']} It began with {length(began['total'])}." if began else str(card["words"])

    def _fill(self, diagnosis: Diagnosed) -> None:
        card = diagnosis.card
        ui.html(bar_html(card), sanitize=False).classes("w-full").style("margin: 10px 0").mark("bar")
        for number, finding in enumerate(card["findings"][:MOST_FINDINGS]):
            self._finding(finding, number)
        more = card["findings"][MOST_FINDINGS:]
        if more:
            with ui.expansion(smaller_ones(len(more))).classes("w-full").props("dense"):
                for number, finding in enumerate(more, MOST_FINDINGS):
                    self._finding(finding, number)
        if card["measure_next"]:
            with ui.element("div").classes("st-tie").style("margin-top: 8px"):
                ui.label("What to measure next").classes("font-medium")
                for line in card["measure_next"]:
                    note(line)

    def _finding(self, finding: Mapping[str, Any], number: int) -> None:
        key = finding["effect"]
        colour = COLOURS[number % len(COLOURS)]
        with (
            ui.element("div")
            .classes("st-finding")
            .style(f"margin-top: 8px; border-left-color: {colour}")
            .mark(f"finding {key}") as row
        ):
            self.rows[key] = row
            if finding["tie"]:
                ui.label(finding["tie"]).classes("st-tie font-medium").mark("tie")
            ui.label(finding["words"]).style("font-size: 15.5px; font-weight: 500")
            if finding["cure"]:
                with ui.element("div").classes("st-step st-cure"):
                    ui.icon("build", size="17px").props('aria-hidden="true"')
                    ui.label(f"{capital(finding['cure'])}.")
            if finding["off_scale"]:
                warning("Far beyond what is usual: look at the drawing and the units too.")
            with tools().style("margin-top: 4px"):
                ui.label(f"a cause: {how_sure(finding['probability'])}").classes("st-chip")
                ui.label(
                    f"held-out error {length(finding['before_um'])} \N{RIGHTWARDS ARROW} {length(finding['after_um'])}"
                ).classes("st-chip")
                with ui.element("div").classes("st-finding-tools"):
                    self._buttons(key)

    def _buttons(self, key: str) -> None:
        show = ui.button("On the machine", icon="my_location", on_click=lambda: self._point(key))
        show.props("flat dense no-caps size=sm").props["aria-label"] = f"show {key} on the machine"
        why = ui.button("Why", icon="query_stats").props("flat dense no-caps size=sm")
        why.props["aria-label"] = f"card of {key}"
        self.cards.open_on(why, key)
        add = ui.button("Add", icon="add", on_click=lambda: self.add(key))
        add.props("dense no-caps unelevated size=sm").props["aria-label"] = f"add {key}"
        add.style("padding: 0 10px")
        self.adds[key] = add, ui.label("in the model").classes("st-chip")

    def _point(self, key: str) -> None:
        """Show a finding on the machine."""
        for name, row in self.rows.items():
            row.classes(add="st-chosen") if name == key else row.classes(remove="st-chosen")
        self.picture.point(key)

    async def add(self, key: str) -> None:
        """Add an effect to the model, and diagnose again."""
        await self.studio.change("add", key)

    def _left(self) -> list[str]:
        """Keys of findings that are not in the model yet."""
        diagnosis, _ = self.diagnosis()
        there = {entry.key for entry in self.studio.session.effects}
        found = [] if diagnosis is None else [one["effect"] for one in diagnosis.card["findings"]]
        return [key for key in found if key not in there]

    async def _add_all(self) -> None:
        await self.studio.change("add", *self._left())

    async def _add_whole(self) -> None:
        """As `ptt add ... --sizes`."""
        diagnosis, _ = self.diagnosis()
        if diagnosis is not None:
            await self.studio.change("add", *self._left(), *diagnosis.sizes)

    def _give_poses(self) -> None:
        diagnosis, _ = self.diagnosis()
        if diagnosis is not None:
            ui.download.content(diagnosis.measure_next, "measure_next.csv")
