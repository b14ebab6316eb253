"""How the page looks: light and dark, wide screens as one screen, narrow ones as one column."""

from importlib.resources import files

CSS = "\n".join(
    files(room).joinpath("style.css").read_text(encoding="utf-8") for room in ("ptt.show.card", "ptt.show.studio")
)
