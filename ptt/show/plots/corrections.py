"""Pictures of corrected commands, and of a run's readings less its targets."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ptt.correct.commands import STATUSES, Commands
from ptt.show.plots.common import BLUE, COLOUR_MAP, DARK, DPI, ORANGE, thinned

LEAST_UM = 1.0  # span of a scale at the least, so that rounding of a drawing without effects looks like none
FEW = 40  # rows up to which each is a dot that can be seen
LINES = {"x": BLUE, "y": ORANGE, "z": DARK}


def draw_corrections(target: np.ndarray, commands: Commands) -> Figure:
    """Draw the size of the corrections: over the targets seen from above, and by row with their uncertainty.

    Args:
        target: (n, 3) mm; NaN where only joint commands were given.
        commands: the commands.

    Returns:
        The figure, rows that are not sent as crosses; without any targets only the panel by row.
    """
    placed = np.isfinite(target).all(axis=1)
    figure = Figure(figsize=(11.0 if placed.any() else 6.6, 4.6), dpi=DPI, layout="constrained")
    if placed.any():
        above, course = figure.subplots(1, 2)
        _draw_above(above, target, commands)
    else:
        course = figure.subplots()
    sent = commands.sent
    _draw_line(course, sent, 1e3 * commands.shift, BLUE, "correction")
    told = sent & np.isfinite(commands.sigma)
    if told.any():
        _draw_line(course, told, 1e3 * commands.sigma, ORANGE, "uncertain by")
    if sent.any():
        top = max(course.get_ylim()[1], LEAST_UM)
        course.set_ylim(-0.03 * top, top)
    counts = ", ".join(f"{commands.counts[status]} {status}" for status in STATUSES if commands.counts[status])
    course.set(xlabel="row", ylabel="at the tool [um]", title=counts)
    if sent.any():
        course.legend(frameon=False)
    return figure


def _draw_line(panel: Axes, chosen: np.ndarray, values: np.ndarray, colour: str, label: str = "") -> None:
    """Draw values (n,) over their rows, of those chosen (n,) bool, with gaps at the others and a lone one as a dot."""
    rows = thinned(chosen)
    gaps = np.flatnonzero(np.diff(np.cumsum(~chosen)[rows])) + 1
    across, up = (np.insert(each, gaps, np.nan) for each in (rows + 1.0, values[rows]))
    size = 6.0 if len(rows) <= FEW else 2.0
    panel.plot(across, up, color=colour, linewidth=1.0, marker=".", markersize=size, label=label or None)


def _draw_above(above: Axes, target: np.ndarray, commands: Commands) -> None:
    sent, shift = commands.sent, 1e3 * commands.shift
    rows = thinned(sent & np.isfinite(target).all(axis=1))
    if len(rows):
        low, high = float(shift[rows].min()), float(shift[rows].max())
        norm = (
            Normalize(low, high)
            if high - low >= LEAST_UM
            else Normalize(max(high - LEAST_UM, 0.0), max(high, LEAST_UM))
        )
        dots = above.scatter(target[rows, 0], target[rows, 1], c=shift[rows], cmap=COLOUR_MAP, norm=norm, s=14)
        above.figure.colorbar(dots, ax=above, label="correction [um]")
    lost = thinned(~sent & np.isfinite(target).all(axis=1))
    above.plot(target[lost, 0], target[lost, 1], "x", color="#c1121f", markersize=5)
    above.set(xlabel="x [mm]", ylabel="y [mm]", title="targets from above", aspect="equal")


def draw_misses(run: pd.DataFrame) -> Figure:
    """Draw readings less targets along a run.

    Args:
        run: columns x_cmd to z_cmd and x_meas to z_meas in mm, n rows.

    Returns:
        The figure, a panel for each axis.
    """
    figure = Figure(figsize=(11.0, 5.0), dpi=DPI, layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for panel, (axis, colour) in zip(panels, LINES.items(), strict=True):
        miss = 1e3 * (run[f"{axis}_meas"] - run[f"{axis}_cmd"]).to_numpy(dtype=float)
        panel.axhline(0.0, color="#bbbbbb", linewidth=0.8)
        _draw_line(panel, np.isfinite(miss), miss, colour)
        panel.set_ylabel(f"{axis} [um]")
    panels[-1].set_xlabel("row")
    figure.suptitle("readings less targets, frames as they come")
    return figure
