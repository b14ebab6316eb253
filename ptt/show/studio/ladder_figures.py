"""Pictures of errors beside the noise floor as plotly dictionaries: the ladder of a model, and a network's gain."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ptt.run.axes import AXES_TOTAL
from ptt.show.card.words import prefixed
from ptt.show.studio.figures import ABOVE, BLUE, GREY, ORANGE, PALE, VIOLET, Figure, axis_of, whole_figure
from ptt.show.studio.snapshot import Rung

Points = list[tuple[str, float]]  # step and error
LEAST_UM = 1e-3  # where the axis begins at the least: a logarithmic one has no zero, which an arm in a plane may read
TICKS = [step * 10.0**power for power in range(-3, 6) for step in (1, 2, 5)]
STAGES = {  # stages of a training -> legend and colour
    "given": ("as given, nothing held out", PALE),
    "physics": ("refitted, held out", BLUE),
    "rbf": ("with the network, held out", VIOLET),
}


def ladder_figure(rungs: Sequence[Rung], noise_um: Mapping[str, Any], axis: str = "total") -> Figure:
    """The error after each step, on training and on held-out rows, beside the noise floor.

    Of a step for which nothing was held out, the rms over all rows is shown.

    Args:
        rungs: the steps.
        noise_um: axis or 'total' -> noise floor, um.
        axis: 'x', 'y', 'z' or 'total'.

    Returns:
        The figure.
    """
    place = [f"{number}. {rung.words}" for number, rung in enumerate(rungs)]
    factor, unit = prefixed([float(rung.rms_um[axis]) for rung in rungs], "um")
    noise, least = factor * float(noise_um[axis]), factor * LEAST_UM
    train: Points = []
    held: Points = []
    plain: Points = []
    for at, rung in zip(place, rungs, strict=True):
        (plain if rung.heldout_rms_um is None else train).append((at, factor * float(rung.rms_um[axis])))
        if rung.heldout_rms_um is not None:
            held.append((at, factor * float(rung.heldout_rms_um[axis])))
    values = [max(value, least) for value in (noise, *(value for _, value in (*train, *held, *plain)))]
    bounds = [float(np.log10(min(values) / 1.6)), float(np.log10(max(values) * 2.0))]
    return whole_figure(
        [_trained(train), _told(held, "held out"), _floor(place, noise), _told(plain, "")],
        xaxis={**axis_of(""), "type": "category", "categoryorder": "array", "categoryarray": place},
        yaxis={**axis_of(f"RMS error, {axis} [{unit}]"), "type": "log", "range": bounds, "tickvals": TICKS},
        showlegend=True,
        legend=ABOVE,
        margin={"l": 62, "r": 14, "t": 30, "b": 28},
    )


def _trained(points: Points) -> Figure:
    marker = {"size": 13, "symbol": "circle-open", "line": {"width": 2}}
    return {**_steps(points, "training"), "mode": "lines+markers", "line": {"color": BLUE}, "marker": marker}


def _told(points: Points, name: str) -> Figure:
    """Points labelled with their values: held-out errors, or, without a name, errors over all rows."""
    marker = {"size": 8, "symbol": "diamond", "color": ORANGE}
    plain = {"size": 11, "symbol": "square-open", "color": BLUE}
    return {
        **_steps(points, name or "all rows, not refitted"), "mode": "markers+text", "textposition": "top right",
        "text": [f"{value:.1f}" for _, value in points], "cliponaxis": False, "marker": marker if name else plain,
    }  # fmt: skip


def _floor(place: Sequence[str], noise: float) -> Figure:
    """The noise floor as a line; as a dash where there is only one step."""
    own: Figure = {"mode": "lines", "line": {"color": GREY, "dash": "dash"}}
    if len(place) == 1:
        own = {"mode": "markers", "marker": {"symbol": "line-ew-open", "size": 40, "color": GREY, "line": {"width": 2}}}
    return {"type": "scatter", "x": [place[0], place[-1]], "y": [noise, noise], "name": "noise floor", **own}


def _steps(points: Points, name: str) -> Figure:
    """Entries that traces of the ladder share; invisible without points."""
    places, values = [at for at, _ in points], [value for _, value in points]
    return {"type": "scatter", "x": places, "y": values, "name": name, "visible": bool(points)}


def before_after_figure(stages: Mapping[str, Mapping[str, float]], noise_um: Mapping[str, Any]) -> Figure:
    """Errors per axis as given and, held out, after physics and after the network, beside the noise floor.

    Args:
        stages: 'given', 'physics', 'rbf' -> axis or 'total' -> rms error, um.
        noise_um: axis or 'total' -> noise floor, um.

    Returns:
        The figure.
    """
    factor, unit = prefixed([float(stages[key][axis]) for key in STAGES for axis in AXES_TOTAL], "um")
    bars = [_bars(key, [factor * float(stages[key][axis]) for axis in AXES_TOTAL]) for key in STAGES]
    floor = {
        "type": "scatter", "mode": "markers", "name": "noise floor", "x": list(AXES_TOTAL),
        "y": [factor * float(noise_um[axis]) for axis in AXES_TOTAL],
        "marker": {"symbol": "line-ew-open", "size": 44, "color": ORANGE, "line": {"width": 3}},
    }  # fmt: skip
    return whole_figure(
        [*bars, floor],
        xaxis=axis_of(""),
        barmode="group",
        showlegend=True,
        yaxis={**axis_of(f"RMS error [{unit}]"), "rangemode": "tozero"},
        legend=ABOVE | {"y": 1.06},
        margin={"l": 62, "r": 10, "t": 40, "b": 30},
    )


def _bars(key: str, values: Sequence[float]) -> Figure:
    words, colour = STAGES[key]
    return {
        "type": "bar", "name": words, "x": list(AXES_TOTAL), "y": list(values), "marker": {"color": colour},
        "text": [f"{value:.1f}" for value in values], "textposition": "inside", "insidetextanchor": "start",
        "textangle": 0, "constraintext": "none", "textfont": {"size": 11},
    }  # fmt: skip
