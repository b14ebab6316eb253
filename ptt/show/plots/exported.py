"""Picture of the error that an export leaves, as three bars."""

from matplotlib.figure import Figure

from ptt.correct.exports.format import ErrorLeft
from ptt.show.plots.common import BLUE, DPI, ORANGE, PALE


def draw_error_left(left: ErrorLeft, name: str) -> Figure:
    """Draw the error over the workspace by the drawing, with an export format, and with the whole model.

    Args:
        left: rms errors, um.
        name: name of the format.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(6.4, 2.4), dpi=DPI, layout="constrained")
    panel = figure.subplots()
    bars = {"drawing": (left.drawing, PALE), name: (left.format, ORANGE), "whole model": (left.model, BLUE)}
    for row, (value, colour) in enumerate(bars.values()):
        panel.barh(row, value, color=colour)
        panel.annotate(f" {value:.1f}", (value, row), va="center", fontsize=9)
    panel.set_yticks(range(len(bars)), list(bars))
    panel.invert_yaxis()
    panel.margins(x=0.12)
    panel.set_xlabel("error over the workspace, rms [um]")
    panel.spines[["top", "right"]].set_visible(False)
    return figure
