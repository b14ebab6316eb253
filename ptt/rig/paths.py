"""Paths a run can take, and the forms in which its poses are visited again."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ptt.rig.nominal import Array, Drawing, nominal_sliders
from ptt.rig.targets import as_targets, make_volume

Random = np.random.Generator
REPEATS = ("none", "consecutive", "cycles", "shuffled", "nine")
PER_TURN = 40  # poses from which a chord's direction is within a hundredth of the path's
NINE = (32, 9)  # poses and visits of the source paper's raster


@dataclass(frozen=True)
class Plan:
    """A path with its repeats.

    Attributes:
        targets: columns name, role, x_cmd, y_cmd, z_cmd, and read where some poses are only passed.
        cycles: how often all of it is run through.
        path: kind of path.
        repeats: form of the repeats.
    """

    targets: pd.DataFrame
    cycles: int
    path: str
    repeats: str


def draw_plan(
    seed: int,
    drawing: Drawing,
    room: Array,
    rows: int,
    path: str | None = None,
    repeats: str | None = None,
    *,
    smooth: bool = False,
) -> Plan:
    """Draw a path and how its poses are repeated.

    Args:
        seed: of everything.
        drawing: the ideal machine.
        room: (3,) mm, half size of the workspace.
        rows: about how many readings; never more than a few over it.
        path: kind of path, None lets the seed choose.
        repeats: form of the repeats, None lets the seed choose.
        smooth: it is run without stopping, so that poses lie close enough to tell the speed between them.

    Returns:
        The targets.
    """
    random = np.random.default_rng([seed, 72])
    drawn_path, drawn_repeats = str(random.choice(PATHS)), str(random.choice(REPEATS))
    path, repeats = path or drawn_path, repeats or drawn_repeats
    times = {"none": 1, "nine": NINE[1]}.get(repeats, int(random.integers(2, 5)))
    count = NINE[0] if repeats == "nine" else max(rows // times, 8)
    if path == "volume":
        table = make_volume(drawing, max(count, 10), seed, room)
    elif path == "one-way":
        table = _one_way(drawing, random, count, room)
    else:
        table = as_targets(make_path(path, count, room, random, smooth=smooth))
    table = _repeat(table, repeats, times, random, whole=path in ("volume", "one-way"))
    cycled = repeats in ("cycles", "nine") or (path in ("volume", "one-way") and repeats != "none")
    return Plan(table, times if cycled else 1, path, repeats)


def make_path(kind: str, rows: int, room: Array, random: Random, *, smooth: bool = False) -> Array:
    """Poses of a path.

    Args:
        kind: of CURVES.
        rows: number of poses n.
        room: (3,) mm, half size of the workspace.
        random: of its proportions.
        smooth: no more turns than poses lie close on.

    Returns:
        (n, 3) mm, to 0.1 um, inside the room.
    """
    most = rows / PER_TURN if smooth else np.inf
    points = ROUND[kind](rows, random, most) if kind in ROUND else FREE[kind](rows, random)
    return np.round(points * room, 4)


def _cloud(rows: int, random: Random) -> Array:
    return random.uniform(-1.0, 1.0, (rows, 3))


def _raster(rows: int, random: Random) -> Array:
    """Two to four heights, lines back and forth or all one way."""
    heights = int(random.integers(2, 5))
    lines = max(int(np.sqrt(rows / heights)), 2)
    across = -(-rows // (heights * lines))
    serpentine = random.random() < 0.5
    poses = []
    for z in np.linspace(-1.0, 1.0, heights):
        for number, y in enumerate(np.linspace(-1.0, 1.0, lines)):
            x = np.linspace(-1.0, 1.0, across) if across > 1 else np.zeros(1)
            x = x[::-1] if serpentine and number % 2 else x
            poses.append(np.column_stack([x, np.full(across, y), np.full(across, z)]))
    return np.concatenate(poses)[:rows]


def _round(angle: Array, radius: Array | float, height: Array | float) -> Array:
    """Points on circles that touch the walls where the radius is 1."""
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.broadcast_to(height, angle.shape)])


def _helix(rows: int, random: Random, most: float) -> Array:
    angle = 2.0 * np.pi * min(random.uniform(1.0, 5.0), most) * np.arange(rows) / rows
    return _round(angle, random.uniform(0.5, 1.0), np.linspace(-1.0, 1.0, rows))


def _circle(rows: int, random: Random, most: float) -> Array:
    angle = 2.0 * np.pi * min(int(random.integers(1, 4)), most) * np.arange(rows) / rows
    return _round(angle, random.uniform(0.6, 1.0), random.uniform(-0.8, 0.8))


def _spiral(rows: int, random: Random, most: float) -> Array:
    """Out from the middle, on a dish."""
    part = np.arange(1, rows + 1) / rows
    dish = random.uniform(0.0, 1.5)
    turns = min(random.uniform(3.0, 7.0), most)
    return _round(2.0 * np.pi * turns * np.sqrt(part), np.sqrt(part), dish * (part - 0.5))


def _loop(rows: int, random: Random, most: float) -> Array:
    swing = 2.0 * np.pi * np.arange(rows) / rows
    return _round(min(2.0, most) * swing, 0.75 + 0.25 * np.cos(swing), np.sin(swing + random.uniform(0.0, 6.0)))


def _star(rows: int, random: Random) -> Array:
    """Rays from the middle outwards and back."""
    steps = int(random.integers(2, 5))
    part = np.concatenate([np.arange(steps + 1), np.arange(steps - 1, 0, -1)]) / steps
    rays = -(-rows // len(part))
    ends = random.uniform(-1.0, 1.0, (rays, 3))
    ends /= np.abs(ends).max(axis=1, keepdims=True)
    return (part[None, :, None] * ends[:, None]).reshape(-1, 3)[:rows]


def _walk(rows: int, random: Random) -> Array:
    """A random walk that the walls throw back."""
    place = np.cumsum(random.normal(0.0, random.uniform(0.15, 0.5), (rows, 3)), axis=0)
    return np.abs((place + 1.0) % 4.0 - 2.0) - 1.0


ROUND: dict[str, Callable[[int, Random, float], Array]] = {  # can be run without stopping
    "helix": _helix,
    "circle": _circle,
    "spiral": _spiral,
    "loop": _loop,
}
FREE: dict[str, Callable[[int, Random], Array]] = {"cloud": _cloud, "raster": _raster, "star": _star, "walk": _walk}
CURVES = ("cloud", "raster", *ROUND, "star", "walk")
SMOOTH = tuple(ROUND)
PATHS = ("volume", "one-way", *CURVES)


def _one_way(drawing: Drawing, random: Random, count: int, room: Array) -> pd.DataFrame:
    """Every pose is reached upwards by every slider: from below, a place that is passed without a reading.

    Leaning rails apart, sliders follow the tool's height one to one, so that straight down is the way.
    """
    poses = np.round(random.uniform(-room, room, (count, 3)) * [1.0, 1.0, 0.8], 4)
    below = poses - [0.0, 0.0, 0.2 * room[2]]
    table = as_targets(np.stack([below, poses], axis=1).reshape(-1, 3))
    table["read"] = np.tile([0, 1], count)
    move = nominal_sliders(drawing, poses) - nominal_sliders(drawing, below)
    assert (move > 0.0).all(), "a slider goes down where the tool goes up"
    return table


def _repeat(table: pd.DataFrame, form: str, times: int, random: Random, *, whole: bool) -> pd.DataFrame:
    """Visit poses again one after another, or in any order; paths whose order matters are only cycled `whole`."""
    if whole or form not in ("consecutive", "shuffled"):
        return table
    order = np.repeat(np.arange(len(table)), times)
    return table.iloc[random.permutation(order) if form == "shuffled" else order].reset_index(drop=True)
