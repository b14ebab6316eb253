"""Runs of arms: random postures, the poses of ISO 9283, lines and rasters of the tool, sweeps of joints, stations."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from ptt.machine import SerialSpec
from ptt.rig.arm_faults import tool_jacobian, tool_on_drawing, within_limits
from ptt.rig.draw_arm_machine import ForeignArm, inverse_condition
from ptt.rig.nominal import Array
from ptt.rig.paths import Plan, make_raster, repeat_poses

Random = np.random.Generator
DIGITS = 6  # of a command in rad: a microradian
NEWTON = 25  # Gauss-Newton steps of an inverse at the most
FOUND = 1e-6  # mm, greatest error of an inverse
FARTHEST = 0.8  # rad from the start of an inverse: farther away the arm may be in another configuration
SHRINK = 0.8  # factor on a figure that the arm cannot follow
TRIES = 60  # random postures or lines that are tried before giving up
INSET = 0.1  # of the diagonal: the poses of ISO 9283 lie inside the corners of its cube by it
BESIDE = (0.05, 0.2)  # rad, distance from which a pose is approached


def draw_arm_plan(seed: int, arm: ForeignArm, rows: int, path: str | None = None) -> Plan:
    """Draw a path and how its poses are repeated.

    Args:
        seed: of everything.
        arm: the drawing, and where its joints go.
        rows: about how many readings.
        path: kind of path, None lets the seed choose.

    Returns:
        The targets, columns name and q1_cmd_rad.., and read where some poses are only passed.
    """
    random = np.random.default_rng([seed, 82])
    drawn_path, drawn_form = str(random.choice(list(PATHS))), str(random.choice(["none", "none", *FORMS]))
    path = path or drawn_path
    form = drawn_form if path in ("cloud", "lines", "raster") else VISITS[path]
    times = int(random.integers(2, 5)) if form in FORMS else 1
    table = PATHS[path](random, arm, max(rows // times, 10))
    return Plan(repeat_poses(table, form, times, random), times if form == "cycles" else 1, path, form)


def inverse(spec: SerialSpec, start: Array, goal: Array) -> Array:
    """Inverse kinematics of the drawing's tool point, near given joint values.

    Source: Gauss-Newton with the pseudo-inverse of dp/dq, which moves redundant joints least.

    Args:
        spec: the drawing.
        start: (n, k) rad.
        goal: (n, 3) mm, base frame.

    Returns:
        (n, k) rad, NaN where none was found within the limits and near the start.
    """
    q = np.array(start, dtype=float)
    for _ in range(NEWTON):
        off = goal - tool_on_drawing(spec, q)
        if np.abs(off).max() < 0.1 * FOUND:
            break
        step = np.einsum("nkx,nx->nk", np.linalg.pinv(tool_jacobian(spec, q), rcond=1e-3), off)
        q += step / np.maximum(1.0, np.abs(step).max(axis=1, keepdims=True) / 0.3)
    missed = np.linalg.norm(goal - tool_on_drawing(spec, q), axis=1) > FOUND
    lost = missed | (np.abs(q - start) > FARTHEST).any(axis=1) | ~within_limits(spec, q).all(axis=1)
    return np.where(lost[:, None], np.nan, q)


def _spread(random: Random, arm: ForeignArm, count: int) -> Array:
    """Random postures: of twice as many the half that is farthest from singular ones, (n, k) rad."""
    q = random.uniform(arm.low, arm.high, (2 * count, len(arm.low)))
    keep = np.argsort(-inverse_condition(_drawing(arm), q))[:count]
    return np.asarray(q[np.sort(keep)])


def _cloud(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
    return _table(_spread(random, arm, rows))


def _cube(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
    """ISO 9283: five poses on a diagonal plane of a cube, one after another, again and again; more planes, more poses.

    P1 is the middle, P2 to P5 are the plane's corners, a tenth of the diagonal inside.
    """
    planes = [
        np.array([[0, 0, 0], [1, s, 1], [-1, s, 1], [-1, -s, -1], [1, -s, -1]], dtype=float) for s in (1.0, -1.0)
    ] + [np.array([[0, 0, 0], [s, 1, 1], [s, -1, 1], [-s, -1, -1], [-s, 1, -1]], dtype=float) for s in (1.0, -1.0)]
    chosen = [planes[number] for number in random.permutation(4)[: int(random.integers(1, 5))]]
    shape = 0.5 * (1.0 - 2.0 * INSET) * np.concatenate(chosen)
    side = random.uniform(0.2, 0.45) * arm.reach_mm
    cubes = [_figure(random, arm, side * shape) for _ in range(int(random.integers(1, 4)))]
    poses = np.concatenate(cubes)
    visits = max(rows // len(poses), 2)
    return pd.concat([_table(poses)] * visits, ignore_index=True)


def _raster(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
    """A plane or two, line by line, to and fro or all one way."""
    heights = int(random.integers(1, 3))
    places = make_raster(rows, np.linspace(-0.5, 0.5, heights) if heights > 1 else np.zeros(1), random)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    half = random.uniform(0.08, 0.25) * arm.reach_mm
    return _table(_figure(random, arm, half * places @ axes.T))


def _lines(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
    """Straight lines of the tool, one from the end of another or apart."""
    parts: list[Array] = []
    each, end = int(random.integers(6, 25)), _spread(random, arm, 1)[0]
    joined = random.random() < 0.5
    while each * len(parts) < rows:
        begin = end if joined and parts else _spread(random, arm, 1)[0]
        for _ in range(TRIES):
            end = _spread(random, arm, 1)[0]
            share = np.linspace(0.0, 1.0, each)[:, None]
            ends = tool_on_drawing(_drawing(arm), np.array([begin, end]))
            line = inverse(_drawing(arm), begin + share * (end - begin), ends[0] + share * (ends[1] - ends[0]))
            if np.isfinite(line).all():
                parts.append(line)
                break
            begin = begin if joined and parts else _spread(random, arm, 1)[0]
        else:
            joined = False  # out of a corner that no line leads out of
    return _table(np.concatenate(parts)[:rows])


def _one_joint(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
    """One joint after another to and fro, the others held; about one posture or a few."""
    joints, homes = len(arm.low), int(random.integers(1, 4))
    each = max(rows // (2 * joints * homes), 2)
    parts = []
    for home in _spread(random, arm, homes):
        for joint in range(joints):
            there = np.linspace(arm.low[joint], arm.high[joint], each)
            sweep = np.tile(home, (2 * each, 1))
            sweep[:, joint] = np.concatenate([there, there[::-1]])
            parts.append(sweep)
    return _table(np.concatenate(parts))


def _stations(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
    """Pick and place: a few stations in any order, each from a place beside it that is read or only passed."""
    stations = _spread(random, arm, int(random.integers(4, 16)))
    beside = stations + random.uniform(*BESIDE) * random.choice([-1.0, 1.0], stations.shape)
    beside = np.clip(beside, arm.low, arm.high)
    seen = random.random() < 0.5
    order = random.integers(len(stations), size=max(rows // 2 if seen else rows, 10))
    q = np.stack([beside[order], stations[order]], axis=1).reshape(-1, stations.shape[1])
    names = [name for number in order for name in (f"a{number + 1}", f"p{number + 1}")]
    return _table(q, names, None if seen else np.tile([0, 1], len(order)))


def _arrivals(sides: tuple[float, ...]) -> Callable[[Random, ForeignArm, int], pd.DataFrame]:
    """Every pose is arrived at from a side or from both, with all joints at once."""

    def draw(random: Random, arm: ForeignArm, rows: int) -> pd.DataFrame:
        poses = _spread(random, arm, max(rows // len(sides), 5))
        away = random.uniform(*BESIDE)
        poses = np.clip(poses, arm.low + away, arm.high - away)
        steps = [part for side in sides for part in (poses + side * away, poses)]
        q = np.stack(steps, axis=1).reshape(-1, poses.shape[1])
        names = [name for number in range(len(poses)) for name in (f"a{number + 1}", f"p{number + 1}") * len(sides)]
        return _table(q, names, np.tile([0, 1], len(q) // 2))

    return draw


PATHS: dict[str, Callable[[Random, ForeignArm, int], pd.DataFrame]] = {
    "cloud": _cloud,
    "iso-cube": _cube,
    "raster": _raster,
    "lines": _lines,
    "one-joint": _one_joint,
    "stations": _stations,
    "both-ways": _arrivals((-1.0, 1.0)),
    "one-way": _arrivals((-1.0,)),
}
FORMS = ("consecutive", "cycles", "shuffled")
# How poses are repeated on paths that are what they are by their order.
VISITS = {"iso-cube": "cycled", "one-joint": "none", "stations": "visits", "both-ways": "both", "one-way": "none"}


def _figure(random: Random, arm: ForeignArm, places: Array) -> Array:
    """A figure of places (n, 3) mm about some posture, shrunk until the arm can follow, (n, k) rad."""
    for _ in range(TRIES):
        home, size = _spread(random, arm, 4)[0], 1.0
        while size > 0.2:
            middle = tool_on_drawing(_drawing(arm), home[None])
            q = inverse(_drawing(arm), np.tile(home, (len(places), 1)), middle + size * places)
            if np.isfinite(q).all():
                return q
            size *= SHRINK
    raise AssertionError("no figure of the tool fits the arm")


def _drawing(arm: ForeignArm) -> SerialSpec:
    spec = arm.file.machine
    assert isinstance(spec, SerialSpec)
    return spec


def _table(q: Array, names: list[str] | None = None, read: Array | None = None) -> pd.DataFrame:
    columns = [f"q{joint + 1}_cmd_rad" for joint in range(q.shape[1])]
    table = pd.DataFrame(np.round(q, DIGITS), columns=columns)
    table.insert(0, "name", names or [f"p{number + 1}" for number in range(len(q))])
    return table if read is None else table.assign(read=read)
