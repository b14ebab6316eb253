"""Pictures of a comparison: error field, dependences, error over time, histogram, periodogram."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from ptt.judge.compare.comparison import Comparison
from ptt.progress import Progress, unwatched
from ptt.run.axes import AXES
from ptt.run.problem import Problem
from ptt.show.plots.common import BLUE, DPI, ORANGE, legend_below, save, thinned
from ptt.show.plots.depends import draw_dependences
from ptt.show.plots.field import draw_field
from ptt.show.plots.periods import draw_periods

BINS = 40
TICKS = 4  # intervals between ticks of a histogram, few enough for labels of six digits, as of a telescope's errors
BAND_SIGMAS = 2.0  # half-width of the noise band in standard deviations


def plot_comparison(
    result: Comparison, problem: Problem, folder: str | Path, *, progress: Progress = unwatched
) -> tuple[Path, ...]:
    """Draw all pictures of a comparison.

    Args:
        result: the comparison.
        problem: its run.
        folder: to write them into; made if missing.
        progress: told what is being drawn.

    Returns:
        The PNG files written.
    """
    draws = {
        "error_field": draw_field,
        "depends_on": draw_dependences,
        "over_time": draw_course,
        "histogram": draw_histogram,
        "periodogram": draw_periods,
    }
    written = []
    for number, (name, draw) in enumerate(draws.items()):
        progress(f"draw {name}", number, len(draws))
        figure = draw(result, problem)
        if figure is not None:
            written.append(Path(folder) / f"{name}.png")
            save(figure, written[-1])
    return tuple(written)


def draw_course(result: Comparison, problem: Problem) -> Figure:
    """Draw the error over time, or over rows where there is no clock.

    Args:
        result: the comparison.
        problem: its run.

    Returns:
        The figure, a panel for each axis.
    """
    clock = "time" in problem.view.varies
    at = problem.view.time.numpy() / 60.0 if clock else problem.table.line.astype(float)
    across = "time [min]" if clock else "line in the file"
    if np.any(np.diff(at[result.kept]) < 0):  # clocks of several runs, or lines of several files, begin anew
        clock, at, across = False, np.arange(len(at), dtype=float), "row"
    figure = Figure(figsize=(10.5, 7.2), dpi=DPI, layout=ConstrainedLayoutEngine(h_pad=0.08))
    panels = figure.subplots(3, 1, sharex=True)
    rows = thinned(result.kept)
    starts = np.flatnonzero(np.diff(problem.table.run) != 0) + 1
    for axis, panel in enumerate(panels):
        error = 1e3 * result.residual[:, axis]
        panel.plot(at[rows], error[rows], linestyle="none", marker=".", markersize=4, color=BLUE, label="reading")
        _draw_noise_band(panel, result, axis)
        for number, start in enumerate(starts):
            panel.axvline(at[start], color="0.5", linestyle=":", linewidth=1, label="next run" if not number else None)
        panel.set_ylabel(f"{AXES[axis]} error [um]")
        panel.margins(x=0.01)
    panels[-1].set_xlabel(across)
    legend_below(figure, panels)
    figure.suptitle(f"error after frame alignment over {'time' if clock else 'the rows'}{_left_out(result)}")
    return figure


def draw_histogram(result: Comparison, problem: Problem) -> Figure:
    """Draw histograms of the errors, with the normal distribution of the noise floor.

    Args:
        result: the comparison.
        problem: its run.

    Returns:
        The figure, a panel for each axis; counts on a logarithmic scale, so that tails can be seen.
    """
    figure = Figure(figsize=(11.5, 4.2), dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
    panels = figure.subplots(1, 3)
    for axis, panel in enumerate(panels):
        error = 1e3 * result.residual[result.kept, axis]
        sigma = 0.0 if result.noise is None else 1e3 * float(result.noise.sigma[axis])
        reach = 1.05 * max(float(np.abs(error).max()), 3.5 * sigma, 1e-3)
        count, edges, _ = panel.hist(error, bins=BINS, range=(-reach, reach), color=BLUE, label="readings")
        top = float(count.max())
        if sigma > 0.0:
            x = np.linspace(-4.5 * sigma, 4.5 * sigma, 400)
            curve = len(error) * (edges[1] - edges[0]) * np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
            panel.plot(x, curve, color=ORANGE, linewidth=2, label="noise alone, as many readings")
            top = max(top, float(curve.max()))
        panel.set_yscale("log")
        panel.set_ylim(0.5, 2.0 * top)
        panel.set_xlim(-reach, reach)
        panel.xaxis.set_major_locator(MaxNLocator(TICKS, steps=[1, 2, 5, 10]))
        rms = float(np.sqrt(np.square(error).mean()))
        panel.set_title(f"{AXES[axis]}: rms {rms:.1f} um" + (f", noise {sigma:.1f} um" if sigma else ""), fontsize=10)
        panel.set_xlabel(f"{AXES[axis]} error [um]")
    panels[0].set_ylabel(f"readings per bin, {len(error)} in all")
    legend_below(figure, panels)
    figure.suptitle(
        "errors after frame alignment" + (" against the noise floor" if result.noise else ", noise floor unknown")
    )
    return figure


def _draw_noise_band(panel: Axes, result: Comparison, axis: int) -> None:
    panel.axhline(0.0, color="0.4", linewidth=0.8, zorder=0)
    if result.noise is not None:
        half = BAND_SIGMAS * 1e3 * float(result.noise.sigma[axis])
        panel.axhspan(-half, half, color=ORANGE, alpha=0.35, linewidth=0, label="noise, +-2 sigma", zorder=0.5)


def _left_out(result: Comparison) -> str:
    return f"; {len(result.outliers)} gross errors left out" if result.outliers else ""
