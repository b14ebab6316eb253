"""Targets of runs of a 3-PTT: paths, and random poses of a volume with repeats and datum visits."""

import numpy as np
import pandas as pd

from ptt.errors import WorkspaceError
from ptt.rig.nominal import Array, Drawing, can_reach, nominal_sliders
from ptt.rig.schedule import TARGET

HALF_SIZE = np.array([60.0, 60.0, 50.0])  # mm, of the volume on the bench
APPROACH = 22.0  # mm on the bench, distance from which a pose of a group is approached
LEAST_MOVE = 2.0  # mm on the bench, that every slider moves on an approach: more than play and wind-up take
DATUM_EVERY = 3  # blocks of rows between two datum visits


def make_helix(rows: int, *, radius: float = 60.0, rise: float = 0.25, turns: float = 1.0, start: float = 0.0) -> Array:
    """Helix x = r1 cos a, y = r1 sin a, z = C t with t from 1, the path of the source paper (Chen et al., 2023).

    Args:
        rows: number of points n.
        radius: r1, mm.
        rise: C, mm per point.
        turns: number of turns.
        start: added to z, mm.

    Returns:
        (n, 3) mm, to 0.1 um.
    """
    point = np.arange(1, rows + 1)
    angle = 2.0 * np.pi * turns * point / rows
    return np.round(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), start + rise * point]), 4)


def there_and_back(path: Array) -> Array:
    """A path forth and back through the same points; both ends are visited once, so that it can be cycled.

    Args:
        path: (n, 3) mm.

    Returns:
        (2 n - 2, 3) mm.
    """
    return np.concatenate([path, path[-2:0:-1]])


def make_loop(rows: int) -> Array:
    """A smooth closed path in space: two turns with radius 45 mm +-15 mm and height +-30 mm, each in one period.

    Args:
        rows: number of points n.

    Returns:
        (n, 3) mm, to 0.1 um.
    """
    swing = 2.0 * np.pi * np.arange(rows) / rows
    wide = 60.0 * (0.75 + 0.25 * np.cos(swing))
    path = np.column_stack([wide * np.cos(2 * swing), wide * np.sin(2 * swing), 30.0 * np.sin(swing)])
    return np.round(path, 4)


def volume_span(drawing: Drawing, half_size: Array = HALF_SIZE) -> tuple[float, float]:
    """Range of slider heights over what the machine reaches of a volume.

    Args:
        drawing: the ideal machine.
        half_size: (3,) mm, half size of the volume.

    Returns:
        Lowest and highest height, mm.
    """
    grid = np.stack(np.meshgrid(*([-1.0, -0.5, 0.0, 0.5, 1.0],) * 3), axis=-1).reshape(-1, 3) * half_size
    heights = nominal_sliders(drawing, grid[can_reach(drawing, grid)])
    return float(np.round(heights.min(), 3)), float(np.round(heights.max(), 3))


def as_targets(path: Array, prefix: str = "p") -> pd.DataFrame:
    """A targets table of a path.

    Args:
        path: (n, 3) mm.
        prefix: of the names.

    Returns:
        Columns name, role, x_cmd, y_cmd, z_cmd; a pose visited again keeps its name.
    """
    table = pd.DataFrame(path, columns=TARGET)
    number = table.groupby(TARGET, sort=False).ngroup() + 1
    table.insert(0, "name", [f"{prefix}{value}" for value in number])
    table.insert(1, "role", "pose")
    return table


def make_volume(drawing: Drawing, rows: int, seed: int, half_size: Array = HALF_SIZE) -> pd.DataFrame:
    """Random poses in a volume, on the bench one of 120 x 120 x 100 mm.

    Every second block is a group Q P S P Q P S P around one pose P, which is reached twice in either direction of every
    slider: repeats and both directions of arrival. A datum pose is visited in between, always from the same side.

    Args:
        drawing: the ideal machine.
        rows: number of rows at the most.
        seed: of the poses.
        half_size: (3,) mm, half size of the volume.

    Returns:
        Columns name, role, x_cmd, y_cmd, z_cmd.

    Raises:
        WorkspaceError: the machine reaches too little of the volume.
    """
    random = np.random.default_rng([seed, 11])
    blocks: list[pd.DataFrame] = []
    count, left = 0, rows
    datum = _datum_visit(half_size)
    while left >= 8:
        if count % DATUM_EVERY == 0 and left >= 10:
            blocks.append(datum)
            left -= len(datum)
        if count % 2 == 0:
            block = as_targets(_group(drawing, random, half_size), f"g{count + 1}.")
        else:
            block = as_targets(_random_poses(drawing, random, min(12, left), half_size), f"v{count + 1}.")
        blocks.append(block)
        left -= len(block)
        count += 1
    if left > 0:
        blocks.append(as_targets(_random_poses(drawing, random, left, half_size), f"v{count + 1}."))
    return pd.concat(blocks, ignore_index=True)


def _random_poses(drawing: Drawing, random: np.random.Generator, count: int, half_size: Array) -> Array:
    """Poses (count, 3) mm uniform in the volume, so that slider heights fall on every phase of the screw."""
    poses = np.round(random.uniform(-half_size, half_size, (4 * count + 8, 3)), 4)
    return poses[can_reach(drawing, poses)][:count]


def _group(drawing: Drawing, random: np.random.Generator, half_size: Array) -> Array:
    """A pose approached in either direction of every slider, twice, (8, 3) mm."""
    scale = float((half_size / HALF_SIZE).min())
    for _ in range(1000):
        approach = random.normal(size=3)
        approach *= scale * APPROACH / np.linalg.norm(approach)
        centre = random.uniform(-half_size, half_size)
        before, after = np.round(centre - approach, 4), np.round(centre + approach, 4)
        centre = np.round(centre, 4)
        three = np.array([before, centre, after])
        if (np.abs(three) > half_size).any() or not can_reach(drawing, three).all():
            continue
        move = np.diff(nominal_sliders(drawing, three), axis=0)
        if (np.abs(move) > scale * LEAST_MOVE).all() and (move[0] * move[1] > 0).all():
            return three[[0, 1, 2, 1] * 2]
    size = " x ".join(f"{2.0 * half:g}" for half in half_size)
    raise WorkspaceError(
        f"no pose within {size} mm about p = 0 can be approached from both sides of every slider",
        [],
        fix="take a machine that reaches more of it",
    )


def _datum_visit(half_size: Array) -> pd.DataFrame:
    """The datum pose p = 0 and the pose from which it is approached."""
    table = as_targets(
        np.array([np.round(np.array([10.0, 14.0, 30.0]) * half_size / HALF_SIZE, 4), np.zeros(3)]), "datum"
    )
    table["name"] = ["approach", "datum"]
    table["role"] = ["pose", "datum"]
    return table
