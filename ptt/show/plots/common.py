"""What pictures share: colours, thinning, a legend that covers nothing, and writing a PNG whole or not at all."""

import re
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from ptt.files import write_bytes

DPI = 120
MICRO = re.compile(r"(?<![\w-])u(m|rad)(?![A-Za-z])")
POINTS = 4000  # more readings than this are thinned in a picture
BLUE, PALE, DARK, ORANGE = "#31688e", "#8fb4d0", "#440154", "#e69f00"  # tell apart in every kind of colour vision
COLOUR_MAP = "viridis"
MOST_BESIDE = 5  # entries of a legend side by side


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, whole or not at all."""
    write_bytes(path, png(figure))


def png(figure: Figure) -> bytes:
    """A figure as PNG, its micrometres with their real sign."""
    for text in figure.findobj(Text):
        text.set_text(in_micro(text.get_text()))
    buffer = BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    return buffer.getvalue()


def in_micro(text: str) -> str:
    """A text as pictures and pages have it: um and urad as units become those with the Greek letter."""
    return MICRO.sub("\N{MICRO SIGN}\\1", text)


def thinned(rows: np.ndarray) -> np.ndarray:
    """Indices of chosen rows, evenly thinned to what a picture can show."""
    index = np.flatnonzero(rows)
    return index[:: max(1, -(-len(index) // POINTS))]


def legend_below(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend for all panels, below them, so that it covers nothing.

    Args:
        figure: with constrained layout.
        panels: whose labels to gather; equal labels count once.
    """
    pairs = (zip(*panel.get_legend_handles_labels(), strict=True) for panel in panels)
    handles = {label: handle for pair in pairs for handle, label in pair}
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        ncols=MOST_BESIDE,
        frameon=False,
        fontsize=9,
    )
