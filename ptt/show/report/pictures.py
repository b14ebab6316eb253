"""Pictures of a report: those of the other verbs, sized for a page that is 180 mm wide."""

import base64
from collections.abc import Callable, Mapping
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from ptt.judge.compare.comparison import Comparison
from ptt.run.problem import Problem
from ptt.show.plots.common import png
from ptt.show.plots.compare import draw_course, draw_histogram
from ptt.show.plots.compensation import draw_error_curves
from ptt.show.plots.depends import draw_dependences
from ptt.show.plots.field import draw_field, draw_pair
from ptt.show.plots.ladder import draw_history
from ptt.show.report.blocks import Picture, Section
from ptt.show.report.contents import Contents

WIDE = 9.6  # inches, drawn width, shrunk to the page in print: text of 9 points becomes 6.7 points
DPI = 160
LETTERS: Any = {"font.size": 13.0, "axes.titlesize": 14.0, "figure.titlesize": 15.0}  # of pictures that are wider

Draw = Callable[[Comparison, Problem], Figure | None]


def draw_pictures(contents: Contents, sections: tuple[Section, ...]) -> dict[str, bytes]:
    """Draw the pictures that sections contain.

    Args:
        contents: contents of the report.
        sections: the sections.

    Returns:
        Name -> PNG.
    """
    wanted = [block.name for section in sections for block in section.blocks if isinstance(block, Picture)]
    return {name: draw_picture(name, contents) for name in dict.fromkeys(wanted)}


def draw_picture(name: str, contents: Contents) -> bytes:
    """Draw one picture.

    Args:
        name: what it shows and of what: 'field-drawing', 'ladder-0', 'curves', ...
        contents: contents of the report.

    Returns:
        PNG.
    """
    what, _, of = name.partition("-")
    if what in ("ladder", "curves"):
        with rc_context(LETTERS):
            return png(draw_history(contents.ladders[int(of)]) if what == "ladder" else _curves(contents))
    if what == "pair":
        assert contents.pair is not None
        return _png(draw_pair(contents.pair), 0.55)
    look = contents.drawing if of == "drawing" else contents.given
    draws: Mapping[str, tuple[Draw, float]] = {
        "field": (draw_field, 0.5),
        "depends": (draw_dependences, 0.0),
        "course": (draw_course, 0.55),
        "histogram": (draw_histogram, 0.4),
    }
    draw, shape = draws[what]
    figure = draw(look.comparison, contents.problem)
    assert figure is not None  # of variables that explain something, which are there wherever it is asked for
    return _png(figure, shape)


def data_uri(picture: bytes) -> str:
    """A PNG as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"


def _curves(contents: Contents) -> Figure:
    result = contents.evaluation["blocks"]
    noise = None if result.noise is None else {axis: float(result.noise.to_dict()[axis]) for axis in "xyz"}
    return draw_error_curves(result.before, result.after, noise_um=noise)


def _png(figure: Figure, shape: float) -> bytes:
    """A figure as PNG at the page's width; `shape` is height over width, zero for about its own."""
    wide, high = figure.get_size_inches()
    figure.set_size_inches(min(WIDE, wide), min(WIDE, wide) * (shape or 1.08 * high / wide))
    figure.set_dpi(DPI)
    return png(figure)
