"""Paths of runs of a 3-PTT, and the orders in which their poses are repeated."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ptt.rig.nominal import Array, Drawing, nominal_sliders
from ptt.rig.targets import as_targets, make_volume

Random = np.random.Generator
REPEATS = ("none", "consecutive", "cycles", "shuffled", "nine")
PER_TURN = 40  # poses a turn: neighbouring chords differ by 9 degrees, so that speeds can be told from them
RASTER_VISITS = (32, 9)  # poses and visits of the source paper's raster


@dataclass(frozen=True)
class Plan:
    """A path with its repeats.

    Attributes:
        targets: columns name, role, x_cmd, y_cmd, z_cmd, and read where some poses are only passed.
        cycles: number of times that all of it is run through.
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
    half_size: Array,
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
        half_size: (3,) mm, half size of the workspace.
        rows: about how many readings.
        path: kind of path, None lets the seed choose.
        repeats: form of the repeats, None lets the seed choose.
        smooth: it is run without stopping, so that poses have to lie close enough to tell the speed between them.

    Returns:
        The path.
    """
    random = np.random.default_rng([seed, 72])
    drawn_path, drawn_repeats = str(random.choice(PATHS)), str(random.choice(REPEATS))
    path, repeats = path or drawn_path, repeats or drawn_repeats
    times = {"none": 1, "nine": RASTER_VISITS[1]}.get(repeats, int(random.integers(2, 5)))
    count = RASTER_VISITS[0] if repeats == "nine" else max(rows // times, 8)
    if path == "volume":
        table = make_volume(drawing, max(count, 10), seed, half_size)
    elif path == "one-way":
        table = _one_way(drawing, random, count, half_size)
    else:
        table = as_targets(make_path(path, count, half_size, random, smooth=smooth))
    whole = path in ("volume", "one-way")  # their order matters: they are only cycled
    table = table if whole else repeat_poses(table, repeats, times, random)
    cycled = repeats in ("cycles", "nine") or (whole and repeats != "none")
    return Plan(table, times if cycled else 1, path, repeats)


def make_path(kind: str, rows: int, half_size: Array, random: Random, *, smooth: bool = False) -> Array:
    """Poses of a path.

    Args:
        kind: of CURVES.
        rows: number of poses n.
        half_size: (3,) mm, half size of the workspace.
        random: of its proportions.
        smooth: limit the turns to one for every PER_TURN poses.

    Returns:
        (n, 3) mm, to 0.1 um, within the workspace.
    """
    most_turns = rows / PER_TURN if smooth else np.inf
    points = ROUND_PATHS[kind](rows, random, most_turns) if kind in ROUND_PATHS else OTHER_PATHS[kind](rows, random)
    return np.round(points * half_size, 4)


def _cloud(rows: int, random: Random) -> Array:
    return random.uniform(-1.0, 1.0, (rows, 3))


def make_raster(rows: int, heights: Array, random: Random) -> Array:
    """Lines on heights (h,), back and forth or all in one direction, (rows, 3), x and y within -1 ... 1."""
    lines = max(int(np.sqrt(rows / len(heights))), 2)
    across = -(-rows // (len(heights) * lines))
    serpentine = random.random() < 0.5
    poses = []
    for z in heights:
        for number, y in enumerate(np.linspace(-1.0, 1.0, lines)):
            x = np.linspace(-1.0, 1.0, across) if across > 1 else np.zeros(1)
            x = x[::-1] if serpentine and number % 2 else x
            poses.append(np.column_stack([x, np.full(across, y), np.full(across, z)]))
    return np.concatenate(poses)[:rows]


def _raster(rows: int, random: Random) -> Array:
    return make_raster(rows, np.linspace(-1.0, 1.0, int(random.integers(2, 5))), random)


def _round(angle: Array, radius: Array | float, height: Array | float) -> Array:
    """Points at polar angles, (n, 3): radius 1 reaches the sides of the workspace."""
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.broadcast_to(height, angle.shape)])


def _helix(rows: int, random: Random, most_turns: float) -> Array:
    angle = 2.0 * np.pi * min(random.uniform(1.0, 5.0), most_turns) * np.arange(rows) / rows
    return _round(angle, random.uniform(0.5, 1.0), np.linspace(-1.0, 1.0, rows))


def _circle(rows: int, random: Random, most_turns: float) -> Array:
    angle = 2.0 * np.pi * min(int(random.integers(1, 4)), most_turns) * np.arange(rows) / rows
    return _round(angle, random.uniform(0.6, 1.0), random.uniform(-0.8, 0.8))


def _spiral(rows: int, random: Random, most_turns: float) -> Array:
    """A spiral from the centre outwards, on a plane or a cone."""
    part = np.arange(1, rows + 1) / rows
    dish = random.uniform(0.0, 1.5)
    turns = min(random.uniform(3.0, 7.0), most_turns)
    return _round(2.0 * np.pi * turns * np.sqrt(part), np.sqrt(part), dish * (part - 0.5))


def _loop(rows: int, random: Random, most_turns: float) -> Array:
    swing = 2.0 * np.pi * np.arange(rows) / rows
    return _round(min(2.0, most_turns) * swing, 0.75 + 0.25 * np.cos(swing), np.sin(swing + random.uniform(0.0, 6.0)))


def _star(rows: int, random: Random) -> Array:
    """Rays from the centre outwards and back."""
    steps = int(random.integers(2, 5))
    part = np.concatenate([np.arange(steps + 1), np.arange(steps - 1, 0, -1)]) / steps
    rays = -(-rows // len(part))
    ends = random.uniform(-1.0, 1.0, (rays, 3))
    ends /= np.abs(ends).max(axis=1, keepdims=True)
    return (part[None, :, None] * ends[:, None]).reshape(-1, 3)[:rows]


def _walk(rows: int, random: Random) -> Array:
    """A random walk reflected at the sides of the workspace."""
    place = np.cumsum(random.normal(0.0, random.uniform(0.15, 0.5), (rows, 3)), axis=0)
    return np.abs((place + 1.0) % 4.0 - 2.0) - 1.0


ROUND_PATHS: dict[str, Callable[[int, Random, float], Array]] = {  # can be run without stopping
    "helix": _helix,
    "circle": _circle,
    "spiral": _spiral,
    "loop": _loop,
}
OTHER_PATHS: dict[str, Callable[[int, Random], Array]] = {
    "cloud": _cloud,
    "raster": _raster,
    "star": _star,
    "walk": _walk,
}
CURVES = ("cloud", "raster", *ROUND_PATHS, "star", "walk")
SMOOTH = tuple(ROUND_PATHS)
PATHS = ("volume", "one-way", *CURVES)


def _one_way(drawing: Drawing, random: Random, count: int, half_size: Array) -> pd.DataFrame:
    """Poses that every slider reaches upwards: from a pose straight below, which is passed without a reading.

    On upright rails a move of the tool along z moves every slider by as much.
    """
    poses = np.round(random.uniform(-half_size, half_size, (count, 3)) * [1.0, 1.0, 0.8], 4)
    below = poses - [0.0, 0.0, 0.2 * half_size[2]]
    table = as_targets(np.stack([below, poses], axis=1).reshape(-1, 3))
    table["read"] = np.tile([0, 1], count)
    move = nominal_sliders(drawing, poses) - nominal_sliders(drawing, below)
    assert (move > 0.0).all(), "a slider goes down where the tool goes up"
    return table


def repeat_poses(table: pd.DataFrame, form: str, times: int, random: Random) -> pd.DataFrame:
    """Targets, each repeated some times one after another (form "consecutive") or in random order ("shuffled")."""
    if form not in ("consecutive", "shuffled"):
        return table
    order = np.repeat(np.arange(len(table)), times)
    return table.iloc[random.permutation(order) if form == "shuffled" else order].reset_index(drop=True)
