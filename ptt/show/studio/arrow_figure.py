"""Errors of a run as arrows in space: the mean error of each pose, enlarged, coloured by size."""

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ptt.run.means import group_means
from ptt.show.card.solids import Solid, arrows
from ptt.show.card.words import length, prefixed
from ptt.show.sizing import round_down
from ptt.show.studio.figures import MIDDLE, UM, Figure
from ptt.show.studio.looks import Look

SCALE = "Cividis"  # colour scale for all kinds of colour vision
SHOWN_ARROWS = 240  # most arrows in a picture; more hide each other
MOST_CELLS = 1e6  # cells of the bounding box up to which occupied ones are found by counting instead of sorting
REACH = 0.45  # of the path's size: drawn length of the arrow at the 95 % quantile of sizes
OF_MACHINE = 0.16  # the same as a share of the machine's size, if that is less: an arm's path is as large as the arm
APART = 0.4  # of the distance between neighbouring arrows: largest half width of a head
THIN = 0.004  # of the picture's extent: that largest half width is at least this
THICK = 0.045  # of the picture's extent: arrows shorter than this are as thick as one of this length
BAR = {
    "orientation": "h", "thickness": 11, "len": 0.62, "x": 0.5, "xanchor": "center", "y": 0.0, "yanchor": "bottom",
    "tickfont": {"size": 11},
}  # fmt: skip
LIGHT = {"ambient": 0.62, "diffuse": 0.7, "specular": 0.15, "roughness": 0.8}


def usual_scale(look: Look) -> float:
    """Round factor of enlargement at which the arrows of a run are well seen."""
    if not look.kept.any():
        return 1.0
    span = max(float(np.ptp(look.target[look.kept], axis=0).max()), 1e-3)
    size = look.drawing.at(int(np.flatnonzero(look.kept)[0])).size
    wanted = min(REACH * span, OF_MACHINE * size) / max(float(np.quantile(look.size_um[look.kept], 0.95)) / UM, 1e-9)
    return round_down(wanted, (1.0, 2.0, 3.0, 5.0))


@dataclass(frozen=True)
class Means:
    """Mean errors of a run at m poses or cells.

    Attributes:
        place: mean target, (m, 3) mm.
        error: mean error, (m, 3) mm.
        count: number of readings, (m,).
        row: row of the reading nearest to each place, (m,).
    """

    place: np.ndarray
    error: np.ndarray
    count: np.ndarray
    row: np.ndarray


_KNOWN: WeakKeyDictionary[Look, Means] = WeakKeyDictionary()  # cache: each picture asks several times


def mean_arrows(look: Look) -> Means:
    """The mean error of each pose; of each small cell where there are too many poses.

    Args:
        look: the run.

    Returns:
        The means.
    """
    if look not in _KNOWN:
        _KNOWN[look] = _means(look)
    return _KNOWN[look]


def _means(look: Look) -> Means:
    rows = np.flatnonzero(look.kept)
    if not len(rows):
        return Means(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=int), rows)
    place, error = look.target[rows], look.residual[rows]
    owner = _owners(place)
    count = np.bincount(owner)
    middle, mean = (group_means(values, owner)[1] for values in (place, error))
    order = np.lexsort((((place - middle[owner]) ** 2).sum(axis=1), owner))
    return Means(middle, mean, count, rows[order[np.searchsorted(owner[order], np.arange(len(count)))]])


def _owners(place: np.ndarray) -> np.ndarray:
    """Number of the pose of each reading, or of its cell where there are too many poses, (n,)."""
    span = max(float(np.ptp(place, axis=0).max()), 1e-3)
    cell = 1e-3
    while True:
        owner = _cells(place, cell)
        if owner.max() < SHOWN_ARROWS or cell > span:
            return owner
        cell = span / 30.0 if cell < span / 40.0 else cell * 1.25


