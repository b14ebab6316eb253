"""Travel: from which side each joint arrives, where it turned on the way, and how fast it was."""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ptt.mechanisms.protocol import Mechanism
from ptt.run.backlash.reversal import STANDSTILL, hold_direction

if TYPE_CHECKING:
    from ptt.run.table import Table

OVERTRAVEL = 1.0  # mm or rad: how far past a pose an arrival that the table states, but the rows do not show, began
SMOOTH = 0.8  # cosine of the turn of the tool's way at a row, below which the row is a corner
SAME_SPEED = 0.05  # change of speed, as a share, beyond which a row is a corner
TRANSIT_STEPS = 12  # points along a straight tool move at which the joints are looked at


@dataclass(frozen=True)
class Travel:
    """How the joints got to each row.

    Attributes:
        direction: (n, k), +1 or -1; standstill keeps the last one, a run's first row arrives as the second moves.
        turning: (n, k) joint value at the last turn on the way from the row before; the row's own value if none.
        velocity: (n, k) mm/s or rad/s at the row, zero where nothing tells.
        starts: (n,) bool, the first row of each run.
    """

    direction: Tensor
    turning: Tensor
    velocity: Tensor
    starts: Tensor

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.direction.shape[1]


def read_travel(mechanism: Mechanism, q: Tensor, p: Tensor, table: "Table", *, straight: bool) -> Travel:
    """Read the travel from the order of the rows.

    Base reflectors are fixed to the base, so the machine stands still while they are read.

    Args:
        mechanism: the nominal mechanism.
        q: joint commands, (n, k).
        p: nominal tool positions, (n, 3) mm.
        table: n rows in travel order.
        straight: the tool runs straight between rows, so a joint may turn on the way.

    Returns:
        The travel.
    """
    starts = run_starts(table.run)
    turning = _turnings(mechanism, q, p, starts) if straight else q.numpy().copy()
    stated = table.direction
    if stated is not None:
        known = np.isfinite(stated) & (stated != 0)
        moved = np.diff(q.numpy(), axis=0, prepend=q.numpy()[:1])
        against = known & (np.sign(np.where(starts[:, None], 0.0, moved)) != stated)
        turning = np.where(against, q.numpy() - np.nan_to_num(stated) * OVERTRAVEL, turning)
    direction = arrival_direction(q.numpy(), turning, starts)
    if stated is not None:
        direction = np.where(known, stated, direction)
    return Travel(
        torch.as_tensor(direction),
        torch.as_tensor(turning),
        torch.as_tensor(_velocity(q.numpy(), p.numpy(), starts, table)),
        torch.as_tensor(starts),
    )


def run_starts(run: np.ndarray) -> np.ndarray:
    """Mark the first row of each run.

    Args:
        run: (n,) run codes in travel order.

    Returns:
        (n,) bool.
    """
    return np.concatenate([[True], run[1:] != run[:-1]]) if len(run) else np.zeros(0, dtype=bool)


