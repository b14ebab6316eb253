"""Picture of a ladder: training and held-out error per axis after each step, and the noise floor."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ptt.judge.history import HistoryEntry
from ptt.judge.ladder.ladder import Ladder
from ptt.run.axes import AXES_TOTAL
from ptt.show.plots.common import NOISE, plain_log

DPI = 150
LEAST_UM = 1e-3  # smaller errors are drawn here, as a logarithmic axis has no zero: an arm in a plane may read none
TRAINING, HELD_OUT = "#33658a", "#f26419"
SIGNS = {"added": "+ ", "removed": "\N{MINUS SIGN} "}

Rung = tuple[str, dict[str, float], dict[str, float]]  # a step in words, training and held-out errors by axis, um


def draw_ladder(ladder: Ladder) -> Figure:
    """Draw a ladder.

    Args:
        ladder: the ladder.

    Returns:
        The figure.
    """
    rungs = [(SIGNS.get(s.kind, "") + s.effect, s.rms_um, s.heldout_rms_um) for s in ladder.steps]
    return draw_rungs(rungs, ladder.noise_um)


def draw_history(entries: Sequence[HistoryEntry]) -> Figure:
    """Draw a ladder from the history of a machine file.

    Args:
        entries: the steps of one ladder, as `ptt.judge.history.runs_of` cuts them.

    Returns:
        The figure.
    """
    rungs: list[Rung] = [("as given", entries[0].before_um, entries[0].heldout_before_um)]
    rungs += [(SIGNS.get(e.kind, "") + e.effect, e.after_um, e.heldout_after_um) for e in entries]
    return draw_rungs(rungs, entries[-1].noise_um)


def draw_rungs(rungs: Sequence[Rung], noise_um: dict[str, float]) -> Figure:
    """Draw errors after each step, one panel per axis and one for the total.

    Args:
        rungs: the steps in order.
        noise_um: axis or 'total' -> noise floor, um.

    Returns:
        The figure.
    """
    figure = Figure(dpi=DPI, figsize=(2.2 + 2.6 * len(AXES_TOTAL), 1.9 + 0.34 * len(rungs)))
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.06))
    panels = figure.subplots(1, len(AXES_TOTAL), sharey=True)
    for axis, panel in zip(AXES_TOTAL, panels, strict=True):
        _draw_panel(panel, axis, rungs, float(noise_um[axis]))
    panels[0].set_yticks(range(len(rungs)), [words for words, _, _ in rungs])
    panels[0].invert_yaxis()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle("Error after each step, RMS in \N{MICRO SIGN}m")
    return figure


def _draw_panel(panel: Axes, axis: str, rungs: Sequence[Rung], noise: float) -> None:
    place = range(len(rungs))
    training = [max(errors[axis], LEAST_UM) for _, errors, _ in rungs]
    held_out = [max(errors[axis], LEAST_UM) for _, _, errors in rungs]
    noise = max(noise, LEAST_UM)
    panel.axvline(noise, color=NOISE, linewidth=1.2, linestyle="--", label="noise floor")
    panel.plot(training, place, "o-", color=TRAINING, markersize=10, fillstyle="none", linewidth=1.4, label="training")
    panel.plot(held_out, place, "D", color=HELD_OUT, markersize=4, label="held out")
    panel.set_xscale("log")
    low, high = min(noise, *training, *held_out), max(noise, *training, *held_out)
    panel.set_xlim(low / (high / low) ** 0.1 / 1.2, high * (high / low) ** 0.35 * 1.4)
    decades = high / low > 30.0
    plain_log(panel.xaxis, (1.0,) if decades else (1.0, 2.0, 5.0))
    panel.set_title(axis)
    panel.grid(axis="x", which="both", color="0.92")
    panel.spines[["top", "right"]].set_visible(False)
    for row, value in enumerate(held_out):
        panel.annotate(
            f"{value:.3g}" if value > LEAST_UM else "0",
            (value, row),
            xytext=(9, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
        )
