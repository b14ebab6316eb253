"""Interactive pictures of a report; plotly itself is embedded once, so that nothing is fetched from a network."""

import importlib
from typing import Any

import numpy as np

from ptt.dependence.contexts import context_views
from ptt.errors import InputError
from ptt.judge.compare.comparison import Comparison
from ptt.run.problem import Problem
from ptt.show.plots.common import thinned
from ptt.show.plots.depends import variable_label
from ptt.show.plots.field import enlargement, field_of
from ptt.show.report.contents import Contents

HIGH = 560  # px, height of a picture
MARGIN = {"l": 70, "r": 20, "t": 70, "b": 60}  # px
COLOURS = ("#440154", "#21918c", "#e69f00")  # x, y, z: distinguishable in all kinds of colour vision


def interactive_parts(contents: Contents) -> dict[str, str]:
    """The interactive pictures as HTML, and plotly itself.

    Args:
        contents: contents of the report.

    Returns:
        'library' -> JavaScript of plotly; 'field' and 'against' -> HTML of a picture.

    Raises:
        InputError: plotly is not installed.
    """
    graph, io, offline = (_load(name) for name in ("plotly.graph_objects", "plotly.io", "plotly.offline"))
    look, problem = contents.drawing.comparison, contents.problem
    figures = {"field": _field(graph, look, problem), "against": _against(graph, look, problem)}
    options: dict[str, Any] = {"full_html": False, "include_plotlyjs": False, "config": {"displaylogo": False}}
    parts = {name: io.to_html(figure, div_id=f"moving-{name}", **options) for name, figure in figures.items()}
    return {"library": offline.get_plotlyjs(), **parts}


def _load(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        fix = "install it with: pip install 'ptt[studio]', or leave --interactive out"
        raise InputError("plotly is not installed", where="--interactive", fix=fix) from None


def _field(graph: Any, result: Comparison, problem: Problem) -> Any:
    """Errors as lines in space, coloured by size, with a dot at each target."""
    place, error, _ = field_of(result, problem)
    size = 1e3 * np.linalg.norm(error, axis=1)
    factor, _ = enlargement(place, error)
    tips = place + factor * error
    gap = np.full_like(place, np.nan)
    line = np.stack([place, tips, gap], axis=1).reshape(-1, 3)
    scale = {"colorscale": "Viridis", "cmin": 0.0, "cmax": float(size.max())}
    shafts = graph.Scatter3d(
        x=line[:, 0], y=line[:, 1], z=line[:, 2], mode="lines", hoverinfo="skip", showlegend=False,
        line={"color": np.repeat(size, 3), "width": 4, **scale},
    )  # fmt: skip
    dots = graph.Scatter3d(
        x=place[:, 0], y=place[:, 1], z=place[:, 2], mode="markers", showlegend=False,
        customdata=np.column_stack([1e3 * error, size]),
        hovertemplate="target %{x:.1f}, %{y:.1f}, %{z:.1f} mm<br>error %{customdata[0]:.1f}, %{customdata[1]:.1f}, "
        "%{customdata[2]:.1f} um<br>size %{customdata[3]:.1f} um<extra></extra>",
        marker={"size": 3, "color": size, "colorbar": {"title": "size of the error [um]"}, **scale},
    )  # fmt: skip
    figure = graph.Figure([shafts, dots])
    axes = {f"{axis}axis": {"title": f"{axis} [mm]"} for axis in "xyz"}
    title = f"error after frame alignment, arrows {factor:g} times enlarged"
    return figure.update_layout(
        scene={"aspectmode": "data", **axes}, title=title, height=HIGH, margin=MARGIN, template="plotly_white"
    )


def _against(graph: Any, result: Comparison, problem: Problem) -> Any:
    """Errors in x, y, z against a variable that is chosen from a menu."""
    rows = thinned(result.kept)
    variables = {name: values[rows] for name, values in context_views(problem).items()}
    first = next((item.on for item in result.depends_on if item.on in variables), next(iter(variables)))
    order = [first, *(name for name in variables if name != first)]
    traces = [
        graph.Scatter(
            x=variables[first], y=1e3 * result.residual[rows, axis], mode="markers", name=name,
            marker={"size": 5, "color": colour, "symbol": symbol},
        )
        for axis, (name, colour, symbol) in enumerate(zip("xyz", COLOURS, ("circle", "diamond", "cross"), strict=True))
    ]  # fmt: skip
    buttons = [
        {
            "label": name,
            "method": "update",
            "args": [{"x": [variables[name]] * 3}, {"xaxis.title.text": variable_label(name, problem)}],
        }
        for name in order
    ]
    menu = {"buttons": buttons, "x": 1.0, "xanchor": "right", "y": 1.18, "yanchor": "top"}
    return graph.Figure(traces).update_layout(
        xaxis={"title": variable_label(first, problem)}, yaxis={"title": "error after frame alignment [um]"},
        title="errors in x, y and z against any variable", updatemenus=[menu], height=HIGH, margin=MARGIN,
        template="plotly_white",
    )  # fmt: skip
