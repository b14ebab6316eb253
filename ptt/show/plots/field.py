"""Pictures of an error field: an arrow for each pose, in space and from above."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.quiver import Quiver
from matplotlib.ticker import MaxNLocator

from ptt.judge.before_after import BeforeAfter, Side
from ptt.judge.compare.comparison import Comparison
from ptt.run.axes import rms_length
from ptt.run.holdout import pose_groups
from ptt.run.means import group_means
from ptt.run.problem import Problem
from ptt.show.plots.common import COLOUR_MAP, DPI
from ptt.show.sizing import round_down, spread

MOST_ARROWS = 300
REACH, QUANTILE = 0.18, 0.95  # drawn length of the arrow at this quantile of sizes, as a share of the workspace's size
ZOOM, TALL = 1.1, 0.6  # zoom of the box in space, and its limit as a multiple of diagonal over height
NARROW = 0.5  # every side of the box is given at least this share of the longest
TICKS = 5  # few enough for long labels, as of a telescope's workspace of a kilometre
KEY = 0.2  # room below the arrows for the scale bar, in half widths of the picture


def draw_field(result: Comparison, problem: Problem) -> Figure:
    """Draw the error after frame alignment, the mean of each pose as an arrow.

    Args:
        result: the comparison.
        problem: its run.

    Returns:
        The figure: in space on the left, from above on the right.
    """
    place, error, poses = field_of(result, problem)
    size = 1e3 * np.linalg.norm(error, axis=1)
    factor, key = enlargement(place, error)
    norm = Normalize(0.0, max(float(size.max()), 1e-3))
    figure = Figure(figsize=(12.4, 6.0), dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.12, wspace=0.16))
    grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    space = figure.add_subplot(grid[0], projection="3d")
    _draw_space(space, place, error * factor, size, norm)
    above = figure.add_subplot(grid[1])
    arrows = _draw_above(above, place, error * factor, size, norm)
    figure.colorbar(arrows, ax=above, label="size of the error [um]", shrink=0.85)
    _draw_key(above, key, factor)
    shown = f"{len(place)} of {poses} poses" if len(place) < poses else f"{poses} poses"
    figure.suptitle(f"error after frame alignment, mean of each pose; {shown}; arrows {factor:g} times enlarged")
    return figure


def draw_pair(pair: BeforeAfter) -> Figure:
    """Draw the tool's error of two runs from above, in one scale of arrows and colours.

    Args:
        pair: both runs.

    Returns:
        The figure: before on the left, after on the right.
    """
    sides = [_thinned(side) for side in (pair.before, pair.after)]
    size = [1e3 * np.linalg.norm(error, axis=1) for _, error in sides]
    factor, key = enlargement(np.concatenate([place for place, _ in sides]), sides[0][1])
    norm = Normalize(0.0, max(float(np.concatenate(size).max()), 1e-3))
    figure = Figure(figsize=(12.4, 6.4), dpi=DPI, layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for panel, words, side, (place, error), length in zip(
        panels, ("before", "after"), (pair.before, pair.after), sides, size, strict=True
    ):
        arrows = _draw_above(panel, place, error * factor, length, norm)
        total = 1e3 * rms_length(side.error)
        panel.set_title(f"{words}: {total:.3g} um rms, {len(side.error)} readings", fontsize=11)
    _draw_key(panels[0], key, factor)
    figure.colorbar(arrows, ax=panels, label="size of the error [um]", shrink=0.85)
    figure.suptitle(f"tool against its targets, frames taken out; horizontal part, {factor:g} times enlarged")
    return figure


def _thinned(side: Side) -> tuple[np.ndarray, np.ndarray]:
    chosen = spread(len(side.place), MOST_ARROWS)
    return side.place[chosen], side.error[chosen]


def field_of(result: Comparison, problem: Problem) -> tuple[np.ndarray, np.ndarray, int]:
    """Mean error of each pose, thinned to what a picture can show.

    Args:
        result: the comparison.
        problem: its run.

    Returns:
        Mean targets (m, 3) mm, mean errors (m, 3) mm, and how many poses there are in all.
    """
    rows = result.kept
    place, error = (
        group_means(values[rows], pose_groups(problem.table)[rows])[1] for values in (problem.target, result.residual)
    )
    chosen = spread(len(place), MOST_ARROWS)
    return place[chosen], error[chosen], len(place)


def enlargement(place: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Round factor of enlargement at which errors are well seen as arrows.

    Args:
        place: where they are, or other places too, (m, 3) mm.
        error: (n, 3) mm.

    Returns:
        1, 2 or 5 times a power of ten, and a round size of an error whose arrow is then well seen, um.
    """
    long = REACH * max(float(np.ptp(place, axis=0).max()), 1e-3)
    factor = round_down(long / max(float(np.quantile(np.linalg.norm(error, axis=1), QUANTILE)), 1e-9))
    return factor, round_down(1e3 * long / factor)


