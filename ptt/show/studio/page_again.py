"""Again: runs measured later on the same machine, held beside the first one, against the model, and by date."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import date
from typing import Any

from nicegui import events, ui

from ptt.errors import PttError
from ptt.files import write_text
from ptt.run.dates import date_in_name
from ptt.show.card.words import length, parameter_in_words, percent, pretty, together
from ptt.show.studio.controller import Studio
from ptt.show.studio.figures_again import WHEN, error_figure, pair_figure, value_figure
from ptt.show.studio.guard import LIMIT
from ptt.show.studio.picture import Picture
from ptt.show.studio.tables import table_html
from ptt.show.studio.uploads import keep

FOUND = "again.json"
AXES = ("x", "y", "z", "total")
EMPTY = (
    "Measure the machine again, with corrected commands or a month later, and drop the run here: errors before and "
    "after side by side, what has changed since, and every value by date."
)
VERDICTS = {
    "same": "Nothing has changed since the model was made",
    "changed": "The machine has changed",
    "new": "Something is there that the model does not have",
}


class AgainView:
    """The view's parts."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.listed: object = None
        self.shown = ""
        with ui.element("div").classes("st-two st-wide-right"):
            with ui.element("div").classes("st-col st-scroll").props("tabindex=0"):
                with ui.element("div").classes("st-box"):
                    self._build_runs()
                self.changed = ui.element("div").classes("st-box").mark("changed")
            self.right = ui.element("div").classes("st-col st-scroll").props("tabindex=0")
        studio.when("Again", "session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _build_runs(self) -> None:
        ui.html("Measured again", sanitize=False, tag="h2").classes("st-head")
        with ui.element("div").classes("st-tools").style("flex-wrap: nowrap; margin-top: 6px"):
            self.drop = ui.upload(
                label="Later run (CSV, TXT): drop here", on_upload=self._take, max_file_size=LIMIT, auto_upload=True,
                multiple=True, on_rejected=lambda: self.studio.fail(f"not taken: larger than {LIMIT >> 20} MB"),
            )  # fmt: skip
            self.drop.classes("st-drop st-drop-later").props("flat hide-upload-btn")
            choose = ui.button("Choose").props('no-caps outline aria-label="choose later runs"')
            choose.on("click", js_handler=f"() => getElement({self.drop.id}).pickFiles()")
        self.runs = ui.element("div").classes("w-full").style("margin-top: 6px")
        with ui.element("div").classes("st-tools").style("margin-top: 6px"):
            self.hold = ui.button("Hold them beside each other", icon="compare", on_click=self._work)
            self.hold.props("no-caps unelevated")

    def _enable(self) -> None:
        session = self.studio.session
        self.hold.set_enabled(session.ready and self.studio.idle and bool(session.later))

    def show(self) -> None:
        """Take over a changed session."""
        session = self.studio.session
        self._enable()
        self.drop.set_enabled(session.ready)
        if self.listed != (session.source, session.first, session.later):
            self.listed = session.source, session.first, session.later
            self.runs.clear()
            with self.runs:
                self._list()
        key = self._key()
        if key != self.shown:
            self.shown = key
            self._fill(self._known())

    def _list(self) -> None:
        """The runs with their dates."""
        session = self.studio.session
        if session.source is None:
            ui.label("Load a run and its machine first.").classes("st-note")
            return
        runs = [(session.source.run, session.first or date_in(session.source.run)), *session.later]
        for number, (run, when) in enumerate(runs):
            with ui.element("div").classes("st-tools").style("flex-wrap: nowrap; margin-top: 3px"):
                ui.label(run).style("flex: 1 1 0; min-width: 0; overflow-wrap: anywhere")
                day = ui.input(value=when, on_change=lambda event, at=number: self._date(at, str(event.value)))
                day.props("type=date dense outlined").props["aria-label"] = f"date of {run}"
                drop = ui.button(icon="close", on_click=lambda at=number: self._drop(at)).props("flat round dense")
                drop.props["aria-label"] = f"leave {run} out"
                if number == 0:
                    drop.style("visibility: hidden")

    async def _take(self, event: events.UploadEventArguments) -> None:
        data = await event.file.read()
        self.drop.reset()
        try:
            kept = keep(self.studio.folder, event.file.name, data)
        except PttError as error:
            self.studio.fail(str(error))
            return
        later = dict(self.studio.session.later) | {kept: date_in(event.file.name)}
        self._keep(later=tuple(sorted(later.items(), key=lambda each: each[1])))

    def _date(self, at: int, when: str) -> None:
        with suppress(ValueError):
            date.fromisoformat(when)
            if at == 0:
                self._keep(first=when)
                return
            later = list(self.studio.session.later)
            later[at - 1] = later[at - 1][0], when
            self._keep(later=tuple(later))

    def _drop(self, at: int) -> None:
        later = self.studio.session.later
        self._keep(later=later[: at - 1] + later[at:])

    def _keep(self, **changed: Any) -> None:
        self.studio.session = replace(self.studio.session, **changed)
        self.studio.tell("session")

    async def _work(self) -> None:
        session, key = self.studio.session, self._key()
        if session.source is None or not session.later:
            return
        first = session.first or date_in(session.source.run)
        later = tuple(sorted(session.later, key=lambda each: each[1]))
        found = await self.studio.work(
            "holding runs beside each other", "again", session.source, session.text, first, later
        )
        if found is not None:
            with suppress(PttError):  # a full disk: it is shown all the same
                write_text(self.studio.folder / FOUND, json.dumps({"key": key, "found": found}))
            if key == self._key():
                self._fill(found)

    def _key(self) -> str:
        """What the pictures depend on."""
        session = self.studio.session
        if session.source is None:
            return ""
        said = json.dumps([asdict(session.source), session.text, session.first, session.later])
        return hashlib.sha256(said.encode()).hexdigest()

    def _known(self) -> Mapping[str, Any] | None:
        """What was found of these runs before, where it was."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            kept = json.loads((self.studio.folder / FOUND).read_text(encoding="utf-8"))
            return dict(kept["found"]) if kept["key"] == self._key() else None
        return None

    def _fill(self, found: Mapping[str, Any] | None) -> None:
        self.changed.clear()
        self.right.clear()
        self.changed.set_visibility(found is not None)
        with self.right:
            if found is None:
                with ui.element("div").classes("st-box"), ui.element("div").classes("st-empty"):
                    ui.icon("compare", size="42px")
                    ui.label(EMPTY)
                return
            _show_pair(found["pair"])
            _show_months(found["months"])
        with self.changed:
            _show_changed(found["recheck"])


def date_in(name: str) -> str:
    """The date that a file's name holds, else today, as '2026-03-15'."""
    return (date_in_name(name) or date.today()).isoformat()


def change(fall: float) -> str:
    """A fall in percent as a change, for example '-90.0 %' with the real sign."""
    return together(f"{-fall:+.1f} %".replace("-", "\N{MINUS SIGN}"))


def _show_pair(pair: Mapping[str, Any]) -> None:
    with ui.element("div").classes("st-box"):
        ui.html("Before and after", sanitize=False, tag="h2").classes("st-head")
        if "why" in pair:
            ui.label(pretty(pair["why"])).classes("st-note")
            return
        fall = pair["reduction_percent"]
        rows = [
            ("before", *(length(pair["before"]["rms_um"][axis]) for axis in AXES)),
            ("after", *(length(pair["after"]["rms_um"][axis]) for axis in AXES)),
            ("change", *("\N{EN DASH}" if fall[axis] is None else change(fall[axis]) for axis in AXES)),
        ]
        caption = "error of the tool against its targets"
        ui.html(table_html(("tool against its targets, rms", *AXES), rows, caption=caption), sanitize=False).classes(
            "w-full"
        )
        times = pair["arrows"]["times"]
        note = f"From above; errors {times:,.0f} times enlarged, one scale for both; {pretty(pair['frame'])}."
        if pair["shared_poses"]:
            note += f" {percent(pair['nearer_share'])} of {pair['shared_poses']} poses measured in both come nearer."
        ui.label(note).classes("st-note")
        with ui.element("div").style("display: flex; flex-wrap: wrap; gap: 8px; width: 100%"):
            for when in WHEN:
                with ui.element("div").style("flex: 1 1 280px; min-width: 0"):
                    ui.label(f"{when}: {pair[when]['rows']} readings").classes("font-medium")
                    plot = Picture(pair_figure(pair, when)).classes("w-full").style("height: 290px")
                    plot.props("role=img").props["aria-label"] = f"errors {when}, from above"


def _show_changed(recheck: Mapping[str, Any]) -> None:
    ui.html("Has the machine changed?", sanitize=False, tag="h2").classes("st-head")
    if "why" in recheck:
        ui.label(pretty(recheck["why"])).classes("st-note")
        return
    ui.label(VERDICTS.get(recheck["verdict"], recheck["verdict"])).classes("font-medium")
    error = recheck["error_um"]
    ui.label(
        f"Error with the model {length(error['now'])}, where {length(error['expected'])} was to be expected."
    ).classes("st-note")
    if recheck["changed"]:
        rows = [_changed(one) for one in recheck["changed"]]
        head = ("value", "before", "now", "")
        with ui.element("div").classes("st-grid").props("tabindex=0"):
            ui.html(table_html(head, rows, caption="values that have changed"), sanitize=False).classes("w-full")


def _changed(one: Mapping[str, Any]) -> tuple[str, ...]:
    name, before, _ = parameter_in_words(one["parameter"], one["before"], None)
    _, now, error = parameter_in_words(one["parameter"], one["now"], one["std"])
    return f"{one['effect']} {name}", before, now, error


def _show_months(months: Mapping[str, Any]) -> None:
    with ui.element("div").classes("st-box").mark("months"):
        ui.html("By date", sanitize=False, tag="h2").classes("st-head")
        if "why" in months:
            ui.label(pretty(months["why"])).classes("st-note")
            return
        for words in dict.fromkeys(alarm["words"] for alarm in months["alarms"]):  # one for several values of an effect
            ui.label(pretty(words)).classes("st-tie").style("margin: 4px 0")
        plot = Picture(error_figure(months["history"])).classes("w-full").style("height: 210px")
        plot.props('role=img aria-label="error with the model by date"')
        for value in months["values"]:
            ui.label(f"{value['label']}{', moves' if value['moves'] else ''}").classes("font-medium")
            plot = Picture(value_figure(value)).classes("w-full").style("height: 150px")
            plot.props("role=img").props["aria-label"] = f"{value['label']} by date"
        rows = [
            (
                str(run["date"])[:10],
                run["file"],
                run["verdict"] or "",
                length(run["error_um"]) if run["error_um"] else "",
            )
            for run in months["history"]
        ]
        head = ("date", "run", "verdict", "error with the model")
        with ui.element("div").classes("st-grid").props("tabindex=0"):
            ui.html(table_html(head, rows, words=3, caption="runs by date"), sanitize=False).classes("w-full")
