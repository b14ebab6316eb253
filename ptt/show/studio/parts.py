"""Parts of which the views are built: boxes with headings, notes, warnings, rows of controls, tables."""

from nicegui import ui


def box(title: str = "") -> ui.element:
    """A box, with a heading unless its title is ''."""
    made = ui.element("div").classes("st-box")
    if title:
        with made:
            heading(title)
    return made


def column() -> ui.element:
    """A column of boxes that scrolls."""
    return ui.element("div").classes("st-col st-scroll").props("tabindex=0")


def heading(text: str, tag: str = "h2") -> ui.html:
    """A heading of a box, or with the tag 'h3' of a part of it."""
    return ui.html(text, sanitize=False, tag=tag).classes("st-head")


def note(text: str = "") -> ui.label:
    """Small print."""
    return ui.label(text).classes("st-note")


def warning(text: str = "") -> ui.label:
    """A text that stands out."""
    return ui.label(text).classes("st-tie")


def tools() -> ui.element:
    """A row of controls."""
    return ui.element("div").classes("st-tools")


def grid() -> ui.element:
    """An element for a table, which scrolls where it is too wide."""
    return ui.element("div").classes("st-grid").props("tabindex=0")


def table(html: str = "") -> ui.html:
    """A table of `table_html`, which scrolls where it is too wide; '' for one that is filled later."""
    with grid():
        return ui.html(html, sanitize=False).classes("w-full")
