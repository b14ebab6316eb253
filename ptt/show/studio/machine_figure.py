"""The machine picture: solid parts, mean errors as arrows, and what is off as a ghost, as a plotly dictionary."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ptt.show.card.scene import Lines, legs_at_fault, moved, only, parts_of, place_of_part
from ptt.show.card.solids import Solid, arrows
from ptt.show.card.words import by_part, length, prefixed
from ptt.show.studio.figures import MIDDLE, MOST, ORANGE, UM, Figure, shown_rows, whole_figure, whole_layout
from ptt.show.studio.looks import Look

SCALE = "Cividis"  # made for every kind of colour vision
COLOURS = {"rails": "#aab2b8", "sliders": "#4c5a66", "links": "#7d8b96", "platform": "#5b7f9b"}
GHOST, LETTERS = "#e69f00", "#8a3500"
LIFT, LINE = 38, 15  # px that a label stands off its part, and that a line of it takes
SHOWN_ARROWS = 240  # more hide each other
REACH = 0.45  # of the path's size that the 95 % arrow takes
OF_MACHINE = 0.16  # of the machine's size that it takes at most: an arm's path is as large as the arm
LIGHT = {"ambient": 0.62, "diffuse": 0.7, "specular": 0.15, "roughness": 0.8}


def usual_scale(look: Look) -> float:
    """Round factor that makes the arrows of this run well seen."""
    if not look.kept.any():
        return 1.0
    span = max(float(np.ptp(look.target[look.kept], axis=0).max()), 1e-3)
    drawing, row = look.drawing, int(np.flatnonzero(look.kept)[0])
    size = Lines(drawing.rails, drawing.chains[row], drawing.platform[row]).size
    wanted = min(REACH * span, OF_MACHINE * size) / max(float(np.quantile(look.size_um[look.kept], 0.95)) / UM, 1e-9)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 3.0, 5.0) if step * power <= wanted * (1.0 + 1e-9)))


def mean_arrows(look: Look) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mean error of each pose; of each small cell where there are too many poses.

    Args:
        look: the run.

    Returns:
        (m, 3) mm places, (m, 3) mm mean errors, (m,) readings of each.
    """
    rows = np.flatnonzero(look.kept)
    if not len(rows):
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=int)
    place, cell = look.target[rows], 1e-3
    span = max(float(np.ptp(place, axis=0).max()), 1e-3)
    while True:
        _, owner = np.unique(np.round(place / cell), axis=0, return_inverse=True)
        owner = owner.reshape(-1)
        if owner.max() < SHOWN_ARROWS or cell > span:
            break
        cell = span / 30.0 if cell < span / 40.0 else cell * 1.25
    count = np.bincount(owner)
    means = [
        np.stack([np.bincount(owner, values[:, axis]) / count for axis in range(3)], axis=1)
        for values in (place, look.residual[rows])
    ]
    return means[0], means[1], count


def machine_figure(
    look: Look,
    row: int,
    *,
    picked: Sequence[int] = (),
    scale: float = 0.0,
    machine: bool = True,
    ghost: Mapping[str, Any] | None = None,
    near: bool = False,
) -> Figure:
    """The machine at one pose with what is to be seen on it.

    Args:
        look: the run.
        row: the pose.
        picked: readings to highlight.
        scale: how many times arrows are enlarged; 0 for none.
        machine: whether the machine is drawn.
        ghost: 'shift' of an effect, 'at' its pose, 'times' enlarged, 'values' to be written beside its parts.
        near: whether the readings fill the picture, not the machine.

    Returns:
        The figure.
    """
    drawing = look.drawing
    lines = Lines(drawing.rails, drawing.chains[row], drawing.platform[row])
    data: list[Figure] = []
    if machine:
        seen = {"platform": 0.3} if near else {}  # readings lie about the platform
        data += [_solid(solid, COLOURS[name], name, seen.get(name, 1.0)) for name, solid in parts_of(lines).items()]
    if machine and ghost:
        data += _ghost(lines, ghost)
    if scale:
        data += _arrows(look, scale, lines.size)
    if picked:
        data += _picked(look, picked)
    box = _box(look, lines, scale) if near or not machine else None
    axes = {f"{axis}axis": _axis(axis, None if box is None else box[:, index]) for index, axis in enumerate("xyz")}
    camera = {"eye": {"x": 1.27, "y": 1.18, "z": 0.62}, "center": {"x": 0.0, "y": 0.0, "z": 0.0}}
    held = f"{look.source}{near}"
    labels = _labels(lines, ghost) if machine and ghost else []
    layout = whole_layout(
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        showlegend=False,
        uirevision=held,
        scene={
            **axes,
            "aspectmode": "data",
            "camera": camera,
            "uirevision": held,
            "dragmode": "orbit",
            "annotations": labels,
            "domain": {"y": [0.13 if scale else 0.0, 1.0]},
            "bgcolor": "rgba(0,0,0,0)",
        },
    )
    return whole_figure(data, layout)


def _ghost(lines: Lines, ghost: Mapping[str, Any]) -> list[Figure]:
    """The parts that are off where the fault would put them, enlarged, with their sizes in words."""
    shift = ghost["shift"]
    kind, legs = legs_at_fault(shift)
    there = moved(lines, shift, int(ghost["at"]), float(ghost["times"]))
    return [_solid(solid, GHOST, "ghost", 0.5) for solid in only(there, kind, legs).values()]


