"""The page: header with undo and theme, six views with addresses of their own, status line and alert."""

import time
from collections.abc import Callable
from importlib.resources import files

from nicegui import events, ui

from ptt.show.card.words import length
from ptt.show.studio.controller import Studio
from ptt.show.studio.page_again import AgainView
from ptt.show.studio.page_finish import FinishView
from ptt.show.studio.page_load import build_load
from ptt.show.studio.page_look import LookView
from ptt.show.studio.page_model import ModelView
from ptt.show.studio.page_result import ResultView
from ptt.show.studio.panels import SWITCH, Panels

CSS = "\n".join(  # of the page and of the result card
    files(room).joinpath("style.css").read_text(encoding="utf-8") for room in ("ptt.show.card", "ptt.show.studio")
)
VIEWS: dict[str, Callable[[Studio], object]] = {
    "Load": build_load, "Result": ResultView, "Look": LookView, "Model": ModelView, "Finish": FinishView,
    "Again": AgainView,
}  # fmt: skip
ICONS = {
    "Load": "upload_file", "Result": "troubleshoot", "Look": "visibility", "Model": "tune", "Finish": "task_alt",
    "Again": "compare",
}  # fmt: skip
# JavaScript that puts the address of a view into the browser's history.
ADDRESS = """(() => { const to = '/s/KEY/VIEW';
  if (location.pathname === to) return; const own = location.pathname.startsWith('/s/KEY/');
  history[own ? 'pushState' : 'replaceState']({}, '', to); })()"""
# In the browser alone: NiceGUI's own dark mode would apply all styles again at every change of the page.
THEME = """() => { Quasar.Dark.toggle();
  document.getElementById('nicegui-color-scheme').content = Quasar.Dark.isActive ? 'dark' : 'light'; }"""
BACK = """window.addEventListener('popstate', () => { const view = location.pathname.split('/').pop();
  emitEvent('view', view); })"""


def build_page(studio: Studio, view: str) -> None:
    """Put the whole page together.

    Args:
        studio: of this session.
        view: which view is shown first, in lower case.
    """
    ui.add_css(CSS)
    ui.colors(primary="#1f5f8b", secondary="#440154", accent="#e69f00", positive="#00735a", negative="#a33f00")
    studio.view = next((name for name in VIEWS if name.lower() == view), "Load")
    with ui.header().classes("st-header"):
        ui.html("ptt studio", sanitize=False, tag="h1").classes("st-brand")
        with ui.tabs().props("dense no-caps inline-label aria-label=views").classes("st-tabs") as tabs:
            for name in VIEWS:  # switched in the browser at once, so that its button Back leads to the view before
                switch = f"() => {{ {address_of(studio, name)}; {SWITCH.replace('VIEW', name)} }}"
                ui.tab(name, icon=ICONS[name]).on("click", js_handler=switch)
        ui.space()
        _build_undo(studio)
        theme = ui.button(icon="dark_mode").props('flat round dense color=white aria-label="light or dark"')
        theme.on("click", js_handler=THEME)
    tabs.set_value(studio.view)
    studio.go = tabs.set_value
    with ui.element("div").classes("nicegui-content w-full"):
        _build_status(studio)
        panels = Panels(studio, VIEWS)

    def shown() -> None:
        studio.view = str(tabs.value)
        ui.run_javascript(address_of(studio, studio.view))
        panels.see(studio.view)
        studio.tell("view")

    tabs.on_value_change(shown)
    shown()
    ui.keyboard(on_key=lambda event: _pressed(studio, event), ignore=["input", "textarea"])
    ui.run_javascript(BACK)
    ui.on("view", lambda event: tabs.set_value(next((n for n in VIEWS if n.lower() == event.args), "Load")))


def address_of(studio: Studio, view: str) -> str:
    """JavaScript that sets the browser's address to that of a view, with the one before in its history."""
    return ADDRESS.replace("KEY", studio.place.key).replace("VIEW", view.lower())


