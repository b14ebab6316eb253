"""The box on Load on what was understood of a run: warnings first, then facts, columns, and the comparison."""

from collections.abc import Sequence
from html import escape

from nicegui import ui

from ptt.effects.phrases import capital
from ptt.fitting.chunks import LONG
from ptt.run.axes import AXES
from ptt.run.noise import source_in_words
from ptt.show.card.words import length, pretty
from ptt.show.studio.controller import Studio
from ptt.show.studio.looks import Look
from ptt.show.studio.on_page import on_page
from ptt.show.studio.page_setup import show_finding
from ptt.show.studio.parts import box, heading, note, table, tools, warning
from ptt.show.studio.tables import table_html

PER_ROW = 0.3e-3  # s per row of a diagnosis, measured with a million rows on two cores
SLOWEST = 4.0  # factor on that for a busy or slow computer
FIRST = ("warning: ", "not used: ")  # beginnings of lines that are shown first


def build_understood(studio: Studio) -> None:
    """Build the box."""
    with box():
        head = heading("What was understood")
        before = warning().style("margin: 4px 0; width: 100%").mark("before")
        body = ui.element("div").classes("w-full").mark("understood")

    shown: list[object] = []

    def name() -> None:
        """Say which run the tables are of: another one may be staged, with a question or a mistake to settle first."""
        look, staged = studio.session.look, studio.staged
        head.set_content(escape(f"What was understood of {look.source}") if look else "What was understood")
        waits = look is not None and staged.source is not None and bool(staged.setup or staged.question)
        before.set_visibility(waits)
        if look is not None and staged.source is not None:
            before.set_text(
                f"{staged.source.run} is not open yet, see above. What follows is of {look.source}, as before."
            )

    def update() -> None:
        name()
        look, figures = studio.session.look, studio.session.comparison
        if shown == [look, figures]:
            return
        shown[:] = [look, figures]
        body.clear()
        with body:
            if look is None:
                with ui.element("div").classes("st-empty"):
                    ui.icon("table_view", size="42px")
                    ui.label(
                        "Nothing is open yet. A run is a table: where the tool should be, what was sent, what was read."
                    )
                return
            _show(studio, look)

    studio.when("Load", "session", update)
    studio.on("staged", name)
    update()


def _show(studio: Studio, look: Look) -> None:
    warnings, lines = split_warnings(look.understood)
    for words in warnings:
        warning(words).style("margin: 6px 0; width: 100%")
    for finding in look.setup:
        show_finding(finding)
    if look.rows > LONG:
        with ui.element("div").classes("st-tie").style("margin: 6px 0"):
            ui.label(
                f"{look.rows:,} rows: a diagnosis takes {_minutes(look.rows)} in the background; it starts only when "
                "you ask for it."
            )
    with tools().style("margin: 6px 0"):
        result = ui.button("See the result", icon="troubleshoot", on_click=lambda: studio.go("Result"))
        result.props("no-caps unelevated")
        readings = ui.button("Look at the readings", icon="visibility", on_click=lambda: studio.go("Look"))
        readings.props("no-caps outline")
    ui.html(table_html((), _facts(look), words=2), sanitize=False).classes("w-full")
    if look.column_rows:
        _show_columns(look)
    with ui.expansion("How the file was read, in words").classes("w-full").props("dense"):
        for line in lines:
            note(pretty(line))
    figures = studio.session.comparison
    if figures is not None:
        with ui.expansion("Compared with the model, in figures", value=False).classes("w-full").props("dense"):
            ui.label(pretty(figures.text)).classes("st-mono st-pre").props("tabindex=0")


def _facts(look: Look) -> list[tuple[str, str]]:
    """Facts of a run, as pairs of title and words."""
    left = int((~look.kept).sum())
    rest = f" ({left} left out: base, not observed or gross errors)" if left else ""
    return [
        ("Rows", f"{look.rows}, {look.rows - left} of them count{rest}"),
        ("Runs", ", ".join(look.runs) or "one"),
        ("Besides poses", ", ".join(look.covariates) or "nothing: only effects of the pose can be found"),
        ("Noise of one reading", _noise(look.noise)),
    ]


def _show_columns(look: Look) -> None:
    heading("Columns", "h3").style("margin-top: 10px")
    head = ("column", "taken for", "unit", "first rows as in the file", "read as")
    last = len(head) if any(row[-1] for row in look.column_rows) else len(head) - 1  # where units were converted
    table(table_html(head[:last], [row[:last] for row in look.column_rows], words=5))


def _minutes(rows: int) -> str:
    """How long a diagnosis of a run with so many rows takes, in words."""
    least = PER_ROW * rows / 60.0
    most = max(SLOWEST * least, 1.0)
    return (
        f"about {least:.0f} to {most:.0f} minutes" if least >= 1.0 else f"up to {most:.0f} minute{'s' * (most >= 1.5)}"
    )


def split_warnings(lines: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split the reader's notes on a file into warnings and the rest.

    Args:
        lines: the notes, `Look.understood`.

    Returns:
        Warnings as sentences, and the other lines.
    """
    lines = [on_page(line) for line in lines]
    first = [line for line in lines if line.startswith(FIRST)]
    told = [line.removeprefix(FIRST[0]) for line in first]
    return [pretty(f"{capital(words)}.") for words in told], [line for line in lines if line not in first]


def _noise(noise: object) -> str:
    if not isinstance(noise, dict):
        return "not known from this run alone; the diagnosis estimates it"
    figures = ", ".join(f"{axis} {noise[axis]:.1f}" for axis in AXES)
    return f"{length(noise['total'])} ({figures}), from {source_in_words(noise['source'])}"
