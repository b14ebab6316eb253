"""Picture of a recheck: each value of the model and of what is new in standard errors, and the errors of the run."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptt.again.result import Recheck
from ptt.show.plots.common import BLUE, DARK, DPI, NOISE, ORANGE, PALE

SHOWN_VALUES = 16  # in a picture
KINDS = {"named": ORANGE, "new": DARK, "not named": BLUE}  # in the order in which they are drawn


class Value(NamedTuple):
    """One value of the picture: its name, kind (a key of `KINDS`) and distance in standard errors."""

    name: str
    kind: str
    z: float


def draw_moved(result: Recheck) -> Figure:
    """Draw the changes of values, those named and what is new first, and the errors of the run beside the noise floor.

    Args:
        result: the recheck.

    Returns:
        The figure.
    """
    values = values_of(result)
    figure = Figure(figsize=(9.6, 2.4 + 0.3 * max(len(values), 4)), dpi=DPI, layout="constrained")
    bars = bars_of(result)
    left, right = figure.subplots(1, 2, width_ratios=[2.0, 0.35 * len(bars)])
    _draw_values(left, values)
    right.bar(range(len(bars)), [um for um, _ in bars.values()], color=[colour for _, colour in bars.values()])
    right.set_xticks(range(len(bars)), list(bars), fontsize=9 if len(bars) < 4 else 8)
    right.axhline(result.noise_um["total"], color=NOISE, linestyle="--", linewidth=1.2, label="noise floor")
    right.set_ylabel("error of the run [um]")
    right.margins(y=0.25)
    right.legend(frameon=False, loc="upper left")
    for panel in (left, right):
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"verdict: {result.verdict}")
    return figure


def values_of(result: Recheck) -> list[Value]:
    """The values to draw: those that have changed, those of new effects (from zero), then the others.

    Args:
        result: the recheck.

    Returns:
        At most `SHOWN_VALUES`, of each kind the farthest first.
    """
    named = {(item.moved.effect, item.moved.name) for item in result.changed}
    values = [
        Value(f"{one.effect} {one.name}", "named" if (one.effect, one.name) in named else "not named", one.z)
        for one in result.parameters
    ]
    steps = {step[0] for step in result.suggested}
    candidates = () if result.new is None else result.new.candidates
    values += [
        Value(f"{each.effect} {one.name}", "new", one.value / one.std)
        for each in candidates
        if each.effect in steps
        for one in each.parameters
        if one.std
    ]
    return sorted(values, key=lambda one: ([*KINDS].index(one.kind), -abs(one.z)))[:SHOWN_VALUES]


def bars_of(result: Recheck) -> dict[str, tuple[float, str]]:
    """The errors to draw, um, and their colours: with changes and new effects only where there are any.

    Args:
        result: the recheck.

    Returns:
        Label -> error and colour.
    """
    error = result.error_um
    bars = {"expected": (error["expected"], PALE), "old\nmodel": (error["now"], ORANGE)}
    if result.changed:
        bars["with\nchanges"] = (error["left"], BLUE)
    if result.new is not None and result.suggested:
        bars["with\nnew"] = (result.new.rms_um["after"]["total"], DARK)
    return bars


def _draw_values(panel: Axes, values: list[Value]) -> None:
    # The axis is logarithmic beyond a few standard errors: beside a change of a hundred the others would collapse.
    panel.scatter([one.z for one in values], range(len(values)), color=[KINDS[one.kind] for one in values], zorder=3)
    panel.axvspan(-2.0, 2.0, color=PALE, alpha=0.4, linewidth=0, label="two standard errors")
    for kind, colour in KINDS.items():
        if any(one.kind == kind for one in values):
            panel.scatter([], [], color=colour, label=kind)
    panel.legend(frameon=False, fontsize=9, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    panel.set_xscale("symlog", linthresh=4.0)
    widest = max([4.0, *(abs(one.z) for one in values)])
    ticks = np.array([0.0, 2.0, 4.0, 10.0, 30.0] if widest < 60.0 else [0.0, 2.0, 10.0, 100.0, 1000.0])
    ticks = ticks[ticks <= 1.5 * widest]
    ticks = np.concatenate([-ticks[:0:-1], ticks])
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.set_xticks([], minor=True)
    panel.set_xlim(-1.6 * widest, 1.6 * widest)
    panel.set_yticks(range(len(values)), [one.name for one in values])
    panel.invert_yaxis()
    panel.set_xlabel("change since the model was made [standard errors]")
