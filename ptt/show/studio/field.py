"""The error field in space over the machine, as a plotly dictionary."""

from collections.abc import Sequence
from html import escape

import numpy as np

from ptt.show.studio.figures import GRID, MOST, ORANGE, UM, Figure, shown_rows, whole_figure, whole_layout
from ptt.show.studio.looks import Look

SCALE = "Viridis"
HEAD = 0.25  # share of an arrow that its head takes
REACH = 0.35  # of the path's size that the 95 % arrow takes


def usual_scale(look: Look) -> float:
    """Round factor that makes the arrows of this run well seen."""
    if not look.kept.any():
        return 1.0
    span = max(float(np.ptp(look.target[look.kept], axis=0).max()), 1e-3)
    wanted = REACH * span / max(float(np.quantile(look.size_um[look.kept], 0.95)) / UM, 1e-9)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 3.0, 5.0) if step * power <= wanted * (1.0 + 1e-9)))


def field_figure(look: Look, picked: Sequence[int] = (), *, scale: float, machine: bool = True) -> Figure:
    """The error field in space, over the machine at the picked pose.

    Args:
        look: the run.
        picked: row numbers to highlight; the first one poses the machine.
        scale: how many times arrows are enlarged.
        machine: whether rails, links and platform are drawn.

    Returns:
        The figure.
    """
    rows = shown_rows(look, picked)
    size = look.size_um[rows]
    top = float(np.quantile(size, 0.98)) if len(size) else 1.0
    data = _machine(look, int(picked[0]) if len(picked) else _middle(look)) if machine else []
    data.append(_arrows(look.target[rows], look.residual[rows] * scale, size, top))
    data.append(_dots(look, rows, size, top))
    if len(picked):
        chosen = np.asarray(list(picked)[:MOST], dtype=int)
        data.append(
            {
                "type": "scatter3d", "mode": "markers", "name": "picked", "customdata": chosen.tolist(),
                **_xyz(look.target[chosen]), "hoverinfo": "skip", "showlegend": False,
                "marker": {"size": 9, "symbol": "circle-open", "color": ORANGE, "line": {"width": 3, "color": ORANGE}},
            }
        )  # fmt: skip
    axes = {
        f"{axis}axis": {
            "title": {"text": f"{axis} [mm]"}, "backgroundcolor": "#fff", "gridcolor": GRID, "color": "#444"
        }
        for axis in "xyz"
    }  # fmt: skip
    camera = {"eye": {"x": 1.6, "y": 1.45, "z": 0.9}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}}
    layout = whole_layout(
        margin={"l": 0, "r": 0, "t": 0, "b": 0}, showlegend=False, uirevision=f"{look.source}{machine}",
        scene={**axes, "aspectmode": "data", "camera": camera, "uirevision": f"{look.source}{machine}"},
    )  # fmt: skip
    return whole_figure(data, layout)


def _machine(look: Look, row: int) -> list[Figure]:
    drawing = look.drawing
    lines = [_line(_joined(drawing.rails), "#9aa0a6", 7, "rails")] if len(drawing.rails) else []
    lines.append(_line(_joined(drawing.chains[row]), "#5f6368", 5, "links"))
    corners = drawing.platform[row]
    if len(corners):
        lines.append(_line(np.concatenate([corners, corners[:1]]), "#202124", 6, "platform"))
        lines.append(
            {
                "type": "mesh3d", **_xyz(corners), "i": [0], "j": [1], "k": [2], "color": "#5f6368", "opacity": 0.25,
                "hoverinfo": "skip", "name": "platform",
            }
        )  # fmt: skip
    return lines


def _middle(look: Look) -> int:
    """The reading nearest to the middle of the path: where the machine stands until a pose is picked."""
    rows = np.flatnonzero(look.kept)
    if not len(rows):
        return 0
    place = look.target[rows]
    return int(rows[np.argmin(np.linalg.norm(place - place.mean(axis=0), axis=1))])


def _arrows(place: np.ndarray, arrow: np.ndarray, size: np.ndarray, top: float) -> Figure:
    """Shaft and head of each arrow as one broken line, coloured by size."""
    tip = place + arrow
    side = np.cross(arrow, np.where(np.abs(arrow[:, 2:]) < 0.9 * _length(arrow), [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    side *= 0.4 * HEAD * _length(arrow) / np.maximum(_length(side), 1e-12)
    back = tip - HEAD * arrow
    gap = np.full_like(tip, np.nan)
    lines = np.stack([place, tip, back + side, gap, tip, back - side, gap], axis=1)
    colour = np.repeat(np.minimum(size, top), lines.shape[1])
    return {
        "type": "scatter3d", "mode": "lines", "name": "errors", "hoverinfo": "skip", **_xyz(lines.reshape(-1, 3)),
        "line": {"width": 4, "color": colour.tolist(), "colorscale": SCALE, "cmin": 0.0, "cmax": top},
    }  # fmt: skip


def _dots(look: Look, rows: np.ndarray, size: np.ndarray, top: float) -> Figure:
    """A dot at each target: what a click picks."""
    words = [
        f"line {look.line[row]} {escape(look.name[row])}<br>"
        f"{', '.join(f'{value:.1f}' for value in look.target[row])} mm<br>{each:.1f} \N{MICRO SIGN}m"
        for row, each in zip(rows, size, strict=True)
    ]
    bar = {
        "title": {"text": "size of the error [\N{MICRO SIGN}m]", "side": "right"},
        "thickness": 14,
        "len": 0.75,
        "x": 0.98,
        "xanchor": "right",
        "tickfont": {"size": 11},
    }
    return {
        "type": "scatter3d", "mode": "markers", "name": "readings", **_xyz(look.target[rows]),
        "customdata": rows.tolist(), "text": words, "hoverinfo": "text",
        "marker": {"size": 2.5, "color": np.minimum(size, top).tolist(), "colorscale": SCALE, "cmin": 0.0, "cmax": top,
                   "colorbar": bar},
    }  # fmt: skip


def _line(points: np.ndarray, colour: str, width: float, name: str) -> Figure:
    return {
        "type": "scatter3d", "mode": "lines", "name": name, "hoverinfo": "skip", **_xyz(points),
        "line": {"color": colour, "width": width}, "connectgaps": False,
    }  # fmt: skip


def _joined(lines: np.ndarray) -> np.ndarray:
    """(c, m, 3) lines as one broken line."""
    return np.concatenate([np.concatenate([line, np.full((1, 3), np.nan)]) for line in lines])


def _xyz(points: np.ndarray) -> dict[str, list[float | None]]:
    columns = np.where(np.isfinite(points), np.round(points, 4), np.nan).T
    return {axis: [None if v != v else v for v in column.tolist()] for axis, column in zip("xyz", columns, strict=True)}


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1, keepdims=True)
