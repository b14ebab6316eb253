"""Pictures of the page as plotly dictionaries: residual against a variable, ladder, before and after."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ptt.show.card.words import prefixed
from ptt.show.studio.looks import Look
from ptt.show.studio.session import Rung

Figure = dict[str, Any]

MOST = 1500  # readings drawn; more make the page slow and hide each other
BLUE, PALE, DARK, ORANGE, GREY = "#31688e", "#8fb4d0", "#440154", "#e69f00", "#6b705c"
MIDDLE = "#6f777d"  # read on white and on dark alike
FONT = {"family": "Roboto, Arial, sans-serif", "size": 13, "color": MIDDLE}
GRID = "rgba(128,136,144,0.28)"
UM = 1e3

UNITS = {"b": "mm", "q": "rad", "x": "mm", "y": "mm", "z": "mm", "payload": "kg", "temperature": "\N{DEGREE SIGN}C"}


def empty_figure() -> Figure:
    """A figure of nothing, without axes: what is there before anything is known."""
    return {"data": [], "layout": {"xaxis": {"visible": False}, "yaxis": {"visible": False}}}


def label_of(context: str, look: Look) -> str:
    """Name of a context with its unit, as an axis has it."""
    rate = "rad/s" if look.serial else "mm/s"
    if context.startswith("direction"):
        return f"direction of {'joint' if look.serial else 'slider'} {context[9:]}"
    if context.startswith("speed"):
        return f"speed of {'joint' if look.serial else 'slider'} {context[5:]} [{rate}]"
    if context == "time":
        return "time [s]" if "time [s]" in look.covariates else "reading number"
    if context == "run":
        return "run number"
    if context[:1] in "bq" and context[1:].isdigit():
        return f"{'joint angle' if look.serial else 'slider height'} {context} [{UNITS[context[0]]}]"
    return f"{context} [{UNITS.get(context, '')}]" if context in UNITS else context


def short_label(context: str, look: Look) -> str:
    """Name of a context with its unit, as a menu has it."""
    return label_of(context, look).replace("slider height", "height").replace("joint angle", "angle")


def unit_of(view: str, values: np.ndarray) -> tuple[str, float]:
    """Unit a residual is drawn in, and the factor to it.

    Args:
        view: component of the residual.
        values: (n,) mm or rad.

    Returns:
        Unit with the prefix that suits the largest, and what values are multiplied by.
    """
    base, small = ("urad", 1e6) if view.startswith("joint") else ("um", UM)
    factor, unit = prefixed([float(np.nanmax(np.abs(values), initial=0.0)) * small], base)
    return unit, factor * small


def shown_rows(look: Look, picked: Sequence[int] = ()) -> np.ndarray:
    """Rows that are drawn: all of a small run, evenly thinned ones of a large run, those picked always.

    Args:
        look: the run.
        picked: row numbers.

    Returns:
        (m,) row numbers, ascending.
    """
    rows = np.flatnonzero(look.kept)
    thin = rows[np.unique(np.linspace(0, len(rows) - 1, min(MOST, len(rows))).astype(int))] if len(rows) else rows
    extra = np.asarray(list(picked)[:MOST], dtype=int)
    return np.union1d(thin, extra[look.kept[extra]] if len(extra) else extra).astype(int)


def against_figure(
    look: Look, view: str, context: str, picked: Sequence[int] = (), beside: tuple[str, Look] | None = None
) -> Figure:
    """A residual against a variable.

    Args:
        look: the run.
        view: component of the residual.
        context: variable.
        picked: row numbers to highlight.
        beside: words and look of another model, drawn pale behind.

    Returns:
        The figure; dragging a box picks readings.
    """
    rows, (unit, factor) = shown_rows(look, picked), unit_of(view, look.views[view])
    across, label = look.contexts[context], label_of(context, look)
    if label == "time [s]":
        scale, clock = prefixed(across[rows].tolist(), "s")
        across, label = scale * across, f"time [{clock}]"
    axis = axis_of(label)
    if context.startswith("direction"):
        spread = np.random.default_rng(0).uniform(-0.15, 0.15, look.rows)  # so that points do not hide each other
        across, words = across + spread, ("back", "forward") if look.serial else ("down", "up")
        axis |= {"tickvals": [-1, 1], "ticktext": [f"arriving {word}" for word in words], "range": [-1.6, 1.6]}
    data = []
    if beside is not None and view in beside[1].views:
        other = beside[1].views[view][rows] * factor
        data.append(_points(across[rows], other, rows, PALE, beside[0], symbol="circle-open"))
    own = f"model with {', '.join(look.effects)}" if look.effects else "model without effects"
    data.append(_points(across[rows], look.views[view][rows] * factor, rows, BLUE, own))
    if len(picked):
        chosen = np.asarray(list(picked)[:MOST], dtype=int)
        data.append(_points(across[chosen], look.views[view][chosen] * factor, chosen, ORANGE, "picked", size=9))
    layout = whole_layout(
        xaxis=axis,
        yaxis=axis_of(f"{view} [{unit}]", zeroline=True),
        margin={"l": 62, "r": 10, "t": 28 if beside else 8, "b": 44},
        showlegend=beside is not None,
        dragmode="select",
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "font": {"size": 11}},
        uirevision=f"{view}{context}",
        selectionrevision=str(hash(tuple(picked))),
    )
    return whole_figure(data, layout)


def ladder_figure(rungs: Sequence[Rung], noise_um: Mapping[str, Any], axis: str = "total") -> Figure:
    """The error after each step, training and held out, beside the noise floor; plain where nothing was held out.

    Args:
        rungs: the steps.
        noise_um: noise floor.
        axis: 'x', 'y', 'z' or 'total'.

    Returns:
        The figure.
    """
    place = [f"{number}. {rung.words}" for number, rung in enumerate(rungs)]
    parted = [(at, rung.rms_um, rung.heldout_rms_um) for at, rung in zip(place, rungs, strict=True)]
    factor, unit = prefixed([float(rung.rms_um[axis]) for rung in rungs], "um")
    held = [(at, factor * float(figure[axis])) for at, _, figure in parted if figure is not None]
    train = [(at, factor * float(figure[axis])) for at, figure, other in parted if other is not None]
    plain = [(at, factor * float(figure[axis])) for at, figure, other in parted if other is None]
    noise = factor * float(noise_um[axis])
    data: list[Figure] = [
        {
            **_steps(train, "training"),
            "mode": "lines+markers",
            "line": {"color": BLUE},
            "marker": {"size": 13, "symbol": "circle-open", "line": {"width": 2}},
        },
        {
            **_steps(held, "held out"),
            "mode": "markers+text",
            "text": [f"{value:.1f}" for _, value in held],
            "textposition": "top right",
            "marker": {"size": 8, "symbol": "diamond", "color": ORANGE},
            "cliponaxis": False,
        },
        {
            "type": "scatter",
            "mode": "lines",
            "x": [place[0], place[-1]],
            "y": [noise, noise],
            "name": "noise floor",
            "line": {"color": GREY, "dash": "dash"},
        },
        {
            **_steps(plain, "all rows, not refitted"),
            "mode": "markers+text",
            "textposition": "top right",
            "text": [f"{value:.1f}" for _, value in plain],
            "cliponaxis": False,
            "marker": {"size": 11, "symbol": "square-open", "color": BLUE},
        },
    ]
    if len(place) == 1:
        data[2] |= {"mode": "markers", "marker": {"symbol": "line-ew-open", "size": 40, "color": GREY}}
    all_of_them = [value for _, value in (*train, *held, *plain)]
    top, low = max(*all_of_them, noise), min(*all_of_them, noise)
    ticks = [step * 10.0**power for power in range(-3, 6) for step in (1, 2, 5)]
    bounds = [float(np.log10(low / 1.6)), float(np.log10(top * 2.0))]
    layout = whole_layout(
        xaxis={**axis_of(""), "type": "category", "categoryorder": "array", "categoryarray": place},
        showlegend=True,
        yaxis={**axis_of(f"RMS error, {axis} [{unit}]"), "type": "log", "range": bounds, "tickvals": ticks},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        margin={"l": 62, "r": 14, "t": 30, "b": 28},
    )
    return whole_figure(data, layout)


def before_after_figure(stages: Mapping[str, Mapping[str, float]], noise_um: Mapping[str, Any]) -> Figure:
    """Held-out errors per axis as given, after physics and after the network, beside the noise floor.

    Args:
        stages: 'given', 'physics', 'rbf' -> figures in um.
        noise_um: noise floor.

    Returns:
        The figure.
    """
    axes = ("x", "y", "z", "total")
    words = {"given": ("model as given", PALE), "physics": ("refitted", BLUE), "rbf": ("with the network", DARK)}
    factor, unit = prefixed([float(stages[key][axis]) for key in words for axis in axes], "um")
    data: list[Figure] = [
        {
            "type": "bar",
            "name": words[key][0],
            "x": list(axes),
            "y": [factor * float(stages[key][axis]) for axis in axes],
            "marker": {"color": words[key][1]},
            "text": [f"{factor * stages[key][axis]:.1f}" for axis in axes],
            "textposition": "inside",
            "insidetextanchor": "start",
            "textangle": 0,
            "constraintext": "none",
            "textfont": {"size": 11},
        }
        for key in words
    ]
    data.append(
        {
            "type": "scatter",
            "mode": "markers",
            "name": "noise floor",
            "x": list(axes),
            "y": [factor * float(noise_um[axis]) for axis in axes],
            "marker": {"symbol": "line-ew-open", "size": 44, "color": ORANGE, "line": {"width": 3}},
        }
    )
    layout = whole_layout(
        xaxis=axis_of(""),
        barmode="group",
        showlegend=True,
        yaxis={**axis_of(f"RMS error, held out [{unit}]"), "rangemode": "tozero"},
        legend={"orientation": "h", "y": 1.06, "yanchor": "bottom", "x": 0},
        margin={"l": 62, "r": 10, "t": 40, "b": 30},
    )
    return whole_figure(data, layout)


def _steps(points: Sequence[tuple[str, float]], name: str) -> Figure:
    """A trace of the ladder; nothing of it is seen where it has no points."""
    places, values = [at for at, _ in points], [value for _, value in points]
    return {"type": "scatter", "x": places, "y": values, "name": name, "visible": bool(points)}


def _points(
    x: np.ndarray, y: np.ndarray, rows: np.ndarray, colour: str, name: str, *, symbol: str = "circle", size: int = 5
) -> Figure:
    return {
        **_mark(x.tolist(), y.tolist(), {"color": colour, "symbol": symbol, "size": size}, name),
        "customdata": rows.tolist(),
        "unselected": {"marker": {"opacity": 1.0}},  # what is picked is marked in every picture alike
    }


def _mark(x: Sequence[float], y: Sequence[float], marker: Figure, name: str) -> Figure:
    return {"type": "scatter", "mode": "markers", "x": list(x), "y": list(y), "marker": marker, "name": name}


def axis_of(title: str, zeroline: bool = False) -> Figure:
    """An axis with its title; numbers are written out, never with a prefix of plotly's own."""
    return {
        "title": {"text": title, "standoff": 8, "font": {"size": 13}},
        "gridcolor": GRID,
        "zeroline": zeroline,
        "zerolinecolor": "#888",
        "linecolor": "#888",
        "automargin": True,
        "exponentformat": "power",
        "separatethousands": True,
    }


def whole_layout(**own: Any) -> Figure:
    """Layout that every picture shares, with its own entries."""
    return {"font": FONT, "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)", "autosize": True, **own}


def whole_figure(data: list[Figure], layout: Figure) -> Figure:
    """Traces and layout as one figure, its tool bar left out."""
    config = {"displaylogo": False, "displayModeBar": False, "scrollZoom": True, "responsive": True}
    return {"data": data, "layout": layout, "config": config}
