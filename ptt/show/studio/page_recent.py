"""The list of earlier sessions of this browser, to be opened again or removed."""

from nicegui import ui

from ptt.show.studio.controller import Studio
from ptt.show.studio.parts import box, note, tools
from ptt.show.studio.store import SessionStore


def build_recent(studio: Studio) -> None:
    """List the sessions of this browser."""
    store = SessionStore(studio.place.root)
    earlier = [each for each in store.recent(studio.place.owner) if each.key != studio.place.key]
    if not earlier:
        return
    with box("Earlier sessions").style("height: auto"):
        for each in earlier:
            with tools().style("flex-wrap: nowrap") as row:
                ui.link(each.words, f"/s/{each.key}/result").style("flex: 1 1 0; min-width: 0; overflow-wrap: anywhere")
                note(each.changed[:16].replace("T", " ")).style("white-space: nowrap")

                def remove(key: str = each.key, line: ui.element = row) -> None:
                    found = store.find(key, studio.place.owner)
                    if found is not None:
                        found.remove()
                    line.delete()

                gone = ui.button(icon="delete", on_click=remove).props("flat round dense size=sm")
                gone.props["aria-label"] = f"remove {each.words}"
