"""Why: the card of an effect with this run's data and the fit through it, its values on a ruler, cause and cure."""

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from ptt.show.card.words import how_sure, pretty, value_in_words
from ptt.show.studio.card_figures import fit_figure, ruler_html, sign_figure
from ptt.show.studio.controller import Studio

PARTS = (
    ("Cause", "cause"), ("Shows as", "fingerprint"), ("Equation", "equation"), ("Usual size", "size"),
    ("Mended by", "remedy"), ("Needs", "needs"), ("Source", "source"),
)  # fmt: skip


async def open_effect(studio: Studio, key: str) -> None:
    """Open the card of an effect.

    Args:
        studio: of this session.
        key: of the effect.
    """
    with (
        studio.client,
        ui.dialog().props("transition-duration=80") as dialog,
        ui.card().style("max-width: 860px; width: 94vw; background: var(--card)"),
    ):
        with ui.element("div").classes("st-tools").style("flex-wrap: nowrap"):
            ui.html(key.replace("-", " "), sanitize=False, tag="h2").classes("st-title")
            ui.space()
            ui.button(icon="close", on_click=dialog.close).props('flat round dense aria-label="close"')
        body = ui.element("div").classes("w-full").mark("effect-card")
        with body:
            fit, finding = _own(studio, key)
            if finding is not None:
                _show_finding(finding, fit)
            waiting = ui.spinner()
    dialog.open()
    source = studio.session.source
    files = () if source is None else source.effect_files
    card = await studio.work(f"card of {key}", "card", key, studio.session.kind, files, how="aside")
    waiting.delete()
    if card is not None:
        with body:
            _show_card(card, own=fit is not None)


def _own(studio: Studio, key: str) -> tuple[Mapping[str, Any] | None, Mapping[str, Any] | None]:
    """Data with fit, and finding, of the last diagnosis that has the effect."""
    session = studio.session
    for text in (session.text, *(snapshot.active for snapshot in reversed(session.past))):
        lesson = session.lessons.get(text)
        if lesson is not None and key in lesson.fits:
            return lesson.fits[key], next((one for one in lesson.card["findings"] if one["effect"] == key), None)
    return None, None


def _show_finding(finding: Mapping[str, Any], fit: Mapping[str, Any] | None) -> None:
    if finding["tie"]:
        ui.label(finding["tie"]).classes("st-tie font-medium")
    ui.label(finding["words"]).style("font-size: 15px")
    ui.label(f"{how_sure(finding['probability'])} that it is part of what is missing").classes("st-note")
    if fit is not None:
        plot = ui.plotly(fit_figure(fit)).style("width: 100%; height: 280px")
        plot.props("role=img").props["aria-label"] = f"readings and the fit of {finding['effect']}"
        ui.label(
            "This run, everything else taken out: pale what is left without the effect, orange what it explains."
        ).classes("st-note")
    for value in finding["values"]:
        with ui.element("div").classes("st-value"):
            ui.label(f"{value['who']} {value['text']} ({value_in_words(value)})").style("font-size: 14px")
            ui.html(ruler_html(value), sanitize=False)
            if value["worth"] > 10.0:
                ui.label("off the usual scale").classes("st-tie")


def _show_card(card: Mapping[str, Any], own: bool) -> None:
    if not own:
        plot = ui.plotly(sign_figure(card["sign"])).style("width: 100%; height: 250px")
        plot.props("role=img").props["aria-label"] = f"sign of {card['effect']}"
        ui.label("Its sign at usual size on the sample machine, no noise: the run was not fitted with it.").classes(
            "st-note"
        )
    for title, key in PARTS:
        if card[key] not in ("-", ""):
            ui.label(title).classes("font-medium").style("font-size: 13px; margin-top: 4px")
            ui.label(pretty(card[key])).classes("st-note")
    if card["confused_with"]:
        ui.label("Confused with").classes("font-medium").style("font-size: 13px; margin-top: 4px")
        for other, test in card["confused_with"]:
            ui.label(f"{other}: {test}").classes("st-note")
