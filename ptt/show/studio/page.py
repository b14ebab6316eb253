"""The page: header with undo and progress, five views, and what happens when a tab comes and goes."""

from nicegui import ui

from ptt.show.studio.controller import Studio
from ptt.show.studio.page_finish import build_finish
from ptt.show.studio.page_learn import build_learn
from ptt.show.studio.page_load import build_load
from ptt.show.studio.page_look import build_look
from ptt.show.studio.page_model import build_model
from ptt.show.studio.session import key_of
from ptt.show.studio.style import CSS

VIEWS = {"Load": build_load, "Look": build_look, "Learn": build_learn, "Add": build_model, "Finish": build_finish}
ICONS = {"Load": "upload_file", "Look": "visibility", "Learn": "search", "Add": "add_circle", "Finish": "task_alt"}


def build_page(studio: Studio) -> None:
    """Put the whole page together.

    Args:
        studio: of this tab.
    """
    ui.add_css(CSS)
    ui.colors(primary="#31688e", secondary="#440154", accent="#e69f00", positive="#31688e", negative="#440154")
    with ui.header().classes("st-header"):
        ui.label("ptt studio").classes("st-brand")
        with ui.tabs().props("dense no-caps inline-label aria-label=views").classes("st-tabs") as tabs:
            for name in VIEWS:
                ui.tab(name, icon=ICONS[name])
        ui.space()
        _build_undo(studio)
    _build_status(studio)
    with ui.tab_panels(tabs, value="Load", animated=False).classes("st-panels") as panels:

        def show(view: str) -> None:
            panels.set_value(view)

        for name, build in VIEWS.items():
            with ui.tab_panel(name).classes("st-panel"):
                build(studio, show)


def _build_undo(studio: Studio) -> None:
    undo = ui.button(icon="undo", on_click=studio.undo).props('flat round dense color=white aria-label="undo"')
    redo = ui.button(icon="redo", on_click=studio.redo).props('flat round dense color=white aria-label="redo"')
    with undo:
        back = ui.tooltip()
    with redo:
        forth = ui.tooltip()

    def update() -> None:
        session, idle = studio.session, studio.busy is None
        undo.set_enabled(bool(session.past) and idle)
        redo.set_enabled(bool(session.future) and idle)
        back.set_text(f"undo: {session.now.words}" if session.now and session.past else "nothing to undo")
        forth.set_text(f"redo: {session.future[0].words}" if session.future else "nothing to redo")

    studio.on("session", update)
    studio.on("busy", update)
    update()


def _build_status(studio: Studio) -> None:
    """A line that says what is open, what is going on, and what went wrong."""
    with ui.row().classes("st-status"):
        told = ui.label().classes("st-told").mark("status")
        with ui.row().classes("st-busy").props("role=status aria-live=polite") as going:
            ui.spinner(size="18px")
            words = ui.label().mark("busy")
            bar = ui.linear_progress(0.0, show_value=False).props('aria-label="progress"').classes("st-bar")
            ui.button("Cancel", icon="stop", on_click=studio.cancel).props("dense no-caps outline size=sm")
    with ui.row().classes("st-alert").props("role=alert") as alert:
        ui.icon("error", size="20px")
        trouble = ui.label().classes("st-trouble").mark("alert")
        ui.button(icon="close", on_click=lambda: studio.fail("")).props('flat round dense aria-label="dismiss"')

    def update() -> None:
        told.set_text(_told(studio))
        going.set_visibility(studio.busy is not None)
        alert.set_visibility(bool(studio.trouble))
        trouble.set_text(studio.trouble)
        if studio.busy is not None:
            words.set_text(studio.busy.words)
            known = studio.busy.of > 0
            bar.set_value(studio.busy.done / studio.busy.of if known else 0.0)
            bar.props(remove="indeterminate") if known else bar.props("indeterminate")

    studio.on("session", update)
    studio.on("busy", update)
    update()


def _told(studio: Studio) -> str:
    session = studio.session
    if session.now is None or session.source is None:
        return "No run yet: drop a tracker CSV, or start from a sample"
    off = session.now.off
    keys = [entry.name + (" (off)" if key_of(entry) in off else "") for entry in session.effects]
    effects = ", ".join(keys) if keys else "no effects"
    figure = session.comparison
    error = f" \N{MIDDLE DOT} error {figure.data['rms_um']['total']:.1f} \N{MICRO SIGN}m rms" if figure else ""
    return f"{session.source.run} \N{MIDDLE DOT} {session.now.file.machine.name}, {effects}{error}"
