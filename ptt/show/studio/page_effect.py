"""The card of an effect in a dialog: readings with the fit, its values on rulers, cause and remedy."""

import json
from collections.abc import Mapping
from functools import partial
from typing import Any

from nicegui import ui

from ptt.show.card.words import how_sure, pretty, value_in_words
from ptt.show.studio.card_figures import fit_figure, ruler_html, sign_figure
from ptt.show.studio.controller import Studio
from ptt.show.studio.draw_queue import BEHIND
from ptt.show.studio.parts import note, tools, warning
from ptt.show.studio.picture import Picture
from ptt.show.studio.results import Diagnosed

PARTS = (  # title, field of the card
    ("Cause", "cause"), ("Shows as", "fingerprint"), ("Equation", "equation"), ("Usual size", "size"),
    ("Mended by", "remedy"), ("Needs", "needs"), ("Source", "source"),
)  # fmt: skip
SHOW = "own ? own.open || own.showModal()"  # JavaScript that opens the dialog `own`, to be continued by ': ...'


class EffectCards:
    """The cards of one session's effects, each in a dialog of its own.

    Those of the findings are built while the page is idle, so that the browser opens them without asking the server;
    any other is built when it is opened.
    """

    def __init__(self, studio: Studio) -> None:
        """Build none yet."""
        self.studio = studio
        self._dialogs: dict[str, ui.element] = {}

    def prepare(self, diagnosis: Diagnosed) -> None:
        """Remove all cards, and queue those of a diagnosis' findings to be built."""
        for dialog in self._dialogs.values():
            dialog.delete()
        self._dialogs.clear()
        for finding in diagnosis.card["findings"]:
            if finding["effect"] in diagnosis.cards:
                self.studio.draw_queue.request(BEHIND, partial(self._ahead, diagnosis, finding["effect"]))

    def open_on(self, button: ui.button, key: str) -> None:
        """Make a button open the card of an effect."""
        known = f"document.querySelector({json.dumps(f'dialog[data-card={json.dumps(key)}]')})"
        button.on("click", lambda: self._open(key), js_handler=f"() => {{ const own = {known}; {SHOW} : emit(); }}")

    def _ahead(self, diagnosis: Diagnosed, key: str) -> None:
        if self.studio.session.diagnosis is diagnosis and key not in self._dialogs:
            body = self._dialog(key)
            with body:
                fit = self._found(key)
                _show_card(diagnosis.cards[key], own=fit)

    async def _open(self, key: str) -> None:
        if key in self._dialogs:  # built between the click and now
            self._show(key)
            return
        with self._dialog(key) as body:
            own = self._found(key)
            waiting = ui.spinner()
        self._show(key)
        session = self.studio.session
        files = () if session.source is None else session.source.effect_files
        card = await self.studio.work(f"card of {key}", "card", key, session.kind, files, how="aside")
        if body.is_deleted:
            return
        waiting.delete()
        if card is not None:
            with body:
                _show_card(card, own)
        else:
            self._dialogs.pop(key).delete()  # built again next time

    def _dialog(self, key: str) -> ui.element:
        """Build an empty dialog, and return the element for its contents."""
        with self.studio.client, ui.element("dialog").classes("st-dialog") as dialog:
            dialog.props["data-card"] = dialog.props["aria-label"] = key
            dialog.on("click", js_handler="e => { if (e.target === e.currentTarget) e.target.close(); }")
            with ui.element("div").classes("st-inner"):
                with tools().style("flex-wrap: nowrap"):
                    ui.html(key.replace("-", " "), sanitize=False, tag="h2").classes("st-title")
                    ui.space()
                    close = ui.button(icon="close").props('flat round dense aria-label="close"')
                    close.on("click", js_handler="e => e.currentTarget.closest('dialog').close()")
                body = ui.element("div").classes("w-full").mark("effect-card")
        self._dialogs[key] = dialog
        return body

    def _show(self, key: str) -> None:
        ui.run_javascript(f"(() => {{ const own = getHtmlElement({self._dialogs[key].id}); {SHOW} : null; }})()")

    def _found(self, key: str) -> bool:
        """Show the finding on an effect with its fit, if there is one; whether there is a fit."""
        fit, finding = _own(self.studio, key)
        if finding is not None:
            _show_finding(finding, fit, serial=self.studio.session.kind == "serial")
        return fit is not None


def _own(studio: Studio, key: str) -> tuple[Mapping[str, Any] | None, Mapping[str, Any] | None]:
    """Fit of an effect, and the finding, from the latest diagnosis that has it; None and None without one."""
    session = studio.session
    for text in (session.text, *(snapshot.active for snapshot in reversed(session.past))):
        diagnosis = session.diagnoses.get(text)
        if diagnosis is not None and key in diagnosis.fits:
            return diagnosis.fits[key], next((one for one in diagnosis.card["findings"] if one["effect"] == key), None)
    return None, None


def _show_finding(finding: Mapping[str, Any], fit: Mapping[str, Any] | None, *, serial: bool) -> None:
    if finding["tie"]:
        ui.label(finding["tie"]).classes("st-tie font-medium")
    ui.label(finding["words"]).style("font-size: 15px")
    note(f"{how_sure(finding['probability'])} that it is part of what is missing")
    if fit is not None:
        plot = Picture(f"readings and the fit of {finding['effect']}", fit_figure(fit, serial))
        plot.style("width: 100%; height: 280px")
        note("This run, everything else taken out: pale what is left without the effect, orange what it explains.")
    for value in finding["values"]:
        with ui.element("div").classes("st-value"):
            ui.label(f"{value['who']} {value['text']} ({value_in_words(value)})").style("font-size: 14px")
            ui.html(ruler_html(value), sanitize=False)
            if value["worth"] > 10.0:
                warning("off the usual scale")


def _show_card(card: Mapping[str, Any], own: bool) -> None:
    if not own:
        plot = Picture(f"signature of {card['effect']}", sign_figure(card["sign"]))
        plot.style("width: 100%; height: 250px")
        note("Its signature at usual size on the sample machine, without noise: the run was not fitted with it.")
    for title, key in PARTS:
        if card[key] not in ("-", ""):
            ui.label(title).classes("font-medium").style("font-size: 13px; margin-top: 4px")
            note(pretty(card[key]))
    if card["confused_with"]:
        ui.label("Confused with").classes("font-medium").style("font-size: 13px; margin-top: 4px")
        for other, test in card["confused_with"]:
            note(f"{other}: {test}")
