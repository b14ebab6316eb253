"""Shared by pictures: colours, thinning of rows, logarithmic axes, a legend below the panels, writing PNG."""

import re
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ptt.files import write_bytes

DPI = 120
MICRO = re.compile(r"(?<![\w-])u(m|rad)(?![A-Za-z])")  # um or urad as a unit
POINTS = 4000  # readings drawn at most; more are thinned
BLUE, PALE, DARK, ORANGE = "#31688e", "#8fb4d0", "#440154", "#e69f00"  # distinguishable in all kinds of colour vision
NOISE = "#6b705c"  # of the noise floor
NUMBERS = FuncFormatter(lambda value, _: f"{value:g}")  # 40, not 4 x 10^1
COLOUR_MAP = "viridis"
MOST_BESIDE = 5  # columns of a legend


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, whole or not at all."""
    write_bytes(path, png(figure))


def png(figure: Figure) -> bytes:
    """A figure as PNG, with the Greek letter for micro in all its texts."""
    for text in figure.findobj(Text):
        text.set_text(in_micro(text.get_text()))
    buffer = BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    return buffer.getvalue()


def in_micro(text: str) -> str:
    """A text with the Greek letter for micro in the units um and urad."""
    return MICRO.sub("\N{MICRO SIGN}\\1", text)


def thinned(rows: np.ndarray) -> np.ndarray:
    """Indices of rows chosen by a mask (n,), every so many of them so that at most `POINTS` remain, (m,) int."""
    index = np.flatnonzero(rows)
    return index[:: max(1, -(-len(index) // POINTS))]


def plain_log(axis: Axis, steps: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Label a logarithmic axis with plain numbers, at these multiples of the powers of ten."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(NUMBERS)
    axis.set_minor_formatter(NullFormatter())


def legend_below(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend for all panels, below them, so that it covers nothing.

    Args:
        figure: with constrained layout.
        panels: whose labels are gathered; equal labels appear once.
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
