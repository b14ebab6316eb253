"""Pictures of the demo's experiments: how much less error, and the path before and after."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ptt.show.plots.common import save
from ptt.show.plots.compensation import AFTER, AXES, BEFORE, DPI

GOAL = "#444444"
BARS = ("#9ab8c4", "#00798c", "#003d5b", "#edae49", "#d1495b", "#66a182")
LABEL = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}


def plot_reductions(
    reductions: Mapping[str, Sequence[Sequence[float]]],
    labels: Sequence[str],
    path: str | Path,
    *,
    title: str = "",
    goals: Sequence[float] = (90.0, 90.0, 80.0),
) -> None:
    """Draw the error reduction of each axis as bars, one group per experiment, one colour per protocol.

    Args:
        reductions: protocol -> (e, 3) percent.
        labels: (e,) names of the experiments.
        path: PNG to write.
        title: of the picture.
        goals: percent per axis, drawn as a line.
    """
    figure = Figure(figsize=(11.0, 6.4), dpi=DPI, layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    width = 0.8 / max(len(reductions), 1)
    place = np.arange(len(labels))
    for row, axis in enumerate(AXES):
        panel: Axes = panels[row]
        for index, (name, values) in enumerate(reductions.items()):
            heights = np.asarray(values, dtype=float)[:, row]
            at = place + (index - (len(reductions) - 1) / 2) * width
            panel.bar(at, np.maximum(heights, 0.0), 0.92 * width, color=BARS[index % len(BARS)], label=name)
            for x, height in zip(at, heights, strict=True):
                place_y = max(height, 0.0) + 2.5
                panel.text(x, place_y, f"{height:.1f}", ha="center", va="bottom", fontsize=6.5, rotation=90, bbox=LABEL)
        panel.axhline(goals[row], color=GOAL, linewidth=1.0, linestyle="--", label="goal of the source paper")
        panel.set_ylabel(f"{axis}: less error [%]")
        panel.set_ylim(0.0, 128.0)
        panel.set_yticks([0, 25, 50, 75, 100])
    panels[-1].set_xticks(place, labels)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    figure.suptitle(title)
    save(figure, path)


def plot_path(
    target: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    path: str | Path,
    *,
    title: str = "",
    magnify: float = 20.0,
) -> None:
    """Draw the wanted path and the two that were measured, in space and from above, errors magnified.

    Args:
        target: (m, 3) mm.
        before: (m, 3) mm, errors before.
        after: (m, 3) mm, errors after.
        path: PNG to write.
        title: of the picture.
        magnify: how many times larger errors are drawn.
    """
    figure = Figure(figsize=(11.0, 5.4), dpi=DPI, layout="constrained")
    space = figure.add_subplot(1, 2, 1, projection="3d")
    above = figure.add_subplot(1, 2, 2)
    lines = (
        (target + magnify * before, BEFORE, "-", f"before, error x {magnify:g}", 1.6),
        (target + magnify * after, AFTER, "-", f"after, error x {magnify:g}", 3.2),
        (target, "#000000", ":", "wanted", 1.2),
    )
    for points, colour, style, name, width in lines:
        space.plot(*points.T, color=colour, linestyle=style, linewidth=width)
        above.plot(points[:, 0], points[:, 1], label=name, color=colour, linestyle=style, linewidth=width)
    space.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    space.set_box_aspect((1.0, 1.0, 0.75), zoom=0.95)
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    above.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title="from above")
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    figure.suptitle(title)
    save(figure, path)
