"""Picture of the machine in space as a plotly dictionary: solids, mean errors as arrows, displaced parts as a ghost."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ptt.show.card.scene import GHOST, PART_COLOURS, PoseLines, legs_at_fault, moved, only, parts_of, place_of_part
from ptt.show.card.words import by_part
from ptt.show.studio.arrow_figure import arrow_traces, mean_arrows, mesh, xyz
from ptt.show.studio.figures import MIDDLE, MOST_READINGS, ORANGE, Figure, shown_rows, whole_figure
from ptt.show.studio.looks import Look

GRID = "#a9b1b7"  # visible on light and on dark; plotly draws transparent colours in space on white
LETTERS = "#8a3500"  # colour of labels
# px: distance of a label above or below its part, height of a line of it, and its sideways distance from an arm's part
LIFT, LINE, ASIDE = 38, 15, 64
SAID = 2  # values of one part on a label; further ones are counted
RIM = 0.04  # margin around what is drawn, as a share of its size
ROOM = 1.85  # diagonal of the scene in plotly's units, in which a cube of unit sides has 1.73: fills the picture
EYE = {"x": 1.27, "y": 1.18, "z": 0.62}  # position of the camera at first


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
    """The machine at one pose, with errors and a ghost.

    Args:
        look: the run.
        row: row of the pose.
        picked: rows of readings to highlight.
        scale: factor of enlargement of arrows; 0 for no arrows.
        machine: whether the machine is drawn.
        ghost: 'shift' by an effect (`ptt.show.card.ghost`), 'at' the index of the pose in it, 'times' its enlargement,
            'values' to be written beside its parts; None for no ghost.
        near: whether the readings fill the picture instead of the machine.

    Returns:
        The figure.
    """
    lines = look.drawing.at(row)
    there = None if ghost is None or not machine else moved(lines, ghost["shift"], int(ghost["at"]), ghost["times"])
    box = _box(look, scale) if near or not machine else _whole_box(look, scale, there)
    data: list[Figure] = []
    if machine:
        seen = {"platform": 0.3} if near else {}  # readings lie about the platform
        data += [mesh(solid, name, PART_COLOURS[name], seen.get(name, 1.0)) for name, solid in parts_of(lines).items()]
    if ghost is not None and there is not None:
        ghosts = only(there, *legs_at_fault(ghost["shift"])).values()
        data += [mesh(solid, "ghost", GHOST, 0.5) | {"uid": f"ghost-{index}"} for index, solid in enumerate(ghosts)]
    if scale:
        data += arrow_traces(look, scale, float(np.linalg.norm(box[1] - box[0])) if near else lines.size)
    if picked:
        data.append(_picked(look, picked))
    held = f"{look.source}{near}"
    labels = [] if ghost is None or there is None else _labels(there, ghost.get("values", ()))
    scene = _scene(box) | {
        "uirevision": held, "annotations": labels, "domain": {"y": [0.13 if scale else 0.0, 1.0]},
    }  # fmt: skip
    return _in_space(data, scene, held)


def _in_space(data: list[Figure], scene: Figure, held: str) -> Figure:
    margin = {"l": 0, "r": 0, "t": 0, "b": 0}
    return whole_figure(data, margin=margin, showlegend=False, uirevision=held, scene=scene)


def _scene(box: np.ndarray) -> Figure:
    """A scene in which a box of any proportions is seen whole from every side."""
    span = np.maximum(box[1] - box[0], 1e-6 * np.linalg.norm(box[1] - box[0]) + 1e-9)
    ratio = ROOM * span / np.linalg.norm(span)
    return {
        **{f"{axis}axis": _axis(axis, box[:, index]) for index, axis in enumerate("xyz")},
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", ratio.tolist(), strict=True)),
        "camera": {"eye": EYE, "center": {"x": 0.0, "y": 0.0, "z": 0.0}},
        "dragmode": "orbit",
        "bgcolor": "rgba(0,0,0,0)",
    }


def _labels(there: PoseLines, values: Sequence[Mapping[str, Any]]) -> list[Figure]:
    """Labels with values beside the parts that have them.

    So that they do not overlap, labels of legs, which stand side by side, are put alternately above and below from left
    to right, beginning so that those of higher parts are above; labels of an arm, whose joints may lie behind each
    other, are put alternately to its right and left, in the order of the joints' heights.
    """
    parts = [(who, _few(said), place_of_part(there, who)) for who, said in by_part(values)]
    arm, labels = not len(there.rails), []
    parts.sort(key=lambda part: -float(part[2][2]) if arm else EYE["x"] * part[2][1] - EYE["y"] * part[2][0])
    seen = [_height(place) for _, _, place in parts]
    first_below = len(parts) > 1 and np.mean(seen[::2]) < np.mean(seen[1::2])
    for number, (who, said, place) in enumerate(parts):
        tall = LIFT + LINE * len("\n".join(said).splitlines())
        aside = (ASIDE, -ASIDE)[number % 2], tall * (number - 0.5 * (len(parts) - 1))
        across, down = aside if arm else (0, LIFT if (number + first_below) % 2 else -LIFT)
        label = _label(place, [f"<b>{escape(who)}</b>", *map(escape, said)], across, down)
        if len(parts) > 1 and not arm and number in (0, len(parts) - 1):  # labels at the edges extend inwards
            label |= {"xanchor": "right" if number else "left", "ax": 24 if number else -24}
        labels.append(label)
    return labels


def _height(place: np.ndarray) -> float:
    """Height of a place in the picture as first seen, up to a factor and a constant."""
    x, y, z = EYE["x"], EYE["y"], EYE["z"]
    return float((x * x + y * y) * place[2] - z * (x * place[0] + y * place[1]))


def _few(said: Sequence[str]) -> list[str]:
    return [*said[:SAID], f"and {len(said) - SAID} more"] if len(said) > SAID + 1 else list(said)


def _label(place: np.ndarray, said: Sequence[str], across: float, down: float) -> Figure:
    return {
        **dict(zip("xyz", place.tolist(), strict=True)), "text": "<br>".join(said).replace("\n", "<br>"),
        "font": {"size": 12, "color": LETTERS}, "bgcolor": "rgba(255,255,255,0.88)", "bordercolor": GHOST,
        "borderpad": 3, "arrowcolor": GHOST, "arrowhead": 0, "ax": across, "ay": down,
    }  # fmt: skip


def _picked(look: Look, picked: Sequence[int]) -> Figure:
    chosen = np.asarray(list(picked)[:MOST_READINGS], dtype=int)
    return {
        "type": "scatter3d", "mode": "markers", "name": "picked", "uid": "picked", "customdata": chosen.tolist(),
        **xyz(look.target[chosen]), "hoverinfo": "skip", "showlegend": False,
        "marker": {"size": 9, "symbol": "circle-open", "color": ORANGE, "line": {"width": 3, "color": ORANGE}},
    }  # fmt: skip


def _box(look: Look, scale: float) -> np.ndarray:
    """Bounding box of the readings and their arrows, (2, 3) mm."""
    points = [look.target[shown_rows(look)], *_tips(look, scale)]
    return _around(np.concatenate(points), 2.0 * RIM)


def _whole_box(look: Look, scale: float, there: PoseLines | None) -> np.ndarray:
    """Bounding box of the machine at all poses, arrows and ghost too, (2, 3) mm, so that the scene does not move."""
    drawing, rows = look.drawing, shown_rows(look)
    parts = [drawing.rails, drawing.chains[rows], drawing.platform[rows]]
    parts += [] if there is None else [there.rails, there.chains, there.platform]
    points = [part.reshape(-1, 3) for part in (*parts, *_tips(look, scale))]
    return _around(np.concatenate(points), RIM)


def _tips(look: Look, scale: float) -> list[np.ndarray]:
    if not scale:
        return []
    means = mean_arrows(look)
    return [means.place + scale * means.error]


def _around(points: np.ndarray, rim: float) -> np.ndarray:
    """Bounding box of points with a margin as a share of its size, (2, 3) mm."""
    points = points[np.isfinite(points).all(axis=1)]
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.ones(3))
    beyond = rim * max(float((high - low).max()), 1e-3)
    return np.stack([low - beyond, high + beyond])


def _axis(name: str, ends: np.ndarray) -> Figure:
    return {
        "title": {"text": ""},  # it would lie outside the picture; tick labels name the axis
        "tickprefix": f"{name} ",
        "backgroundcolor": "rgba(0,0,0,0)",
        "gridcolor": GRID,
        "color": MIDDLE,
        "tickfont": {"size": 12},
        "nticks": 5,
        "showspikes": False,
        "zerolinecolor": GRID,
        "range": ends.tolist(),
    }


def empty_space() -> Figure:
    """A scene in which nothing is visible, shown early: without a graphics card a browser takes long to start one."""
    corner: Figure = {"x": [0.0, 1.0, 0.0], "y": [0.0, 0.0, 1.0], "z": [0.0, 0.0, 0.0], "hoverinfo": "skip"}
    unseen: list[Figure] = [
        {"type": "mesh3d", **corner, "i": [0], "j": [1], "k": [2], "opacity": 0.0, "showscale": False},
        {"type": "scatter3d", "mode": "markers", **corner, "marker": {"opacity": 0.0}},
    ]
    scene = {f"{axis}axis": {"visible": False} for axis in "xyz"} | {"bgcolor": "rgba(0,0,0,0)", "dragmode": False}
    return _in_space(unseen, scene, "")


def chain_figure(chain: Sequence[Sequence[float]]) -> Figure:
    """An arm as solids.

    Args:
        chain: base, joints and tool, (m, 3) mm.

    Returns:
        The figure.
    """
    lines = PoseLines(np.zeros((0, 2, 3)), np.asarray(chain, dtype=float)[None], np.zeros((0, 3)))
    solids = parts_of(lines)
    data = [mesh(solid, name, PART_COLOURS[name]) for name, solid in solids.items()]
    box = _around(np.concatenate([solid.points for solid in solids.values()]), RIM)
    return _in_space(data, _scene(box), "arm")