def _draw_space(panel: Axes, place: np.ndarray, arrow: np.ndarray, size: np.ndarray, norm: Normalize) -> None:
    from matplotlib import colormaps

    colours = colormaps[COLOUR_MAP](norm(size))
    # matplotlib draws a 3-D arrow as three segments: first all shafts, then the left halves of heads, then the right.
    colours = np.tile(colours, (3, 1))
    panel.plot(*place.T, linestyle="none", marker=".", markersize=3.0, color="0.6")
    panel.quiver(*place.T, *arrow.T, colors=colours, linewidth=1.8, arrow_length_ratio=0.3)
    tips = np.concatenate([place, place + arrow])
    low, high = tips.min(axis=0), tips.max(axis=0)
    room = np.maximum(high - low, NARROW * (high - low).max())
    for axis, bounds in zip("xyz", np.stack([(low + high - room) / 2, (low + high + room) / 2], axis=1), strict=True):
        getattr(panel, f"set_{axis}lim")(*bounds)
        getattr(panel, f"set_{axis}label")(f"{axis} [mm]", labelpad=11.0)
        places = max(2, round(5 * (bounds[1] - bounds[0]) / room.max()))
        getattr(panel, f"{axis}axis").get_major_locator().set_params(nbins=places)
        panel.tick_params(axis=axis, pad=4.0, labelsize=8)  # type: ignore[arg-type]
    # At one zoom for all, a tall box would reach beyond the figure.
    zoom = min(ZOOM, TALL * float(np.linalg.norm(room) / room[2]))
    panel.set_box_aspect(tuple(room), zoom=zoom)  # type: ignore[call-arg,arg-type]
    panel.set_title("in space", fontsize=10)


def _draw_above(panel: Axes, place: np.ndarray, arrow: np.ndarray, size: np.ndarray, norm: Normalize) -> Quiver:
    panel.plot(place[:, 0], place[:, 1], linestyle="none", marker=".", markersize=2, color="0.6")
    drawn = panel.quiver(
        place[:, 0], place[:, 1], arrow[:, 0], arrow[:, 1], size, norm=norm, cmap=COLOUR_MAP, angles="xy",
        scale_units="xy", scale=1.0, width=0.005,
    )  # fmt: skip
    tips = np.concatenate([place, place + arrow])
    low, high = tips.min(axis=0), tips.max(axis=0)
    # Arrows and key have the scale of all three axes: targets along a vertical line would be all key.
    middle, half = (low + high) / 2, 0.54 * max(float((high - low)[:2].max()), NARROW * float((high - low).max()), 1e-6)
    panel.set_xlim(middle[0] - half, middle[0] + half)
    panel.set_ylim(middle[1] - (1.0 + KEY) * half, middle[1] + half)  # room for the key below the arrows
    panel.set_aspect("equal")
    panel.set_xlabel("x [mm]")
    panel.set_ylabel("y [mm]")
    panel.ticklabel_format(style="plain")
    panel.xaxis.set_major_locator(MaxNLocator(TICKS))
    panel.set_title("from above, horizontal part of the arrows", fontsize=10)
    return drawn


def _draw_key(panel: Axes, size: float, factor: float) -> None:
    """Draw a scale bar below the arrows: the drawn length of an error of some size, um."""
    left, right = panel.get_xlim()
    start, height = left + 0.04 * (right - left), panel.get_ylim()[0] + 0.2 * KEY * (right - left)
    end = start + 1e-3 * size * factor
    panel.plot([start, end], [height, height], color="black", linewidth=2)
    words = f"an error of {size:g} um is drawn this long"
    panel.text(end + 0.02 * (right - left), height, words, va="center", fontsize=9)
