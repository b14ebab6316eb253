"""The style sheet of the page, with that of the result card."""

from importlib.resources import files

CSS = "\n".join(
    files(room).joinpath("style.css").read_text(encoding="utf-8") for room in ("ptt.show.card", "ptt.show.studio")
)