def _labels(lines: Lines, ghost: Mapping[str, Any]) -> list[Figure]:
    """Sizes in words beside the parts that have them, over everything else."""
    there = moved(lines, ghost["shift"], int(ghost["at"]), float(ghost["times"]))
    labels = []
    for number, (who, said) in enumerate(by_part(ghost.get("values", ()))):
        place = place_of_part(there, who).tolist()
        beyond = LIFT + (LIFT + LINE * len(said)) * (number // 2)  # above and below by turns: labels don't hide another
        labels.append(
            {
                **dict(zip("xyz", place, strict=True)),
                "text": "<br>".join([f"<b>{escape(who)}</b>", *map(escape, said)]),
                "font": {"size": 12, "color": LETTERS},
                "bgcolor": "rgba(255,255,255,0.88)",
                "bordercolor": GHOST,
                "borderpad": 3,
                "arrowcolor": GHOST,
                "arrowhead": 0,
                "ax": 0,
                "ay": beyond if number % 2 else -beyond,
            }
        )
    return labels


def _arrows(look: Look, scale: float, size: float) -> list[Figure]:
    place, error, count = mean_arrows(look)
    if not len(place):
        return []
    sizes = UM * np.linalg.norm(error, axis=1)
    factor, unit = prefixed(sizes.tolist(), "um")
    shown = factor * sizes
    top = float(np.quantile(shown, 0.98)) or 1.0
    solid, owner = arrows(place, error * scale, 0.045 * size)
    words = [
        f"{', '.join(f'{value:.1f}' for value in spot)} mm<br>{length(each)}, "
        f"{f'mean of {many} readings' if many > 1 else 'one reading'}"
        for spot, each, many in zip(place, sizes, count, strict=True)
    ]
    bar = {
        "title": {"text": f"mean error [{unit}]", "side": "top", "font": {"size": 12}},
        "orientation": "h",
        "thickness": 11,
        "len": 0.62,
        "x": 0.5,
        "xanchor": "center",
        "y": 0.0,
        "yanchor": "bottom",
        "tickfont": {"size": 11},
    }
    arrow = {
        **_solid(solid, "", "errors"),
        "intensity": np.minimum(shown, top)[owner].tolist(),
        "colorscale": SCALE,
        "cmin": 0.0,
        "cmax": top,
        "colorbar": bar,
        "showscale": True,
        "flatshading": False,
    }
    arrow.pop("color")
    dots = {
        "type": "scatter3d",
        "mode": "markers",
        "name": "readings",
        **_xyz(place),
        "text": words,
        "hoverinfo": "text",
        "customdata": _nearest(look, place),
        "marker": {"size": 6, "opacity": 0.02, "color": MIDDLE},
    }
    return [arrow, dots]


def _nearest(look: Look, place: np.ndarray) -> list[int]:
    """A reading for each place: what a click picks."""
    rows = np.flatnonzero(look.kept)
    own = look.target[rows]
    return [int(rows[np.argmin(((own - spot) ** 2).sum(axis=1))]) for spot in place]


def _picked(look: Look, picked: Sequence[int]) -> list[Figure]:
    chosen = np.asarray(list(picked)[:MOST], dtype=int)
    return [
        {
            "type": "scatter3d",
            "mode": "markers",
            "name": "picked",
            "customdata": chosen.tolist(),
            **_xyz(look.target[chosen]),
            "hoverinfo": "skip",
            "showlegend": False,
            "marker": {"size": 9, "symbol": "circle-open", "color": ORANGE, "line": {"width": 3, "color": ORANGE}},
        }
    ]


def _box(look: Look, lines: Lines, scale: float) -> np.ndarray:
    """(2, 3) mm, what the readings and their arrows take."""
    rows = shown_rows(look)
    points = look.target[rows]
    if scale:
        place, error, _ = mean_arrows(look)
        points = np.concatenate([points, place + scale * error])
    low, high = points.min(axis=0), points.max(axis=0)
    rim = 0.08 * max(float((high - low).max()), 1e-3)
    return np.stack([low - rim, high + rim])


def _axis(name: str, ends: np.ndarray | None) -> Figure:
    return {
        "title": {"text": f"{name} [mm]", "font": {"size": 12}},
        "backgroundcolor": "rgba(0,0,0,0)",
        "gridcolor": "rgba(128,136,144,0.25)",
        "color": MIDDLE,
        "tickfont": {"size": 10},
        "nticks": 5,
        "showspikes": False,
        "zerolinecolor": "rgba(128,136,144,0.4)",
        **({} if ends is None else {"range": ends.tolist()}),
    }


def _solid(solid: Solid, colour: str, name: str, opacity: float = 1.0) -> Figure:
    faces = solid.faces.T
    return {
        "type": "mesh3d",
        **_xyz(solid.points),
        **{key: row.tolist() for key, row in zip("ijk", faces, strict=True)},
        "color": colour,
        "opacity": opacity,
        "flatshading": True,
        "lighting": LIGHT,
        "hoverinfo": "skip",
        "name": name,
        "showscale": False,
    }


def _xyz(points: np.ndarray) -> dict[str, list[float]]:
    return {axis: column for axis, column in zip("xyz", np.round(points, 3).T.tolist(), strict=True)}


def chain_figure(chain: Sequence[Sequence[float]]) -> Figure:
    """An arm as solids.

    Args:
        chain: (m, 3) mm, base, joints and tool.

    Returns:
        The figure.
    """
    lines = Lines(np.zeros((0, 2, 3)), np.asarray(chain, dtype=float)[None], np.zeros((0, 3)))
    data = [_solid(solid, COLOURS[name], name) for name, solid in parts_of(lines).items()]
    scene = {f"{axis}axis": _axis(axis, None) for axis in "xyz"} | {"aspectmode": "data", "bgcolor": "rgba(0,0,0,0)"}
    return whole_figure(
        data, whole_layout(margin={"l": 0, "r": 0, "t": 0, "b": 0}, showlegend=False, uirevision="arm", scene=scene)
    )
