"""The machine with its fault as a static picture: shaded solids, displaced parts as an orange ghost, sizes beside."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from ptt.show.card.scene import GHOST, PART_COLOURS, PoseLines, legs_at_fault, moved, only, parts_of, place_of_part
from ptt.show.card.solids import Solid
from ptt.show.card.words import by_part

FAULT = "#b34700"
TURN, RISE = np.radians(38.0), np.radians(20.0)  # azimuth and elevation of the viewpoint
LIGHT = np.array([0.35, -0.5, 0.8])  # direction toward the light
RIM = 6.0  # pixels around a label that stay free
DIM = 0.55  # share of its colour that a face edge-on to the light keeps


def draw_scene(
    lines: PoseLines, shift: Mapping[str, Any] | None, values: list[Mapping[str, Any]], times: float
) -> Figure:
    """Draw a machine at one pose.

    Args:
        lines: the machine.
        shift: displacements by an effect, from `ptt.show.card.ghost`, of which the middle pose is drawn; None for no
            ghost.
        values: values of the finding, written beside their parts.
        times: factor by which displacements are enlarged.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(7.2, 5.6), layout="constrained")
    axes = figure.add_subplot()
    parts = [(solid, PART_COLOURS[name], 1.0) for name, solid in parts_of(lines).items()]
    there = lines
    if shift is not None:
        at = len(shift["platform"]) // 2
        there = moved(lines, shift, at, times)
        parts += [(solid, GHOST, 0.55) for solid in only(there, *legs_at_fault(shift)).values()]
    _fill(axes, parts)
    notes: list[Annotation] = []
    middle = float(_seen(lines.chains.reshape(-1, 3))[0][:, 0].mean())
    for who, said in by_part(values if shift is not None else ()):
        place, _ = _seen(place_of_part(there, who)[None])
        words = f"{who}: " + "\n".join(size.partition("\n")[0] for size in said)  # the text beside says which way
        box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": GHOST, "alpha": 0.9}
        right = place[0, 0] > middle
        note = axes.annotate(
            words, (float(place[0, 0]), float(place[0, 1])), (-14 if right else 14, 16), textcoords="offset points",
            color=FAULT, fontsize=12, fontweight="bold", bbox=box, ha="right" if right else "left",
        )  # fmt: skip
        notes.append(note)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.12)
    axes.axis("off")
    _draw_apart(figure, notes)
    return figure


def _draw_apart(figure: Figure, notes: list[Annotation]) -> None:
    """Raise labels that overlap, the lowest first."""
    if len(notes) < 2:
        return
    figure.draw_without_rendering()
    boxes = {id(note): note.get_window_extent().padded(RIM) for note in notes}
    placed: list[Bbox] = []
    for note in sorted(notes, key=lambda each: float(boxes[id(each)].y0)):
        box = boxes[id(note)]
        for other in placed:  # from the lowest up, so that one pass is enough
            if box.overlaps(other):
                box = box.translated(0.0, other.y1 - box.y0)
        along, up = note.xyann
        note.xyann = (along, up + (box.y0 - boxes[id(note)].y0) * 72.0 / figure.dpi)
        placed = sorted([*placed, box], key=lambda each: float(each.y0))


def _fill(axes: Any, parts: list[tuple[Solid, str, float]]) -> None:
    """Fill shaded triangles from far to near (painter's algorithm), of solids with colour and opacity."""
    corners, colours, depth = [], [], []
    light = LIGHT / np.linalg.norm(LIGHT)
    for solid, colour, alpha in parts:
        flat, away = _seen(solid.points)
        spots = solid.points[solid.faces]  # shape: (f, 3, 3)
        normal = np.cross(spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0])
        bright = np.abs(normal @ light) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
        shade = DIM + (1.0 - DIM) * bright
        corners.append(flat[solid.faces])
        colours.append(np.column_stack([shade[:, None] * np.asarray(to_rgb(colour)), np.full(len(shade), alpha)]))
        depth.append(away[solid.faces].mean(axis=1))
    order = np.argsort(-np.concatenate(depth))
    faces = PolyCollection(
        list(np.concatenate(corners)[order]), facecolors=np.concatenate(colours)[order], linewidths=0.0
    )
    axes.add_collection(faces)


def _seen(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthographic projection of points (n, 3): coordinates in the picture (n, 2) and depth (n,), mm."""
    across = np.array([-np.sin(TURN), np.cos(TURN), 0.0])
    toward = np.array([np.cos(TURN) * np.cos(RISE), np.sin(TURN) * np.cos(RISE), np.sin(RISE)])
    up = np.cross(toward, across)
    return np.stack([points @ across, points @ up], axis=1), -(points @ toward)
