"""The box of mistakes in the set-up, each with its evidence and cure: to be corrected, or to go on anyway."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from nicegui import ui

from ptt.show.card.words import length, pretty
from ptt.show.studio.controller import Studio
from ptt.show.studio.parts import box, note, tools


def build_setup(studio: Studio) -> None:
    """Build the box, which is shown only while there are mistakes."""
    with box().mark("setup") as whole:
        ui.html("First the set-up: something looks wrong", sanitize=False, tag="h2").classes("st-title")
        body = ui.element("div").classes("w-full")
        with tools().style("margin-top: 10px"):
            mend = ui.button("Correct it and open", icon="build", on_click=lambda: _mend(studio))
            mend.props("no-caps unelevated")
            anyway = ui.button("Go on anyway", icon="fast_forward", on_click=lambda: _anyway(studio))
            anyway.props("no-caps outline")
        note("This writes a corrected copy beside your files, which stay as they are.")

    def update() -> None:
        whole.set_visibility(bool(studio.staged.setup))
        body.clear()
        with body:
            for finding in studio.staged.setup:
                show_finding(finding)

    def enable() -> None:
        for button in (mend, anyway):
            button.set_enabled(studio.idle)

    studio.on("staged", update)
    studio.on("busy", enable)
    update()


def show_finding(finding: Mapping[str, Any]) -> None:
    """Show a finding about the set-up: the mistake, the error before and after its correction as bars, and the cure.

    Args:
        finding: as `ptt check --json` lists it.
    """
    with ui.element("div").classes("st-finding").style("margin-top: 8px"):
        sure = "" if finding["sure"] else "perhaps "
        ui.label(f"{sure}{finding['mistake'].replace('-', ' ')}").classes("st-head")
        ui.label(pretty(finding["words"]))
        before, after = (finding["rms_um"][key] for key in ("before", "after"))
        if before and after is not None:
            for words, value in (("as it is", before), ("put right", after)):
                with tools().style("flex-wrap: nowrap; gap: 8px"):
                    note(words).style("width: 64px; flex: none")
                    share = max(0.6, 100.0 * value / max(before, after))
                    ui.element("div").style(
                        f"width: {0.7 * share:.1f}%; height: 12px; border-radius: 3px; "
                        f"background: {'#d55e00' if words == 'as it is' else '#009e73'}"
                    )
                    note(length(value)).style("white-space: nowrap")
        ui.label(f"Cure: {pretty(finding['fix'])}").classes("st-cure")


async def _mend(studio: Studio) -> None:
    staged = studio.staged
    if staged.source is None:
        return
    made = await studio.work("putting it right", "mend", staged.source, staged.machine)
    if made is not None:
        source, machine = made
        await studio.open(source, machine, "Result")


async def _anyway(studio: Studio) -> None:
    staged = studio.staged
    if staged.source is not None:
        await studio.open(replace(staged.source, anyway=True), staged.machine, "Result")
