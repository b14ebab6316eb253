"""Tools on the view Finish: poses to measure, figures of ISO 9283, dexterity, and the model's history."""

import base64
from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui

from ptt.show.card.words import length
from ptt.show.studio.controller import Studio
from ptt.show.studio.parts import box, note, table, tools
from ptt.show.studio.session import Session
from ptt.show.studio.tables import table_html
from ptt.show.studio.tool_tables import dexterity_html, iso_html, plan_html, plan_in_words


def build_tools(studio: Studio) -> None:
    """Build the boxes."""
    with box("Poses to measure"):
        _build_plan(studio)
    with box("Figures of the standard (ISO 9283)"):
        _build_iso(studio)
    with box("Dexterity over the workspace"):
        _build_dexterity(studio)
    with box("History of the model"):
        _build_history(studio)


def _build_plan(studio: Studio) -> None:
    with tools():
        rows = ui.number("rows", value=200, min=12, max=5000, precision=0).props("dense outlined").classes("w-24")
        loads = ui.input("payloads [kg]", placeholder="0,2.5,5").props("dense outlined").classes("w-36")
        make = ui.button("Plan", icon="route")
    told, body = note(), table()

    def fill(found: Mapping[str, Any]) -> None:
        told.set_text(plan_in_words(found["told"]))
        body.set_content(plan_html(found["told"]))
        ui.download.content(found["csv"], "targets.csv")

    def asked(session: Session) -> tuple[object, ...]:
        return session.source, session.text, int(rows.value or 200), str(loads.value or "")

    _works(studio, make, "choosing poses", "plan", asked, fill)


def _build_iso(studio: Studio) -> None:
    make = ui.button("Compute them", icon="straighten")
    told, body = note(), table()

    def fill(found: Mapping[str, Any]) -> None:
        told.set_text(str(found["standard"]))
        body.set_content(iso_html(found))

    _works(studio, make, "figures of the standard", "iso", lambda session: (session.source, session.text), fill)


def _build_dexterity(studio: Studio) -> None:
    make, words = ui.button("Compute it", icon="open_with"), "condition number over the workspace"
    body = table()
    picture = ui.html("", sanitize=False).classes("w-full")

    def fill(found: Mapping[str, Any]) -> None:
        body.set_content(dexterity_html(found["figures"]))
        png = base64.b64encode(found["png"]).decode()
        picture.set_content(f'<img alt="{words}" style="width:100%" src="data:image/png;base64,{png}">')

    _works(studio, make, words, "dexterity", lambda session: (session.source, session.text), fill)


def _works(
    studio: Studio,
    button: ui.button,
    words: str,
    job: str,
    asked: Callable[[Session], tuple[object, ...]],
    fill: Callable[[Mapping[str, Any]], None],
) -> None:
    """Let a button run a job and fill in its result; it is enabled only while a session is open and idle."""

    async def work() -> None:
        if studio.session.ready:
            found = await studio.work(words, job, *asked(studio.session))
            if found is not None:
                fill(found)

    def update() -> None:
        button.set_enabled(studio.session.ready and studio.idle)

    button.props("no-caps outline").on_click(work)
    studio.on("session", update)
    studio.on("busy", update)
    update()


def _build_history(studio: Studio) -> None:
    body = ui.element("div").classes("st-grid st-whole w-full").props("tabindex=0")
    shown: list[object] = []

    def update() -> None:
        now = studio.session.now
        if shown == [now]:
            return
        shown[:] = [now]
        body.clear()
        rows = [] if now is None else [_entry(item) for item in now.file.history]
        with body:
            if not rows:
                note("Nothing was added, removed or refitted yet.")
                return
            head = ("date", "command", "effect", "readings", "held-out error", "noise")
            ui.html(table_html(head, rows, words=3, caption="steps of the model"), sanitize=False).classes("w-full")

    studio.when("Finish", "session", update)
    update()


def _entry(item: Mapping[str, Any]) -> tuple[str, ...]:
    """A row of the table for a step of the machine file's history."""
    changed = [*item.get("added", ()), *(f"less {key}" for key in item.get("removed", ()))]
    before, after, noise = (item.get(key) or {} for key in ("heldout_before_um", "heldout_after_um", "noise_um"))
    known = "total" in before and "total" in after
    fall = f"{length(before['total'])} \N{RIGHTWARDS ARROW} {length(after['total'])}" if known else ""
    return (
        str(item.get("date", ""))[:10],
        str(item.get("command", "")),
        ", ".join(changed) or "refit",
        str(item.get("rows", "")),
        fall,
        length(noise["total"]) if "total" in noise else "",
    )
