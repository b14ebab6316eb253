"""The list of later runs on the view Again: each with its date, where that comes from, and obstacles to reading it."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import date
from typing import Any

from nicegui import ui

from ptt.show.studio.controller import Studio
from ptt.show.studio.later import DATE, before_first, date_in, date_origin, later_source
from ptt.show.studio.page_question import show_question
from ptt.show.studio.page_upload import upload_box
from ptt.show.studio.parts import note, tools, warning
from ptt.show.studio.uploads import keep_upload


class LaterRuns:
    """The list of later runs."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.troubles: dict[str, Mapping[str, Any]] = {}  # file -> obstacle, as the job `vet` returns it
        self.listed: object = None  # the state that is shown
        with tools().style("flex-wrap: nowrap; margin-top: 6px"):
            label = "Later run (CSV, TXT): drop here"
            self.drop = upload_box(studio, label, "later", self._take, choose="choose later runs", multiple=True)
        self.runs = ui.element("div").classes("w-full").style("margin-top: 6px").mark("later")

    def show(self) -> None:
        """Take over a changed session."""
        session = self.studio.session
        self.drop.set_enabled(session.ready)
        now = session.source, session.first, session.later, session.said, dict(self.troubles)
        if self.listed != now:
            self.listed = now
            self.runs.clear()
            with self.runs:
                self._list()

    def tell(self, left: Sequence[Mapping[str, Any]]) -> None:
        """Show obstacles to reading runs, and that there are none for the others.

        Args:
            left: what the job `vet` returns for each run that was left out.
        """
        self.troubles = {each["run"]: each for each in left}
        self.show()

    def _list(self) -> None:
        session = self.studio.session
        if session.source is None:
            note("Load a run and its machine first.")
            return
        first = session.source.run, session.first or date_in(session.source.run)
        if words := before_first(first, session.later):
            warning(words).style("margin: 4px 0").props("role=alert").mark("early")
        said = {run for run, about, _, _ in session.said if about == DATE}
        for number, (run, when) in enumerate([first, *session.later]):
            with tools().style("flex-wrap: nowrap; margin-top: 3px"):
                with ui.element("div").style("flex: 1 1 0; min-width: 0; overflow-wrap: anywhere"):
                    ui.label(run)
                    own = bool(session.first) if number == 0 else run in said
                    note(date_origin(run, when, own))
                day = ui.input(value=when, on_change=lambda event, at=number: self._date(at, str(event.value)))
                day.props("type=date dense outlined").props["aria-label"] = f"date of {run}"
                drop = ui.button(icon="close", on_click=lambda at=number: self._drop(at)).props("flat round dense")
                drop.props["aria-label"] = f"leave {run} out"
                if number == 0:
                    drop.style("visibility: hidden")
            if number and run in self.troubles:
                self._trouble(self.troubles[run])

    def _trouble(self, trouble: Mapping[str, Any]) -> None:
        """Show why a run is left out, or the question that has to be answered before it can be read."""
        if not trouble["question"]:
            warning(f"Left out. {trouble['why']}").props("role=alert")
            return

        async def answer(choice: str) -> None:
            session, run = self.studio.session, str(trouble["run"])
            self._keep(said=(*session.said, (run, trouble["about"], trouble["question"], choice)))
            await self._vet(run)

        show_question(trouble["about"], trouble["question"], trouble["choices"], answer)

    async def _take(self, name: str, data: bytes) -> None:
        kept = keep_upload(self.studio.folder, name, data)
        later = dict(self.studio.session.later)
        later.setdefault(kept, date_in(name))
        self._keep(later=tuple(sorted(later.items(), key=lambda each: each[1])))
        await self._vet(kept)

    async def _vet(self, run: str) -> None:
        """Try to open a run, so that obstacles are shown beside it at once and not when all are compared."""
        session = self.studio.session
        if session.source is None:
            return
        own = later_source(session.source, run, session.said)
        found = await self.studio.work(f"reading {run}", "vet", own, session.text, how="quiet")
        if found is not None:
            self.tell([*(each for each in self.troubles.values() if each["run"] != run), *([found] if found else [])])

    def _date(self, at: int, when: str) -> None:
        with suppress(ValueError):
            date.fromisoformat(when)
            session = self.studio.session
            if at == 0:
                self._keep(first=when)
                return
            later = list(session.later)
            run = later[at - 1][0]
            later[at - 1] = run, when
            others = [each for each in session.said if each[:2] != (run, DATE)]
            self._keep(later=tuple(later), said=(*others, (run, DATE, "", when)))

    def _drop(self, at: int) -> None:
        session = self.studio.session
        run = session.later[at - 1][0]
        self.troubles.pop(run, None)
        said = tuple(each for each in session.said if each[0] != run)
        self._keep(later=session.later[: at - 1] + session.later[at:], said=said)

    def _keep(self, **changed: Any) -> None:
        self.studio.session = replace(self.studio.session, **changed)
        self.studio.tell("session")