def _cells(place: np.ndarray, cell: float) -> np.ndarray:
    """Number of the cell of each place, counting occupied cells alone, (n,)."""
    index = np.round(place / cell)
    index -= index.min(axis=0)
    many = index.max(axis=0) + 1.0
    if many.prod() < MOST_CELLS:
        flat = ((index[:, 0] * many[1] + index[:, 1]) * many[2] + index[:, 2]).astype(np.int64)
        return (np.cumsum(np.bincount(flat) > 0) - 1)[flat]
    owner = np.zeros(len(place), dtype=np.int64)
    for own in (np.unique(column, return_inverse=True)[1] for column in index.T):  # faster than sorting rows
        owner = np.unique(owner * (own.max() + 1) + own, return_inverse=True)[1]
    return owner


def arrow_traces(look: Look, scale: float, size: float) -> list[Figure]:
    """The arrows, and an almost invisible point at the foot of each for the pointer.

    Args:
        look: the run.
        scale: factor of enlargement.
        size: extent of the picture, mm.

    Returns:
        Traces of plotly; none where nothing was observed.
    """
    means = mean_arrows(look)
    place, error = means.place, means.error
    if not len(place):
        return []
    sizes = UM * np.linalg.norm(error, axis=1)
    factor, unit = prefixed(sizes.tolist(), "um")
    shown = factor * sizes
    top = float(np.quantile(shown, 0.98)) or 1.0
    solid, owner = arrows(place, error * scale, THICK * size, max(APART * _spacing(place), THIN * size))
    colours = {
        "intensity": np.minimum(shown, top)[owner].tolist(), "colorscale": SCALE, "cmin": 0.0, "cmax": top,
        "colorbar": BAR | {"title": {"text": f"mean error [{unit}]", "side": "top", "font": {"size": 12}}},
    }  # fmt: skip
    return [
        mesh(solid, "errors") | colours | {"showscale": True, "flatshading": False},
        _feet(means, sizes),
    ]


def _spacing(place: np.ndarray) -> float:
    """Median distance of a place to its nearest neighbour, mm."""
    if len(place) < 2:
        return math.inf
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    np.fill_diagonal(apart, math.inf)
    return float(np.median(apart.min(axis=1)))


def mesh(solid: Solid, name: str, colour: str = "", opacity: float = 1.0) -> Figure:
    """A mesh as a trace of plotly.

    Args:
        solid: the mesh.
        name: of the trace.
        colour: of the whole mesh; '' where intensities colour it.
        opacity: 0 to 1.

    Returns:
        A trace.
    """
    faces = solid.faces.T
    return {
        "type": "mesh3d", "uid": name, **xyz(solid.points),  # so that plotly never reuses the trace of another part
        **{key: row.tolist() for key, row in zip("ijk", faces, strict=True)},
        **({"color": colour} if colour else {}), "opacity": opacity, "flatshading": True, "lighting": LIGHT,
        "hoverinfo": "skip", "name": name, "showscale": False,
    }  # fmt: skip


def xyz(points: np.ndarray) -> dict[str, list[float]]:
    """Coordinates of points (n, 3) as lists for a trace, rounded to the micrometre."""
    return {axis: column for axis, column in zip("xyz", np.round(points, 3).T.tolist(), strict=True)}


def _feet(means: Means, sizes: np.ndarray) -> Figure:
    """Points at the feet of arrows that tell the pointer position, size and number of readings."""
    words = [
        f"{', '.join(f'{value:.1f}' for value in spot)} mm<br>{length(each)}, "
        f"{f'mean of {many} readings' if many > 1 else 'one reading'}"
        for spot, each, many in zip(means.place, sizes, means.count, strict=True)
    ]
    return {
        "type": "scatter3d", "mode": "markers", "name": "readings", "uid": "readings", **xyz(means.place),
        "text": words, "hoverinfo": "text", "customdata": means.row.tolist(),
        "marker": {"size": 6, "opacity": 0.02, "color": MIDDLE},
    }  # fmt: skip
