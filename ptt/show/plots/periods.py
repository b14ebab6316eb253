"""Picture of the periodogram of each joint's error, with the screw lead marked."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ptt.dependence.periods import Periodogram, periodogram
from ptt.judge.compare.comparison import Comparison
from ptt.run.holdout import pose_groups
from ptt.run.means import group_means
from ptt.run.problem import Problem
from ptt.show.plots.common import BLUE, DPI, ORANGE, legend_below, plain_log, thinned

DEGREE = 3  # of the polynomial in x, y, z that is regressed out before the periodogram
MANY = 100  # fewer means than this cannot afford its 20 terms: the polynomial is linear
FINER = 6  # frequencies drawn per trial frequency


def draw_periods(result: Comparison, problem: Problem) -> Figure | None:
    """Draw the periodogram of each joint's error over its own travel, the screw lead marked.

    Args:
        result: the comparison.
        problem: its run.

    Returns:
        The figure, a panel for each joint; None where joints visit too few positions for any periodogram.
    """
    joint, unit = problem.file.machine.noun, problem.file.machine.unit
    lines = {name: joint_periods(result, problem, name) for name in result.joint}
    lines = {name: line for name, line in lines.items() if len(line.period)}
    if not lines:
        return None
    across = 1 if len(lines) <= 3 else 2
    down = -(-len(lines) // across)
    size = (9.5 if across == 1 else 13.0, 2.4 * down + 1.2)
    figure = Figure(figsize=size, dpi=DPI, layout=ConstrainedLayoutEngine(h_pad=0.08, w_pad=0.08))
    panels = figure.subplots(down, across, squeeze=False, sharex=True)
    for panel, (name, line) in zip(panels.ravel(), lines.items(), strict=False):
        _draw_lines(panel, name, line, problem.view.lead, unit)
    ends = [bound for line in lines.values() for bound in (line.period.min(), line.period.max())]
    panels[0, 0].set_xscale("log")
    panels[0, 0].set_xlim(min(ends), max(ends))
    plain_log(panels[0, 0].xaxis)
    for panel in panels.ravel()[len(lines) :]:
        panel.set_axis_off()
    for column in range(across):  # in each column the lowest panel that is drawn has the labels
        lowest = panels[(len(lines) - 1 - column) // across, column]
        lowest.set_xlabel(f"period [{unit}]")
        lowest.tick_params(labelbottom=True)
    legend_below(figure, panels.ravel())
    figure.suptitle(f"periods in each {joint}'s error over its own travel, smooth course and directions taken out")
    return figure


def joint_periods(result: Comparison, problem: Problem, name: str) -> Periodogram:
    """Periodogram of one joint's error over its position, a polynomial in x, y, z and all directions regressed out.

    Args:
        result: the comparison.
        problem: its run.
        name: 'slider 2' or 'joint 2'.

    Returns:
        The periodogram of the mean errors of each pose and direction: visits of one are no independent errors.
    """
    index = int(name.split()[1]) - 1
    q, direction = problem.view.q.numpy()[result.kept], problem.view.direction.numpy()[result.kept]
    place = np.column_stack([pose_groups(problem.table)[result.kept], direction])
    number = np.unique(place, axis=0, return_inverse=True)[1].reshape(-1)
    values = np.column_stack([q[:, index], result.joint[name][result.kept], direction, problem.target[result.kept]])
    mean = group_means(values, number)[1]
    mean = mean[thinned(np.ones(len(mean), dtype=bool))]
    height, error = mean[:, 0], mean[:, 1]
    columns = np.column_stack([_smooth(mean[:, -3:]), mean[:, 2:-3]])
    error = error - columns @ np.linalg.lstsq(columns, error, rcond=1e-9)[0]
    coarse = periodogram(height, error)
    if not len(coarse.period):
        return coarse
    frequency = 1.0 / coarse.period
    fine = np.linspace(frequency[0], frequency[-1], FINER * len(frequency))
    return replace(periodogram(height, error, fine), chance=coarse.chance)


def _smooth(place: np.ndarray) -> np.ndarray:
    """Monomials of the coordinates (n, 3) up to the degree that rows allow, (n, m)."""
    scaled = (place - place.mean(axis=0)) / np.maximum(np.ptp(place, axis=0), 1e-9)
    degree = DEGREE if len(place) >= MANY else 1
    powers = [power for power in np.ndindex(*(degree + 1,) * 3) if sum(power) <= degree]
    return np.column_stack([np.prod(scaled ** np.array(power), axis=1) for power in powers])


def _draw_lines(panel: Axes, name: str, line: Periodogram, lead: float | None, unit: str) -> None:
    panel.plot(line.period, 100.0 * line.share, color=BLUE, linewidth=1.2, label="share of what is left")
    panel.axhline(
        100.0 * line.chance, color="0.4", linestyle="--", linewidth=1, label="noise reaches this 1 time in 100"
    )
    low, high = float(line.period.min()), float(line.period.max())
    for part, words in ((1.0, "screw lead"), (0.5, "half the lead")):
        if lead is not None and low <= part * lead <= high:
            style = "-" if part == 1.0 else ":"
            label = f"{words} {part * lead:g}"
            panel.axvline(part * lead, color=ORANGE, linestyle=style, linewidth=1.6, zorder=0, label=label)
    panel.set_ylim(0.0, 1.15 * 100.0 * max(float(line.share.max()), line.chance))
    panel.set_ylabel(f"{name} [%]")
    found = line.share.max() > line.chance
    panel.set_title(f"highest at {line.best:.4g} {unit}" if found else "none above noise", fontsize=9, loc="right")
