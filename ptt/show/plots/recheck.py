"""Picture of a recheck: change of each value of the model in standard errors, and the errors of the run."""

import numpy as np
from matplotlib.figure import Figure

from ptt.again.result import Recheck
from ptt.show.plots.common import BLUE, DPI, NOISE, ORANGE, PALE

SHOWN_VALUES = 16  # in a picture


def draw_moved(result: Recheck) -> Figure:
    """Draw the changes of values, those named as changed first, and the errors of the run beside the noise floor.

    Args:
        result: the recheck.

    Returns:
        The figure.
    """
    named = {(item.moved.effect, item.moved.name) for item in result.changed}
    order = sorted(result.parameters, key=lambda one: ((one.effect, one.name) not in named, -abs(one.z)))[:SHOWN_VALUES]
    figure = Figure(figsize=(9.6, 2.4 + 0.3 * max(len(order), 4)), dpi=DPI, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[2.0, 1.0])
    colours = [ORANGE if (one.effect, one.name) in named else BLUE for one in order]
    # The axis is logarithmic beyond a few standard errors: beside a change of a hundred the others would collapse.
    left.scatter([one.z for one in order], range(len(order)), color=colours, zorder=3)
    left.axvspan(-2.0, 2.0, color=PALE, alpha=0.4, linewidth=0, label="two standard errors")
    for colour, label in ((ORANGE, "named"), (BLUE, "not named")):
        left.scatter([], [], color=colour, label=label)
    left.legend(frameon=False, fontsize=9, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    left.set_xscale("symlog", linthresh=4.0)
    widest = max([4.0, *(abs(one.z) for one in order)])
    ticks = np.array([0.0, 2.0, 4.0, 10.0, 30.0, 100.0, 300.0, 1000.0])
    ticks = ticks[ticks <= 1.5 * widest]
    ticks = np.concatenate([-ticks[:0:-1], ticks])
    left.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    left.set_xticks([], minor=True)
    left.set_xlim(-1.6 * widest, 1.6 * widest)
    left.set_yticks(range(len(order)), [f"{one.effect} {one.name}" for one in order])
    left.invert_yaxis()
    left.set_xlabel("change since the model was made [standard errors]")
    names = ("expected", "now", "left")
    right.bar(range(3), [result.error_um[name] for name in names], color=[PALE, ORANGE, BLUE])
    right.set_xticks(range(3), ["expected", "old\nmodel", "with named\nchanges"], fontsize=9)
    right.axhline(result.noise_um["total"], color=NOISE, linestyle="--", linewidth=1.2, label="noise floor")
    right.set_ylabel("error of the run [um]")
    right.margins(y=0.25)
    right.legend(frameon=False, loc="upper left")
    for panel in (left, right):
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"verdict: {result.verdict}")
    return figure
