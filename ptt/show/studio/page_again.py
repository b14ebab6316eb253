"""The view Again: later runs of the same machine compared with the first one, with the model, and by date."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from nicegui import ui

from ptt.errors import PttError
from ptt.files import write_text
from ptt.judge.aimed import lent_in_words
from ptt.run.axes import AXES_TOTAL
from ptt.show.card.words import length, parameter_in_words, percent, pretty, together
from ptt.show.studio.controller import Studio
from ptt.show.studio.figures_again import WHEN, error_figure, pair_figure, value_figure
from ptt.show.studio.later import date_in, later_source
from ptt.show.studio.page_later import LaterRuns
from ptt.show.studio.parts import box, column, heading, note, table, tools, warning
from ptt.show.studio.picture import Picture
from ptt.show.studio.tables import table_html

FOUND = "again.json"  # file in the session's folder with the last comparison
TIE = "cannot tell them apart"  # words of the library by which a line on a tie is recognised
EMPTY = (
    "Measure the machine again, with corrected commands or a month later, and drop the run here: errors before and "
    "after side by side, what has changed since, and every value by date."
)
VERDICTS = {
    "same": "Nothing has changed since the model was made",
    "changed": "The machine has changed",
    "new": "Something is new that the model does not have",
}


class AgainView:
    """The view: list of later runs, before and after, what has changed, values by date."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.shown = ""
        with ui.element("div").classes("st-two st-wide-right"):
            with column():
                with box():
                    self._build_runs()
                self.changed = box().mark("changed")
            self.right = column()
        studio.when("Again", "session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _build_runs(self) -> None:
        heading("Measured again")
        self.runs = LaterRuns(self.studio)
        with tools().style("margin-top: 6px"):
            self.hold = ui.button("Compare the runs", icon="compare", on_click=self._work)
            self.hold.props("no-caps unelevated")

    def _enable(self) -> None:
        session = self.studio.session
        self.hold.set_enabled(session.ready and self.studio.idle and bool(session.later))

    def show(self) -> None:
        """Take over a changed session."""
        self._enable()
        self.runs.show()
        key = self._key()
        if key != self.shown:
            self.shown = key
            self._fill(self._known())

    async def _work(self) -> None:
        session, key = self.studio.session, self._key()
        if session.source is None or not session.later:
            return
        first = session.first or date_in(session.source.run)
        dated = sorted(session.later, key=lambda each: each[1])
        later = tuple((later_source(session.source, run, session.said), when) for run, when in dated)
        found = await self.studio.work("comparing runs", "again", session.source, session.text, first, later)
        if found is not None:
            with suppress(PttError):  # a full disk: it is shown all the same
                write_text(self.studio.folder / FOUND, json.dumps({"key": key, "found": found}))
            if key == self._key():
                self._fill(found)

    def _key(self) -> str:
        """Digest of everything that the comparison depends on; '' without a run."""
        session = self.studio.session
        if session.source is None:
            return ""
        said = json.dumps([asdict(session.source), session.text, session.first, session.later, session.said])
        return hashlib.sha256(said.encode()).hexdigest()

    def _known(self) -> Mapping[str, Any] | None:
        """The saved comparison, if it is of these runs, answers and model."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            kept = json.loads((self.studio.folder / FOUND).read_text(encoding="utf-8"))
            return dict(kept["found"]) if kept["key"] == self._key() else None
        return None

    def _fill(self, found: Mapping[str, Any] | None) -> None:
        self.changed.clear()
        self.right.clear()
        self.changed.set_visibility(found is not None)
        if found is not None:
            self.runs.tell(found.get("left", ()))
        with self.right:
            if found is None:
                with box(), ui.element("div").classes("st-empty"):
                    ui.icon("compare", size="42px")
                    ui.label(EMPTY)
                return
            _show_pair(found["pair"])
            _show_months(found["months"])
        with self.changed:
            _show_changed(found["recheck"])


def change(fall: float) -> str:
    """A reduction in percent as a signed change, for example '-90.0 %' with a minus sign."""
    return together(f"{-fall:+.1f} %".replace("-", "\N{MINUS SIGN}"))


def _show_pair(pair: Mapping[str, Any]) -> None:
    with box("Before and after"):
        if "why" in pair:
            note(pretty(pair["why"]))
            return
        fall = pair["reduction_percent"]
        rows = [
            ("before", *(length(pair["before"]["rms_um"][axis]) for axis in AXES_TOTAL)),
            ("after", *(length(pair["after"]["rms_um"][axis]) for axis in AXES_TOTAL)),
            ("change", *("\N{EN DASH}" if fall[axis] is None else change(fall[axis]) for axis in AXES_TOTAL)),
        ]
        caption = "error of the tool against its targets"
        ui.html(
            table_html(("tool against its targets, rms", *AXES_TOTAL), rows, caption=caption), sanitize=False
        ).classes("w-full")
        times = pair["arrows"]["times"]
        told = f"From above; errors {times:,.0f} times enlarged, one scale for both; {pretty(pair['frame'])}."
        if pair["shared_poses"]:
            share = f"{percent(pair['nearer_share'])} of {pair['shared_poses']} readings at poses measured in both"
            told += f" {share} are nearer to their targets."
        if lent := lent_in_words(pair["targets_from_before"]):
            told += f" {lent}."
        note(told)
        with ui.element("div").style("display: flex; flex-wrap: wrap; gap: 8px; width: 100%"):
            for when, run in zip(WHEN, pair["runs"], strict=True):
                with ui.element("div").style("flex: 1 1 280px; min-width: 0"):
                    ui.label(f"{when}: {run}, {pair[when]['rows']} readings").classes("font-medium")
                    plot = Picture(f"errors {when}, from above", pair_figure(pair, when))
                    plot.classes("w-full").style("height: 290px")


def _show_changed(recheck: Mapping[str, Any]) -> None:
    heading("Has the machine changed?")
    if "why" in recheck:
        note(pretty(recheck["why"]))
        return
    ui.label(VERDICTS.get(recheck["verdict"], recheck["verdict"])).classes("font-medium")
    for line in recheck["words"].splitlines():  # as `ptt recheck` prints it
        ui.label(pretty(line)).classes("st-tie" if TIE in line else "st-note").style("margin: 3px 0")
    if recheck["changed"]:
        rows = [_changed(one) for one in recheck["changed"]]
        head = ("value", "before", "now", "")
        table(table_html(head, rows, caption="values that have changed"))


def _changed(one: Mapping[str, Any]) -> tuple[str, ...]:
    largest = max(abs(one["before"]), abs(one["now"]), one["std"])
    name, before, _ = parameter_in_words(one["parameter"], one["before"], None, largest)
    _, now, error = parameter_in_words(one["parameter"], one["now"], one["std"], largest)
    return f"{one['effect']} {name}", before, now, error


def _show_months(months: Mapping[str, Any]) -> None:
    with box("By date").mark("months"):
        if "why" in months:
            note(pretty(months["why"]))
            return
        for words in months.get("refused", ()):
            warning(pretty(f"Left out: {words}")).style("margin: 4px 0")
        for words in dict.fromkeys(alarm["words"] for alarm in months["alarms"]):  # alarms may share words
            warning(pretty(words)).style("margin: 4px 0")
        plot = Picture("error with the model by date", error_figure(months["history"]))
        plot.classes("w-full").style("height: 210px")
        for value in months["values"]:
            ui.label(f"{value['label']}{', moves' if value['moves'] else ''}").classes("font-medium")
            plot = Picture(f"{value['label']} by date", value_figure(value)).classes("w-full").style("height: 150px")
        rows = [
            (
                str(run["date"])[:10],
                run["file"],
                run["verdict"] or "",
                "" if run["error_um"] is None else length(run["error_um"]),
            )
            for run in months["history"]
        ]
        head = ("date", "run", "verdict", "error with the model")
        table(table_html(head, rows, words=3, caption="runs by date"))
