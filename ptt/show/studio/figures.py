"""Pictures of the page as plotly dictionaries: what they share, and a residual against a variable."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ptt.dependence.contexts import is_direction
from ptt.show.card.words import prefixed, spoken
from ptt.show.sizing import spread
from ptt.show.studio.looks import Look

Figure = dict[str, Any]

MOST_READINGS = 1500  # drawn at most; more make the page slow and hide each other
# Visible on light and on dark background, and distinguishable in all kinds of colour vision.
BLUE, PALE, VIOLET, ORANGE, GREY = "#3a84b4", "#8fb4d0", "#9467bd", "#c98500", "#7c8270"
MIDDLE = "#6f777d"  # of text, readable on light and on dark background
FONT = {"family": "Roboto, Arial, sans-serif", "size": 13, "color": MIDDLE}
GRID = "rgba(128,136,144,0.28)"
ABOVE = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0}  # a legend above the picture
UM = 1e3  # um per mm

UNITS = {"b": "mm", "q": "rad", "x": "mm", "y": "mm", "z": "mm", "payload": "kg", "temperature": "\N{DEGREE SIGN}C"}


def empty_figure() -> Figure:
    """A figure without data and axes, as a placeholder."""
    return {"data": [], "layout": {"xaxis": {"visible": False}, "yaxis": {"visible": False}}}


def across_axis(label: str, values: np.ndarray, serial: bool, sided: bool) -> tuple[Figure, np.ndarray]:
    """The axis of a variable, and its values along that.

    Args:
        label: of the axis, with the unit of the values.
        values: (n,).
        serial: whether the machine is an arm.
        sided: whether the variable is a direction of arrival; offsets then keep points from hiding each other.

    Returns:
        The axis, and the values, (n,), times in s in the unit that suits them.
    """
    if sided:
        words = ("back", "forward") if serial else ("down", "up")
        sides = {"tickvals": [-1, 1], "ticktext": [f"arriving {word}" for word in words], "range": [-1.6, 1.6]}
        return axis_of(label) | sides, values + np.random.default_rng(0).uniform(-0.15, 0.15, len(values))
    if label.endswith("[s]"):
        scale, unit = prefixed(values.tolist(), "s")
        return axis_of(label.replace("[s]", f"[{unit}]")), scale * values
    return axis_of(label), values


def label_of(context: str, look: Look) -> str:
    """Name of a context with its unit, for menus and axes."""
    if context == "time":
        return "time [s]" if "time [s]" in look.covariates else "reading number"
    if context == "run":
        return "run number"
    units = UNITS | {"speed": "rad/s" if look.serial else "mm/s"}
    unit = units.get(context.rstrip("0123456789"), "")
    return f"{spoken(context, look.serial)} [{unit}]" if unit else spoken(context, look.serial)


def unit_of(view: str, values: np.ndarray) -> tuple[str, float]:
    """Unit in which a residual is drawn, and the factor to it.

    Args:
        view: component of the residual.
        values: its values, (n,) mm or rad.

    Returns:
        Unit with the prefix that suits the largest value, and the factor on values.
    """
    base, small = ("urad", 1e6) if view.startswith("joint") else ("um", UM)
    factor, unit = prefixed([float(np.nanmax(np.abs(values), initial=0.0)) * small], base)
    return unit, factor * small


def shown_rows(look: Look, picked: Sequence[int] = ()) -> np.ndarray:
    """Rows that are drawn: all of a small run, evenly thinned ones of a large run, and always those picked.

    Args:
        look: the run.
        picked: row numbers.

    Returns:
        (m,) row numbers, ascending.
    """
    rows = np.flatnonzero(look.kept)
    extra = np.asarray(list(picked)[:MOST_READINGS], dtype=int)
    shown = rows[spread(len(rows), MOST_READINGS)]
    return np.union1d(shown, extra[look.kept[extra]] if len(extra) else extra).astype(int)


def against_figure(
    look: Look, view: str, context: str, picked: Sequence[int] = (), beside: tuple[str, Look] | None = None
) -> Figure:
    """A residual against a variable.

    Args:
        look: the run.
        view: component of the residual.
        context: variable.
        picked: row numbers to highlight.
        beside: words on another model and its look, drawn in pale behind; None for none.

    Returns:
        The figure; dragging a box picks readings.
    """
    rows, (unit, factor) = shown_rows(look, picked), unit_of(view, look.views[view])
    sided = is_direction(context)
    axis, across = across_axis(label_of(context, look), look.contexts[context], look.serial, sided)
    data = []
    if beside is not None and view in beside[1].views:
        other = beside[1].views[view][rows] * factor
        data.append(_rows(across[rows], other, rows, PALE, beside[0], symbol="circle-open"))
    own = f"model with {', '.join(look.effects)}" if look.effects else "model without effects"
    data.append(_rows(across[rows], look.views[view][rows] * factor, rows, BLUE, own))
    if len(picked):
        chosen = np.asarray(list(picked)[:MOST_READINGS], dtype=int)
        data.append(_rows(across[chosen], look.views[view][chosen] * factor, chosen, ORANGE, "picked", size=9))
    return whole_figure(
        data,
        xaxis=axis,
        yaxis=axis_of(f"{view} [{unit}]", zeroline=True),
        margin={"l": 62, "r": 10, "t": 28 if beside else 8, "b": 44},
        showlegend=beside is not None,
        dragmode="select",
        legend=ABOVE | {"font": {"size": 11}},
        uirevision=f"{view}{context}",
        selectionrevision=str(hash(tuple(picked))),
    )


def _rows(
    x: np.ndarray, y: np.ndarray, rows: np.ndarray, colour: str, name: str, *, symbol: str = "circle", size: int = 5
) -> Figure:
    """Readings that can be picked."""
    seen = {"marker": {"opacity": 1.0}}  # picked readings have a trace of their own
    return points(x, y, colour, name, size, symbol) | {"customdata": rows.tolist(), "unselected": seen}


def points(x: Any, y: Any, colour: str, name: str, size: int = 5, symbol: str = "circle") -> Figure:
    """Points as a trace; without a name it is in no legend."""
    return {
        "type": "scatter", "mode": "markers", "x": np.asarray(x).tolist(), "y": np.asarray(y).tolist(), "name": name,
        "marker": {"color": colour, "symbol": symbol, "size": size}, "showlegend": bool(name),
    }  # fmt: skip


def axis_of(title: str, zeroline: bool = False) -> Figure:
    """An axis with its title; numbers are written out, without plotly's SI prefixes such as 10k."""
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


def whole_figure(data: list[Figure], **layout: Any) -> Figure:
    """Traces and entries of the layout as one figure, with what all pictures share, without plotly's tool bar."""
    shared = {"font": FONT, "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)", "autosize": True}
    config = {"displaylogo": False, "displayModeBar": False, "scrollZoom": True, "responsive": True}
    return {"data": data, "layout": shared | layout, "config": config}
