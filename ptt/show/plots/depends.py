"""Picture of what an error depends on: readings and binned means with 95 % bands against each variable."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ptt.dependence.bins import binned_curve
from ptt.dependence.contexts import context_views, unit_of
from ptt.dependence.dependence import Dependence
from ptt.dependence.said import described
from ptt.judge.compare.comparison import Comparison
from ptt.run.axes import AXES
from ptt.run.problem import Problem
from ptt.show.plots.common import DARK, DPI, ORANGE, PALE, POINTS, legend_below

MOST_PANELS = 6
MOST_LEVELS = 6  # distinct values up to which a variable is drawn as levels, without a curve
PHASES = 10  # bins within a period
BINS = 12  # bins of any other variable


@dataclass(frozen=True)
class Panel:
    """What one panel shows: a component of the residual against a variable.

    Attributes:
        residual: the component, such as 'slider 2' or 'x'.
        on: name of the variable.
        found: the dependence; None where none was found, which the panel then shows.
    """

    residual: str
    on: str
    found: Dependence | None


def draw_dependences(result: Comparison, problem: Problem) -> Figure | None:
    """Draw the error against the variables that explain most.

    Args:
        result: the comparison.
        problem: its run.

    Returns:
        The figure, up to six panels; where there is no dependence, joints against their own position and direction;
        None where readings are too few to hold anything against them.
    """
    contexts = context_views(problem)
    pairs = panels_of(result, contexts)
    if not pairs:
        return None
    across = min(3, len(pairs))
    down = -(-len(pairs) // across)
    figure = Figure(
        figsize=(4.2 * across + 0.4, 3.5 * down + 0.9), dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1)
    )
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, pair in zip(panels, pairs, strict=False):
        _draw_pair(panel, pair, result, problem, contexts)
    for panel in panels[len(pairs) :]:
        panel.set_axis_off()
    found = bool(result.depends_on)
    figure.suptitle(
        "error after frame alignment: " + ("the variables that explain most" if found else "no variable explains it")
    )
    legend_below(figure, panels)
    return figure


def panels_of(result: Comparison, contexts: dict[str, np.ndarray]) -> list[Panel]:
    """The panels: each variable that the error depends on once, with the component that depends on it most.

    Args:
        result: the comparison.
        contexts: name -> values of each variable, (n,).

    Returns:
        At most six; none where no variable varies.
    """
    chosen: dict[str, Panel] = {}
    for item in result.depends_on:
        if item.on in contexts and item.on not in chosen:
            chosen[item.on] = Panel(item.residual, item.on, item)
    if chosen:
        return list(chosen.values())[:MOST_PANELS]
    names = [*result.joint] or list(AXES)
    own = [
        Panel(name, on, None)
        for prefix in ("b", "q", "direction")
        for index, name in enumerate(names)
        if (on := f"{prefix}{index + 1}") in contexts
    ]
    return own[:MOST_PANELS] or [Panel("x", name, None) for name in list(contexts)[:1]]


def variable_label(name: str, problem: Problem) -> str:
    """A variable's name and unit for an axis.

    Args:
        name: 'b2', 'direction1', 'payload', ...; of an unknown also 'way x', 'pause', 'feed', ...
        problem: the run; its machine's family, columns and clock decide on words and units.

    Returns:
        The label.
    """
    serial = problem.file.machine.kind == "serial"
    joint = problem.file.machine.noun
    plain = {
        "payload": "payload [kg]",
        "temperature": "temperature [deg C]",
        "time": "time [s]" if "time" in problem.view.varies else "row [1]",
        "run": "run [1]",
    }
    if name in plain or name in problem.table.watched:
        return plain.get(name, name)
    if name in AXES:
        return f"target {name} [mm]"
    told = described(name) or name
    if told != name or name == "feed":
        return f"{told} [{unit_of(problem, name) or '1'}]"
    if name.startswith("direction"):
        return f"{joint} {name[9:]} arrives [-1 {'back, +1 forward' if serial else 'down, +1 up'}]"
    if name.startswith("speed"):
        return f"speed of {joint} {name[5:]} [{'rad' if serial else 'mm'}/s]"
    return f"angle of joint {name[1:]} [rad]" if serial else f"height of slider {name[1:]} [mm]"


def _draw_pair(panel: Axes, pair: Panel, result: Comparison, problem: Problem, contexts: dict[str, np.ndarray]) -> None:
    error, unit = _error_of(pair.residual, result)
    found, values, label = pair.found, contexts[pair.on], variable_label(pair.on, problem)
    second = values if found is None or found.with_ is None else contexts[found.with_]
    rows = np.flatnonzero(result.kept & np.isfinite(values) & np.isfinite(second) & np.isfinite(error))
    if found is not None and found.with_ is not None:
        for side, colour, word in ((1.0, DARK, "+1"), (-1.0, ORANGE, "-1")):
            own = rows[values[rows] == side]
            _draw_curve(panel, second[own], error[own], colour, f"binned mean, 95 % band, arriving {word}")
        label, curve = f"{variable_label(found.with_, problem)}, by side of arrival ({pair.on})", None
        values = second
    elif found is not None and found.period_mm is not None:
        values = np.mod(values, found.period_mm)
        label, curve = f"{label}, within a period of {found.period_mm:.4g}", PHASES
    else:
        curve = BINS
    _draw_points(panel, values[rows], error[rows])
    if curve is not None:
        _draw_curve(panel, values[rows], error[rows], DARK, "binned mean, 95 % band", curve)
    panel.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    panel.set_xlabel(label, fontsize=9)
    panel.set_ylabel(f"{pair.residual} error [{unit}]", fontsize=9)
    share = "no dependence" if found is None else f"{100 * found.share:.0f} % of the variance"
    panel.set_title(share, fontsize=9, loc="left")


def _error_of(residual: str, result: Comparison) -> tuple[np.ndarray, str]:
    if residual in AXES:
        return 1e3 * result.residual[:, AXES.index(residual)], "um"
    factor, unit = (1e6, "urad") if residual.startswith("joint") else (1e3, "um")
    return factor * result.joint[residual], unit


def _draw_points(panel: Axes, values: np.ndarray, error: np.ndarray) -> None:
    """Draw readings; at a variable's few levels with random sideways shifts, so that they do not overlap."""
    step = max(1, -(-len(values) // POINTS))
    values, error = values[::step], error[::step]
    levels = np.unique(values)
    if len(levels) <= MOST_LEVELS:
        gap = float(np.diff(levels).min()) if len(levels) > 1 else 1.0
        values = values + np.random.default_rng(0).uniform(-0.15, 0.15, len(values)) * gap
        panel.set_xticks(levels)
    panel.plot(values, error, linestyle="none", marker=".", markersize=3.5, color=PALE, label="reading", zorder=1)


def _draw_curve(panel: Axes, values: np.ndarray, error: np.ndarray, colour: str, label: str, count: int = BINS) -> None:
    centre, mean, half = binned_curve(values, error, count).T
    if len(centre) <= MOST_LEVELS:
        panel.errorbar(
            centre,
            mean,
            yerr=half,
            color=colour,
            marker="o",
            markersize=5,
            linestyle="none",
            capsize=5,
            label=label,
            zorder=3,
        )
        return
    panel.fill_between(centre, mean - half, mean + half, color=colour, alpha=0.3, linewidth=0, zorder=2)
    panel.plot(centre, mean, color=colour, marker="o", markersize=3.5, linewidth=1.4, label=label, zorder=3)