async def _pressed(studio: Studio, event: events.KeyEventArguments) -> None:
    """Undo on Ctrl+Z and redo on Ctrl+Y or Ctrl+Shift+Z, also with Cmd."""
    if not event.action.keydown or not (event.modifiers.ctrl or event.modifiers.meta) or event.modifiers.alt:
        return
    key = str(event.key).lower()
    if key == "z" and not event.modifiers.shift:
        await studio.undo()
    elif key == "y" or key == "z":
        await studio.redo()


def _build_undo(studio: Studio) -> None:
    undo = ui.button(icon="undo", on_click=studio.undo).props('flat round dense color=white aria-label="undo"')
    redo = ui.button(icon="redo", on_click=studio.redo).props('flat round dense color=white aria-label="redo"')
    with undo:
        back = ui.tooltip()
    with redo:
        forth = ui.tooltip()

    def update() -> None:
        session = studio.session
        undo.set_enabled(bool(session.past) and studio.idle)
        redo.set_enabled(bool(session.future) and studio.idle)
        back.set_text(f"undo: {session.now.words} (Ctrl+Z)" if session.now and session.past else "nothing to undo")
        forth.set_text(f"redo: {session.future[0].words} (Ctrl+Y)" if session.future else "nothing to redo")

    studio.on("session", update)
    studio.on("busy", update)
    update()


def _build_status(studio: Studio) -> None:
    """Build the status line (what is open, what is being done) and the alert (what went wrong)."""
    with ui.row().classes("st-status"):
        told = ui.label().classes("st-told").mark("status")
        with ui.row().classes("st-busy").props("role=status aria-live=polite") as going:
            ui.spinner(size="18px").props('aria-hidden="true"')
            words = ui.label().classes("st-doing").mark("busy")
            bar = ui.linear_progress(0.0, show_value=False).props('aria-label="progress"').classes("st-bar")
            ui.button("Cancel", icon="stop", on_click=studio.cancel).props("dense no-caps outline size=sm")
    with ui.row().classes("st-alert").props("role=alert") as alert:
        ui.icon("error", size="20px")
        trouble = ui.label().classes("st-trouble").mark("alert")
        ui.button(icon="close", on_click=lambda: studio.fail("")).props('flat round dense aria-label="dismiss"')

    def update() -> None:
        told.set_text(told_of(studio))
        busy = studio.busy
        going.set_visibility(busy is not None)
        alert.set_visibility(bool(studio.trouble))
        trouble.set_text(studio.trouble)
        clock.active = busy is not None
        if busy is not None:
            words.set_text(doing(busy.words, busy.done, busy.of, time.monotonic() - busy.since))
            known = busy.of > 0
            bar.set_value(busy.done / busy.of if known else 0.0)
            bar.props(remove="indeterminate") if known else bar.props("indeterminate")

    clock = ui.timer(1.0, update, active=False)
    studio.on("session", update)
    studio.on("busy", update)
    update()


def doing(words: str, done: int, of: int, seconds: float) -> str:
    """Progress of a job in words, with the time that it still takes.

    Args:
        words: what is being done.
        done: how much of it is done.
        of: how much there is; 0 where that is unknown.
        seconds: time since it began, s.

    Returns:
        For example 'adding backlash: 3 of 12, 0.4 s each, 4 s left'.
    """
    if of > 0 and done > 0:
        each = seconds / done
        return f"{words}: {done} of {of}, {each:.2g} s each, {_time(each * (of - done))} left"
    return f"{words}, {_time(seconds)}" if seconds >= 2.0 else words


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


def told_of(studio: Studio) -> str:
    """What is open, in one line."""
    session = studio.session
    if session.now is None or session.source is None:
        return "No run yet"
    off = session.now.off
    keys = [entry.name + (" (off)" if entry.key in off else "") for entry in session.effects]
    effects = ", ".join(keys) if keys else "no effects"
    figure = session.error_um
    error = f" \N{MIDDLE DOT} error {length(figure['total'])} rms" if figure else ""
    return f"{session.source.run} \N{MIDDLE DOT} {session.now.file.machine.name}, {effects}{error}"
