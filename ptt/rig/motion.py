"""Motion of sliders and joints between the rows of a run: their path, directions and speeds."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from ptt.rig.nominal import Array, Drawing, nominal_sliders

STANDSTILL = 1e-9  # mm, a slider or tool that moves less stands still
MOVES = 1e-6  # mm or rad, least travel that gives a first direction: commands are written to a nanometre
SHARP = 0.7  # cosine of the angle between two moves (45 degrees) below which the path has a corner
SAME_RATE = 0.05  # share by which the tool's speed may change between moves of one smooth motion
ROUNDED = 0.2  # s: a controller rounds off corners after moves that are shorter
TRANSIT = 16  # equal parts into which a straight move of the tool is divided
LEAD_IN = 1.0  # rad of travel before the first row of an arm's run: more than play or wind-up of any joint take
CLOSE = 1e-4  # share of a straight move over which its slope at an end, and its curvature at a turn, are taken


@dataclass(frozen=True)
class Path:
    """Commands in the order of travel, points between the rows included.

    Attributes:
        slider: (m, k) mm or rad, slider heights or joint values.
        row: (m,) int, the row whose move each point belongs to.
        last: (n,) int, the point at which each row is read.
    """

    slider: Array
    row: Array
    last: Array


def run_path(drawing: Drawing, tool: Array, command: Array, run: Array, *, straight: bool, lead_in: float) -> Path:
    """Path of the sliders through the rows.

    Each slider is led in to a run's first row: it arrives there in the direction in which it moves first afterwards.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm, commanded tool positions.
        command: (n, 3) mm, commanded slider heights.
        run: (n,) int, number of each row's run.
        straight: the tool moves straight between rows; otherwise each slider moves monotonically.
        lead_in: mm, how far each slider travels before a run's first row.

    Returns:
        The path.
    """
    first = np.flatnonzero(np.diff(run, prepend=run[0] - 1))
    rows = len(command)
    points = np.stack([command, command], axis=1)  # shape: (n, points, 3), the last one that of the row
    if straight:
        heights_at = _straight_move(drawing, tool, command)
        points = np.concatenate([heights_at(_inner_shares(heights_at, rows)), command[:, None]], axis=1)
    count = np.full(rows, points.shape[1] if straight else 1)
    count[first] = 2
    points[first, -2] = command[first] - lead_in * first_directions(points if straight else command[:, None], first)
    passed = np.arange(points.shape[1]) >= points.shape[1] - count[:, None]
    return Path(points[passed], np.repeat(np.arange(rows), count), np.cumsum(count) - 1)


def joint_path(q: Array, run: Array | None = None) -> Path:
    """Path of the joints of an arm through the rows, each led in to a run's first row like a slider.

    Args:
        q: (n, k) rad, commands in travel order; each joint moves monotonically between rows.
        run: (n,) int, number of each row's run; None for a single one.

    Returns:
        The path.
    """
    rows = np.arange(len(q))
    number = np.zeros(len(q), dtype=int) if run is None else run
    first = np.flatnonzero(np.diff(number, prepend=number[:1] - 1))
    before = q[first] - LEAD_IN * first_directions(q[:, None], first)
    last = rows + np.cumsum(np.isin(rows, first))
    return Path(np.insert(q, first, before, axis=0), np.insert(rows, first, first), last)


def _straight_move(drawing: Drawing, tool: Array, command: Array) -> Callable[[Array], Array]:
    """Sliders while the tool moves straight to each row: from shares of the move, (n, p), to heights, (n, p, 3) mm.

    What compensation adds to the nominal command changes linearly along the move.
    """
    extra = command - nominal_sliders(drawing, tool)
    start = np.maximum(np.arange(len(tool)) - 1, 0)

    def heights_at(share: Array) -> Array:
        between, more = (
            values[start, None] + share[:, :, None] * (values - values[start])[:, None] for values in (tool, extra)
        )
        return nominal_sliders(drawing, between.reshape(-1, 3)).reshape(between.shape) + more

    return heights_at


def _inner_shares(heights_at: Callable[[Array], Array], rows: int) -> Array:
    """Shares of each straight move, (n, p) in rising order: equal parts, and where each slider reverses.

    A height is convex or concave along a straight line, so it has one extremum at the most: at the vertex of the
    parabola through the extreme equal part and its neighbours, refined by three points close to that vertex.
    """
    even = np.tile(np.arange(TRANSIT + 1) / TRANSIT, (rows, 1))
    height = heights_at(even)  # shape: (n, TRANSIT + 1, 3)
    step = np.diff(height, axis=1)
    bend = np.diff(np.sign(step), axis=1) != 0.0
    nearer = np.where(np.abs(step[:, 0]) < np.abs(step[:, -1]), 1, TRANSIT - 1)
    at = np.where(bend.any(axis=1), 1 + np.argmax(bend, axis=1), nearer)  # shape: (n, 3)
    three = [np.take_along_axis(height, at[:, None] + beside, axis=1)[:, 0] for beside in (-1, 0, 1)]
    turn = np.clip((at + _vertex(*three)) / TRANSIT, CLOSE, 1.0 - CLOSE)
    three = [np.einsum("nll->nl", heights_at(turn + beside * CLOSE)) for beside in (-1, 0, 1)]
    turn = np.clip(turn + CLOSE * _vertex(*three), CLOSE, 1.0 - CLOSE)
    return np.sort(np.concatenate([even[:, 1:-1], turn], axis=1), axis=1)


def _vertex(before: Array, here: Array, after: Array) -> Array:
    """Vertex of the parabola through three equidistant values, in steps from the middle one, clipped to -1 ... 1."""
    bend = before - 2.0 * here + after
    return np.clip(np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend != 0.0), -1.0, 1.0)


def travel_direction(slider: Array) -> Array:
    """Direction of travel at each point of a path; standstill keeps the last one.

    Args:
        slider: (m, k) mm or rad.

    Returns:
        (m, k), +1 or -1; 0 before the first move.
    """
    step = np.diff(slider, axis=0, prepend=slider[:1])
    sign = np.where(np.abs(step) > STANDSTILL, np.sign(step), 0.0)
    at = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign))[:, None], 0), axis=0)
    return np.take_along_axis(sign, at, axis=0)


def end_slopes(drawing: Drawing, tool: Array, command: Array) -> tuple[Array, Array]:
    """Derivatives of slider heights at the start and the end of straight moves of the tool.

    Args:
        drawing: the ideal machine.
        tool: (n, 3) mm, commanded tool positions.
        command: (n, 3) mm, commanded slider heights.

    Returns:
        At the start and at the end of the move to each row, (n, 3) mm per whole move each; that to the first row of a
        run is without meaning.
    """
    share = np.tile([0.0, CLOSE, 1.0 - CLOSE, 1.0], (len(tool), 1))
    start, after, before, end = np.moveaxis(_straight_move(drawing, tool, command)(share), 1, 0)
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

    Between corners the motion is smooth: a cubic spline over time. At a corner, and where the feed changes, an axis has
    the speed at which it arrives; only at a sharp corner after a move so short that the controller rounds it off, the
    mean of the speeds before and after. A row that repeats the pose before it begins a new lap; each lap, like each
    run, is a motion of its own.

    Args:
        command: (n, 3) mm, commanded slider heights.
        tool: (n, 3) mm, commanded tool positions.
        time: (n,) s.
        still: (n,) bool, rows that are read at standstill.
        run: (n,) int, number of each row's run; None for a single one.
        ends: of `end_slopes`, for single straight moves between corners; None for sliders of constant speed there.

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
    """Inner rows at which the motion is not smooth, (n,) bool each: at a sharp corner; at a stop or change of feed."""
    way = np.diff(tool, axis=0)
    rate = np.linalg.norm(way, axis=1) / np.diff(time)
    unit = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    sharp = (unit[1:] * unit[:-1]).sum(1) < SHARP
    change = np.abs(np.diff(rate)) > SAME_RATE * np.maximum(rate[1:], rate[:-1])
    return np.pad(sharp, 1), np.pad(change | still[1:-1], 1)


def first_directions(points: Array, first: Array) -> Array:
    """Direction in which each slider or joint moves first in each run.

    Args:
        points: (n, p, k) mm or rad, p points of the move to each row, the last one that of the row.
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
            found = np.flatnonzero(np.abs(step[:, leg]) > MOVES)
            if len(found):
                moves[number, leg] = np.sign(step[found[0], leg])
    return moves
