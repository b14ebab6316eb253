"""Picture of errors before and after compensation, as curves along the path."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptt.run.axes import AXES

BEFORE, AFTER = "#d1495b", "#00798c"
DPI = 130


def draw_error_curves(
    before: np.ndarray,
    after: np.ndarray,
    *,
    title: str = "",
    noise_um: Mapping[str, float] | None = None,
    repeats: int = 1,
) -> Figure:
    """Draw the error of each axis along the path: before in the upper row, after in the lower, each to its own scale.

    Args:
        before: errors in travel order, (m, 3) mm; repeats of a pose averaged or not.
        after: errors of the same poses, (m, 3) mm.
        title: of the picture.
        noise_um: axis -> standard deviation of what is drawn, um, drawn as a band; None for no band.
        repeats: of how many readings each error is the mean.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(11.0, 5.6), dpi=DPI, layout="constrained")
    panels = figure.subplots(2, 3, sharex=True)
    number = np.arange(1, len(before) + 1)
    label = f"noise floor{f' of a mean of {repeats}' if repeats > 1 else ''}, one sigma"
    for column, axis in enumerate(AXES):
        for row, (errors, colour, name) in enumerate(((before, BEFORE, "before"), (after, AFTER, "after"))):
            panel: Axes = panels[row, column]
            panel.axhline(0.0, color="#bbbbbb", linewidth=0.8)
            if row and noise_um is not None:
                panel.axhspan(-noise_um[axis], noise_um[axis], color="#dddddd", label=label)
            values = 1e3 * errors[:, column]
            panel.plot(number, values, color=colour, linewidth=1.2, marker="." if len(values) == 1 else None)
            panel.set_title(f"{axis} {name}: mean |error| {np.abs(values).mean():.1f} um", fontsize=10)
            _make_room(panel, values)
        panels[1, column].set_xlabel("pose")
    for row in (0, 1):
        panels[row, 0].set_ylabel("error [um]")
    if noise_um is not None:
        figure.legend(*panels[1, 0].get_legend_handles_labels(), loc="outside lower center", frameon=False, fontsize=9)
    figure.suptitle(title)
    return figure


def _make_room(panel: Axes, values: np.ndarray) -> None:
    """Set limits with a margin of at least 1 um, so that rounding errors do not look like a curve."""
    low, high = float(values.min()), float(values.max())
    rim = max(0.08 * (high - low), 1.0)
    panel.set_ylim(min(low - rim, -rim), max(high + rim, rim))