def arrival_direction(q: np.ndarray, turning: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Direction in which each joint arrives at each row.

    Args:
        q: joint values, (n, k).
        turning: value at the last turn on the way, (n, k); equal to q where there is none.
        starts: (n,) bool, first rows of runs.

    Returns:
        (n, k), +1 or -1. Standstill keeps the last direction; a run's first row arrives as the next one moves;
        a joint that never moves in a run counts as +1.
    """
    turned = np.abs(q - turning) > STANDSTILL
    step = np.where(turned, q - turning, np.diff(q, axis=0, prepend=q[:1]))
    step[starts & ~turned.any(axis=1)] = 0.0
    return hold_direction(np.where(np.abs(step) > STANDSTILL, step, 0.0), starts).astype(float)


def _turnings(mechanism: Mechanism, q: Tensor, p: Tensor, starts: np.ndarray) -> np.ndarray:
    """Where each joint turned last while the tool ran straight from the row before."""
    part = torch.linspace(0.0, 1.0, TRANSIT_STEPS + 1, dtype=torch.float64)[1:-1]
    before = torch.cat([p[:1], p[:-1]])
    way = before[:, None, :] + part[None, :, None] * (p - before)[:, None, :]  # shape: (n, s, 3)
    inner = mechanism.inverse(way.reshape(-1, 3)).reshape(len(p), len(part), -1)
    joints = torch.cat([torch.cat([q[:1], q[:-1]])[:, None], inner, q[:, None]], dim=1).numpy()  # shape: (n, s + 2, k)
    step = np.diff(joints, axis=1)
    final = np.sign(step[:, -1])[:, None]
    against = (np.sign(step) != final) & (np.abs(step) > STANDSTILL)  # moves other than the arrival's
    last = step.shape[1] - 1 - np.argmax(against[:, ::-1], axis=1)  # shape: (n, k)
    turned = against.any(axis=1) & ~starts[:, None]
    value = np.take_along_axis(joints, last[:, None] + 1, axis=1)[:, 0]
    return np.where(turned & np.isfinite(value), value, q.numpy())


def _velocity(q: np.ndarray, p: np.ndarray, starts: np.ndarray, table: "Table") -> np.ndarray:
    """Velocity at each row: along smooth stretches that of a cubic spline, at corners the mean of both sides."""
    if len(q) < 2:
        return np.zeros_like(q)
    moved = np.diff(p, axis=0)
    length = np.linalg.norm(moved, axis=1)
    if table.feed_mm_s is not None and np.nanmax(table.feed_mm_s) > 0:
        feed = np.asarray(table.feed_mm_s, dtype=float)[1:]
        lasts = np.divide(length, feed, out=np.zeros_like(length), where=feed > 0)
    elif table.time_s is not None:
        lasts = np.diff(np.asarray(table.time_s, dtype=float))
    else:
        return np.zeros_like(q)
    sound = (lasts > 1e-9) & ~starts[1:]
    ends = np.flatnonzero(_corners(moved, length, lasts, sound))
    total, sides = _straight_stretches(q, lasts, sound, ends)
    for first, last in pairwise(ends):
        if last - first > 2 and sound[first:last].all():
            clock = np.concatenate([[0.0], np.cumsum(lasts[first:last])])
            total[first : last + 1] += spline_slopes(clock, q[first : last + 1])
            sides[first : last + 1] += 1
    return total / np.maximum(sides, 1.0)[:, None]


def spline_slopes(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes at its points of the cubic spline without knots at the second and the last but one.

    By hand, because scipy.interpolate takes half a second to load.

    Source: C. de Boor, A Practical Guide to Splines, 1978, chapter IV.

    Args:
        at: (n,) ascending, n of at least 4.
        values: (n, k).

    Returns:
        (n, k).
    """
    from scipy.linalg import solve_banded

    step = np.diff(at)
    rise = np.diff(values, axis=0) / step[:, None]
    first, last = at[2] - at[0], at[-1] - at[-3]
    bands, right = np.zeros((3, len(at))), np.empty_like(values, dtype=float)
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = step[:-1], 2.0 * (step[:-1] + step[1:]), step[1:]
    right[1:-1] = 3.0 * (step[1:, None] * rise[:-1] + step[:-1, None] * rise[1:])
    bands[1, 0], bands[0, 1], bands[1, -1], bands[2, -2] = step[1], first, step[-2], last
    right[0] = ((step[0] + 2.0 * first) * step[1] * rise[0] + step[0] ** 2 * rise[1]) / first
    right[-1] = (step[-1] ** 2 * rise[-2] + (2.0 * last + step[-1]) * step[-2] * rise[-1]) / last
    return np.asarray(solve_banded((1, 1), bands, right))


def _straight_stretches(
    q: np.ndarray, lasts: np.ndarray, sound: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities summed over the stretches of two or three rows that each row belongs to, (n, k), and their number."""
    total, sides = np.zeros_like(q), np.zeros(len(q))
    slope = np.diff(q, axis=0) / np.where(sound, lasts, np.inf)[:, None]
    first, size = ends[:-1], np.diff(ends)
    single = first[(size == 1) & sound[first]]
    double = first[size == 2]
    double = double[sound[double] & sound[double + 1]]
    before, after = lasts[double, None], lasts[double + 1, None]
    middle = (after * slope[double] + before * slope[double + 1]) / (before + after)  # a parabola through the three
    for rows, value in (
        (single, slope[single]),
        (single + 1, slope[single]),
        (double, slope[double]),
        (double + 1, middle),
        (double + 2, slope[double + 1]),
    ):
        total[rows] += value
        sides[rows] += 1
    return total, sides


def _corners(moved: np.ndarray, length: np.ndarray, lasts: np.ndarray, sound: np.ndarray) -> np.ndarray:
    """Rows at which the tool turns sharply, changes its speed or stands, (n,) bool; the first and last row are."""
    rate = length / np.where(sound, lasts, np.inf)
    unit = moved / np.maximum(length, 1e-9)[:, None]
    bend = np.einsum("nc,nc->n", unit[1:], unit[:-1]) < SMOOTH
    change = np.abs(np.diff(rate)) > SAME_SPEED * np.maximum(rate[1:], rate[:-1])
    return np.concatenate([[True], bend | change | ~sound[1:] | ~sound[:-1], [True]])
