"""How the sliders get from row to row: the path between, the controller's own compensation, speeds."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from ptt.rig.nominal import Array, Drawing, nominal_sliders

STANDSTILL = 1e-9  # mm
SHARP = 0.7  # cosine of the angle at which a path turns so sharply that it is no smooth motion
ROUNDED = 0.2  # s: a controller rounds off corners after moves that are shorter
TRANSIT = 16  # even parts of a straight move of the tool that are looked at
CLOSE = 1e-4  # of a straight move: near enough to its end to have the speed of that, and about a turn its curvature


@dataclass(frozen=True)
class Path:
    """Commanded slider heights in the order of travel, the stretches between rows included.

    Attributes:
        slider: (m, 3) mm.
        row: (m,) int, the row that each point leads to.
        last: (n,) int, the point at which each row is read.
    """

    slider: Array
    row: Array
    last: Array


def run_path(drawing: Drawing, tool: Array, command: Array, run: Array, *, straight: bool, lead_in: float) -> Path:
    """Lay the sliders' path through the rows.

    A run's first row is arrived at in the direction in which the second one sets off: the machine leads in.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm, commanded tool positions.
        command: (n, 3) mm, commanded slider heights.
        run: (n,) int.
        straight: the tool runs straight between rows; otherwise each slider runs monotonically.
        lead_in: mm, how far each slider travels before a run's first row.

    Returns:
        The path.
    """
    first = np.flatnonzero(np.diff(run, prepend=run[0] - 1))
    rows = len(command)
    points = np.stack([command, command], axis=1)  # shape: (n, points, 3), the last one that of the row
    if straight:
        way = _straight_way(drawing, tool, command)
        points = np.concatenate([way(_inner_parts(way, rows)), command[:, None]], axis=1)
    count = np.full(rows, points.shape[1] if straight else 1)
    count[first] = 2
    points[first, -2] = command[first] - lead_in * first_moves(points if straight else command[:, None], first)
    passed = np.arange(points.shape[1]) >= points.shape[1] - count[:, None]
    return Path(points[passed], np.repeat(np.arange(rows), count), np.cumsum(count) - 1)


def _straight_way(drawing: Drawing, tool: Array, command: Array) -> Callable[[Array], Array]:
    """Sliders while the tool runs straight to each row: from parts of the way, (n, p), to heights, (n, p, 3) mm.

    What compensation adds to the nominal command changes evenly on the way.
    """
    extra = command - nominal_sliders(drawing, tool)
    start = np.maximum(np.arange(len(tool)) - 1, 0)

    def way(part: Array) -> Array:
        between, more = (
            values[start, None] + part[:, :, None] * (values - values[start])[:, None] for values in (tool, extra)
        )
        return nominal_sliders(drawing, between.reshape(-1, 3)).reshape(between.shape) + more

    return way


def _inner_parts(way: Callable[[Array], Array], rows: int) -> Array:
    """Parts of each straight way to look at, in rising order: even ones, and where each slider turns.

    A height curves one way along a straight line, so it turns once at the most: at the top of the parabola through the
    highest or lowest even part and its neighbours, and once more through three places close about that top.
    """
    even = np.tile(np.arange(TRANSIT + 1) / TRANSIT, (rows, 1))
    height = way(even)  # shape: (n, TRANSIT + 1, 3)
    step = np.diff(height, axis=1)
    bend = np.diff(np.sign(step), axis=1) != 0.0
    nearer = np.where(np.abs(step[:, 0]) < np.abs(step[:, -1]), 1, TRANSIT - 1)
    at = np.where(bend.any(axis=1), 1 + np.argmax(bend, axis=1), nearer)  # shape: (n, 3)
    three = [np.take_along_axis(height, at[:, None] + beside, axis=1)[:, 0] for beside in (-1, 0, 1)]
    turn = np.clip((at + _top(*three)) / TRANSIT, CLOSE, 1.0 - CLOSE)
    three = [np.einsum("nll->nl", way(turn + beside * CLOSE)) for beside in (-1, 0, 1)]
    turn = np.clip(turn + CLOSE * _top(*three), CLOSE, 1.0 - CLOSE)
    return np.sort(np.concatenate([even[:, 1:-1], turn], axis=1), axis=1)


def _top(before: Array, here: Array, after: Array) -> Array:
    """Where the parabola through three even places turns, in steps from the middle one, within them."""
    bend = before - 2.0 * here + after
    return np.clip(np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend != 0.0), -1.0, 1.0)


def travel_direction(slider: Array) -> Array:
    """Direction of travel at each point of a path; standstill keeps the last one.

    Args:
        slider: (m, 3) mm.

    Returns:
        (m, 3), +1 or -1; 0 before the first move.
    """
    step = np.diff(slider, axis=0, prepend=slider[:1])
    sign = np.where(np.abs(step) > STANDSTILL, np.sign(step), 0.0)
    at = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign))[:, None], 0), axis=0)
    return np.take_along_axis(sign, at, axis=0)


def end_moves(drawing: Drawing, tool: Array, command: Array) -> tuple[Array, Array]:
    """How the sliders set off and arrive on straight moves of the tool.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm, commanded tool positions.
        command: (n, 3) mm, commanded slider heights.

    Returns:
        (n, 3) mm per move each, of the move to each row; those to first rows tell nothing.
    """
    way, part = _straight_way(drawing, tool, command), np.tile([0.0, CLOSE, 1.0 - CLOSE, 1.0], (len(tool), 1))
    start, after, before, end = np.moveaxis(way(part), 1, 0)
    return (after - start) / CLOSE, (end - before) / CLOSE


def slider_speed(
    command: Array,
    tool: Array,
    time: Array,
    still: Array,
    run: Array | None = None,
    ends: tuple[Array, Array] | None = None,
) -> Array:
    """Slider speeds at the rows of a path that is run without stopping.

    Between corners the motion is smooth: a cubic spline over time. At a corner, and where the feed changes, an axis
    still has the speed at which it came, but at a sharp turn after a move so short that the controller rounds it off:
    there its speed is halfway between before and after. What is run through again from where it ended, a lap after a
    lap, is led in and out by itself, as every run is: a row that repeats the one before begins it.

    Args:
        command: (n, 3) mm.
        tool: (n, 3) mm.
        time: (n,) s.
        still: (n,) bool, rows that are read at standstill.
        run: (n,) number of each row's run. None for a single one.
        ends: (n, 3) mm per move each, how straight moves to the rows set off and arrive; None: sliders run evenly.

    Returns:
        (n, 3) mm/s, zero at standstill.
    """
    again = ~still & (np.linalg.norm(np.diff(tool, axis=0, prepend=np.inf), axis=1) <= STANDSTILL)
    lap = np.cumsum(again) + len(tool) * (np.zeros(len(tool), dtype=int) if run is None else run)
    if len(np.unique(lap)) > 1:
        parts = [np.flatnonzero(lap == number) for number in np.unique(lap)]
        speeds = [
            slider_speed(
                command[rows], tool[rows], time[rows], still[rows], ends=ends and (ends[0][rows], ends[1][rows])
            )
            for rows in parts
        ]
        return np.concatenate(speeds)[np.argsort(np.concatenate(parts))]
    speed = np.zeros_like(command)
    if still.all():
        return speed
    sharp, change = _corners(tool, time, still)
    corners = [0, *np.flatnonzero(sharp | change), len(command) - 1]
    for first, last in pairwise(corners):
        rows = np.arange(first, last + 1)
        if len(rows) < 2:
            continue
        if len(rows) > 2:
            along = CubicSpline(time[rows], command[rows])(time[rows], 1)
        else:
            moves = [command[last] - command[first]] * 2 if ends is None else [part[last] for part in ends]
            along = np.array(moves) / (time[last] - time[first])
        rounded = sharp[first] and time[first] - time[first - 1] < ROUNDED
        kept = 0.0 if first == 0 else 0.5 if rounded else 1.0
        speed[first] = kept * speed[first] + (1.0 - kept) * along[0]
        speed[rows[1:]] = along[1:]
    return np.where(still[:, None], 0.0, speed)


def _corners(tool: Array, time: Array, still: Array) -> tuple[Array, Array]:
    """(n,) bool, inner rows at which the motion is not smooth: a sharp turn; a stop or a change of feed."""
    way = np.diff(tool, axis=0)
    rate = np.linalg.norm(way, axis=1) / np.diff(time)
    unit = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    sharp = (unit[1:] * unit[:-1]).sum(1) < SHARP
    change = np.abs(np.diff(rate)) > 0.05 * np.maximum(rate[1:], rate[:-1])
    return np.pad(sharp, 1), np.pad(change | still[1:-1], 1)


def first_moves(points: Array, first: Array) -> Array:
    """Direction in which each slider or joint first sets off in each run.

    Args:
        points: (n, p, k) mm or rad, p points on the way to each row, the last one that of the row.
        first: (r,) first row of each run.

    Returns:
        (r, k), +1 or -1; +1 where it never moves.
    """
    moves = np.ones((len(first), points.shape[2]))
    for number, (start, stop) in enumerate(zip(first, [*first[1:], len(points)], strict=True)):
        step = np.diff(
            np.concatenate([points[start, -1:], points[start + 1 : stop].reshape(-1, points.shape[2])]), axis=0
        )
        for leg in range(points.shape[2]):
            found = np.flatnonzero(np.abs(step[:, leg]) > 1e-6)
            if len(found):
                moves[number, leg] = np.sign(step[found[0], leg])
    return moves
