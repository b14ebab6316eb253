"""Tools on the view Finish: poses to measure, figures of ISO 9283, dexterity, and the model's history."""

import base64
from collections.abc import Mapping
from typing import Any

from nicegui import ui

from ptt.show.card.words import length
from ptt.show.studio.controller import Studio
from ptt.show.studio.tables import table_html
from ptt.show.studio.tool_tables import dexterity_html, iso_html, plan_html, plan_in_words


def build_tools(studio: Studio) -> None:
    """Build the boxes.

    Args:
        studio: of this session.
    """
    with ui.element("div").classes("st-box"):
        ui.html("Poses to measure", sanitize=False, tag="h2").classes("st-head")
        _build_plan(studio)
    with ui.element("div").classes("st-box"):
        ui.html("Figures of the standard (ISO 9283)", sanitize=False, tag="h2").classes("st-head")
        _build_iso(studio)
    with ui.element("div").classes("st-box"):
        ui.html("Dexterity over the workspace", sanitize=False, tag="h2").classes("st-head")
        _build_dexterity(studio)
    with ui.element("div").classes("st-box"):
        ui.html("History of the model", sanitize=False, tag="h2").classes("st-head")
        _build_history(studio)


def _build_plan(studio: Studio) -> None:
    with ui.element("div").classes("st-tools"):
        rows = ui.number("rows", value=200, min=12, max=5000, precision=0).props("dense outlined").classes("w-24")
        loads = ui.input("payloads [kg]", placeholder="0,2.5,5").props("dense outlined").classes("w-36")
        make = ui.button("Plan", icon="route").props("no-caps outline")
    told, body = ui.label().classes("st-note"), _table()

    async def plan() -> None:
        session = studio.session
        if not session.ready:
            return
        found = await studio.work(
            "choosing poses", "plan", session.text, int(rows.value or 200), str(loads.value or "")
        )
        if found is not None:
            told.set_text(plan_in_words(found["told"]))
            body.set_content(plan_html(found["told"]))
            ui.download.content(found["csv"], "targets.csv")

    make.on_click(plan)
    _enabled(studio, make)


def _table() -> ui.html:
    """An element for a table, which scrolls where it is too wide."""
    with ui.element("div").classes("st-grid").props("tabindex=0"):
        return ui.html("", sanitize=False).classes("w-full")


def _build_iso(studio: Studio) -> None:
    make = ui.button("Compute them", icon="straighten").props("no-caps outline")
    told, body = ui.label().classes("st-note"), _table()

    async def work() -> None:
        session = studio.session
        if not session.ready:
            return
        found = await studio.work("figures of the standard", "iso", session.source, session.text)
        if found is not None:
            told.set_text(str(found["standard"]))
            body.set_content(iso_html(found))

    make.on_click(work)
    _enabled(studio, make)


def _build_dexterity(studio: Studio) -> None:
    make = ui.button("Compute it", icon="open_with").props("no-caps outline")
    body = _table()
    picture = ui.html("", sanitize=False).classes("w-full")

    async def work() -> None:
        session = studio.session
        if not session.ready:
            return
        found = await studio.work("condition number over the workspace", "dexterity", session.text)
        if found is not None:
            body.set_content(dexterity_html(found["figures"]))
            png = base64.b64encode(found["png"]).decode()
            picture.set_content(
                f'<img alt="condition number over the workspace" style="width:100%" src="data:image/png;base64,{png}">'
            )

    make.on_click(work)
    _enabled(studio, make)


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
                ui.label("Nothing was added, removed or refitted yet.").classes("st-note")
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


def _enabled(studio: Studio, button: ui.button) -> None:
    """Keep a button enabled only while a session is open and idle."""

    def update() -> None:
        button.set_enabled(studio.session.ready and studio.idle)

    studio.on("session", update)
    studio.on("busy", update)
    update()
