"""How fast the joints are at each row of a travel: linear in their values, once it is known where the motion is smooth.

Along smooth stretches the velocity is that of a cubic spline over time. At a corner an axis that lags still has that of
its arrival, since it cannot know where it goes next. A run's first row is left as the second is reached, and so is that
of a sweep which is entered anew after a pause, and that of a lap which begins where another ended. On a move of two
rows joints run evenly, or bend so that the tool runs straight.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

if TYPE_CHECKING:
    from ptt.run.table import Table

SMOOTH, MEAN, EVEN, STRAIGHT = PACES = (0, 1, 2, 3)  # what rows mean by the speed at which they are passed:
# that of a smooth way, or of the move to a corner; the parabola's through three rows, everywhere; that of the move to
# the row, everywhere, its joints running evenly; the same, its tool running straight
SLOW = 4.0  # lags: a row later an axis is 98 % of the way to its speed
TURN = 0.8  # cosine of the turn of the tool's way at a row, below which the row is a corner
SAME_SPEED = 0.05  # change of speed, as a share, beyond which a row is a corner
PAUSE = 10.0  # times the usual move, and what most moves take beyond their feed: nobody waits that long on the way
ROUNDED = 0.2  # s: what follows a move this short is rounded off, the mean of both sides; ten lags of a usual drive
INSTANT = 1e-9  # s: rows that follow each other faster tell no speed
REPEATED = 1e-9  # mm: a pose that is told twice

Shares = tuple[np.ndarray, np.ndarray, np.ndarray]  # place in a sum, interval between two rows, its weight
Ends = tuple[np.ndarray, np.ndarray]  # how a move sets off and arrives: beyond that of an even one, per move


@dataclass(frozen=True)
class Pace:
    """Durations of a travel of n rows, and the stretches between its corners.

    Attributes:
        lasts: from row to row, (n - 1,) s; infinite where nothing tells.
        straight: what intervals' slopes add to rows, in stretches of two or three rows.
        bands: system of the slopes of all splines, (3, m).
        owner: whose rows these slopes are, (m,) int.
        part: what these slopes are of their rows' velocities, (m,).
        right: what intervals' slopes add to the right-hand side of that system.
        bend: (n, k) mm/s or rad/s on top, where joints bend so that the tool runs straight; None: they run evenly.
    """

    lasts: np.ndarray
    straight: Shares
    bands: np.ndarray
    owner: np.ndarray
    part: np.ndarray
    right: Shares
    bend: np.ndarray | None = None

    def velocity(self, q: np.ndarray) -> np.ndarray:
        """Velocity at each row.

        Args:
            q: joint values, (n, k) mm or rad.

        Returns:
            (n, k) mm/s or rad/s, zero where nothing tells.
        """
        slope = np.diff(q, axis=0) / self.lasts[:, None]
        total = _added(self.straight, slope, len(q))
        if self.bend is not None:
            total += self.bend
        if len(self.owner):
            from scipy.linalg import solve_banded  # scipy.interpolate takes half a second to load

            slopes = solve_banded((1, 1), self.bands, _added(self.right, slope, len(self.owner)))
            np.add.at(total, self.owner, self.part[:, None] * slopes)
        return total


def shows_feed(table: "Table") -> bool:
    """Whether the feed tells speeds."""
    return table.feed_mm_s is not None and bool(np.nan_to_num(table.feed_mm_s).max() > 0.0)


def line_ends(jacobian: Tensor, q: Tensor, p: Tensor) -> Ends:
    """How the joints set off and arrive where the tool runs straight from row to row.

    By the least change of an even motion of theirs that gives the tool its direction: all of it where joints have
    nothing to spare.

    Args:
        jacobian: dp/dq at each row, (n, 3, k).
        q: joint values, (n, k); rows out of reach are NaN.
        p: tool positions, (n, 3) mm.

    Returns:
        (n - 1, k) each, beyond those of the even motion and per move; zero at rows out of reach.
    """
    across, _ = torch.linalg.inv_ex(jacobian @ jacobian.mT)
    inverse = jacobian.mT @ across
    turned, moved = q.diff(dim=0)[:, :, None], p.diff(dim=0)[:, :, None]
    begin, end = (
        (inverse[rows] @ (moved - jacobian[rows] @ turned))[:, :, 0].nan_to_num(0.0, 0.0, 0.0).numpy()
        for rows in (slice(None, -1), slice(1, None))
    )
    return begin, end


def runs_straight(way: int, *, straight: bool) -> bool:
    """Whether the speed that rows mean is that of a tool that runs straight.

    Args:
        way: one of `PACES`.
        straight: the tool runs straight between rows.
    """
    return way == STRAIGHT or (straight and way == SMOOTH)


def joint_speeds(
    q: Tensor, p: Tensor, jacobian: Tensor, starts: np.ndarray, table: "Table", *, straight: bool
) -> tuple[Tensor, Tensor | None]:
    """Velocity of the joints at each row, and what else the rows may mean by it.

    Args:
        q: joint values, (n, k) mm or rad.
        p: tool positions, (n, 3) mm.
        jacobian: dp/dq at each row, (n, 3, k).
        starts: first rows of runs, (n,) bool.
        table: the rows, with feed or time.
        straight: the tool runs straight between rows.

    Returns:
        (n, k) mm/s or rad/s, zero where nothing tells; (n, k, 3) of the paces beside `SMOOTH`, None there.
    """
    if len(p) < 2 or not (shows_feed(table) or table.time_s is not None):
        return torch.zeros_like(q), None
    ends = line_ends(jacobian, q, p)
    speeds = []
    for way in PACES:
        pace = pace_of(p.numpy(), starts, table, ends if runs_straight(way, straight=straight) else None, way)
        speeds.append(torch.zeros_like(q) if pace is None else torch.as_tensor(pace.velocity(q.numpy())))
    return speeds[0], torch.stack(speeds[1:], dim=-1)


def pace_of(
    p: np.ndarray, starts: np.ndarray, table: "Table", ends: Ends | None = None, way: int = SMOOTH, lag: float = 0.0
) -> Pace | None:
    """Durations and smooth stretches of a travel.

    Args:
        p: tool positions, (n, 3) mm.
        starts: first rows of runs, (n,) bool.
        table: the rows, with feed or time.
        ends: how straight moves set off and arrive; None: joints run evenly.
        way: one of `PACES`.
        lag: of the slowest axis, s: between rows that follow each other in less than `SLOW` of it no axis comes up to
            a speed of its own, so the motion stays smooth there.

    Returns:
        The pace; None where nothing tells it.
    """
    if len(p) < 2:
        return None
    moved = np.diff(p, axis=0)
    length = np.linalg.norm(moved, axis=1)
    if shows_feed(table):
        feed = np.asarray(table.feed_mm_s, dtype=float)[1:]
        lasts = np.divide(length, feed, out=np.zeros_like(length), where=feed > 0)
    elif table.time_s is not None:
        lasts = np.diff(np.asarray(table.time_s, dtype=float))
    else:
        return None
    sound = (lasts > INSTANT) & ~starts[1:]
    lasts = np.where(sound, lasts, np.inf)
    before, after = np.append(np.inf, lasts), np.append(lasts, np.inf)
    bends, changes = _corners(moved, length, lasts, sound)
    entered = ~starts & _begun_again(length, sound, table)
    if way in (SMOOTH, MEAN):
        entered |= _entered(lasts, bends, table)
    if entered.any():
        return pace_of(p, starts | entered, table, ends, way, lag)
    changing = not shows_feed(table)  # by the clock a speed changes on the way, while a feed is that of its row
    both = np.where(bends, before < ROUNDED, changing) & np.isfinite(after)
    leaving = np.where(starts, 1.0, np.where(both, 0.5, 0.0))
    if way != SMOOTH:
        alone = np.minimum(before, after) >= SLOW * lag
        inner = np.isfinite(before) & np.isfinite(after)
        share = np.divide(before, before + after, out=np.zeros_like(before), where=inner & (way == MEAN))
        leaving, bends = np.where(alone & ~starts, share, leaving), bends | alone
    corners = np.flatnonzero(bends | changes)
    splines = [(a, b) for a, b in pairwise(corners.tolist()) if b - a > 2 and sound[a:b].all()]
    bend = None if ends is None else _bend(lasts, sound, corners, leaving, ends)
    return Pace(lasts, _straight(lasts, sound, corners, leaving), *_splines(lasts, splines, leaving), bend)


def _entered(lasts: np.ndarray, bends: np.ndarray, table: "Table") -> np.ndarray:
    """Rows at which a sweep begins anew though the table names no run, (n,).

    By the clock there was time for more than the move to such a row, and the way would turn sharply there only to run
    smoothly on: the tool came by a run-up that is not in the table, as a circle is entered when it is read on the move.

    Args:
        lasts: from row to row by the feed, (n - 1,) s; infinite where nothing tells.
        bends: (n,) whether the tool turns sharply at a row.
        table: the rows.
    """
    none = np.zeros_like(bends)
    known = np.isfinite(lasts)
    if table.time_s is None or not shows_feed(table) or not known.any():
        return none
    waited = np.diff(np.asarray(table.time_s, dtype=float)) - lasts
    usual = max(float(np.median(lasts[known])), float(np.quantile(np.abs(waited[known]), 0.9)))
    paused = known & (np.nan_to_num(waited, nan=0.0, neginf=0.0) > PAUSE * usual)
    none[1:-1] = paused[:-1] & bends[1:-1] & ~bends[2:]
    return none


def _begun_again(length: np.ndarray, sound: np.ndarray, table: "Table") -> np.ndarray:
    """Rows at which the last pose of a lap is told once more as the first of the next, (n,).

    Hardly any time passes, so the machine does not stand there.

    Args:
        length: of the tool's way from row to row, (n - 1,) mm.
        sound: whether a move tells a speed, (n - 1,) bool.
        table: the rows.
    """
    begun = np.zeros(len(length) + 1, dtype=bool)
    if table.time_s is None or not sound.any():
        return begun
    step = np.diff(np.asarray(table.time_s, dtype=float))
    at_once = (length < REPEATED) & (PAUSE * step < np.median(step[sound]))
    begun[1:-1] = at_once[:-1] & sound[1:]
    return begun


def _spline(step: np.ndarray) -> tuple[np.ndarray, Shares]:
    """System of a spline's slopes over intervals of length step (n - 1,).

    Source: C. de Boor, A Practical Guide to Splines, 1978, chapter IV.
    """
    rows = len(step) + 1
    first, last = step[0] + step[1], step[-1] + step[-2]
    bands, before, after = np.zeros((3, rows)), np.empty(rows), np.empty(rows)
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = step[:-1], 2.0 * (step[:-1] + step[1:]), step[1:]
    bands[1, 0], bands[0, 1], bands[1, -1], bands[2, -2] = step[1], first, step[-2], last
    before[1:-1], after[1:-1] = 3.0 * step[1:], 3.0 * step[:-1]
    before[0], after[0] = (step[0] + 2.0 * first) * step[1] / first, step[0] ** 2 / first
    before[-1], after[-1] = step[-1] ** 2 / last, (2.0 * last + step[-1]) * step[-2] / last
    row = np.arange(rows)
    interval = np.clip(row - 1, 0, rows - 3)
    return bands, (np.tile(row, 2), np.concatenate([interval, interval + 1]), np.concatenate([before, after]))


def _splines(
    lasts: np.ndarray, stretches: list[tuple[int, int]], leaving: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Shares]:
    """One system for the splines of all stretches; whose rows the slopes are, and what they are of their velocities.

    Args:
        lasts: from row to row, (n - 1,) s.
        stretches: first and last row of each.
        leaving: what the stretch that begins at a row tells of its velocity, (n,); what it ends tells the rest.
    """
    bands, owner, part, shares, place = [np.zeros((3, 0))], [np.zeros(0, dtype=int)], [np.zeros(0)], [_none()], 0
    for first, last in stretches:
        band, (row, interval, weight) = _spline(lasts[first:last])
        bands.append(band)
        owner.append(np.arange(first, last + 1))
        part.append(np.concatenate([leaving[[first]], np.ones(last - first - 1), 1.0 - leaving[[last]]]))
        shares.append((row + place, interval + first, weight))
        place += last + 1 - first
    return np.concatenate(bands, axis=1), np.concatenate(owner), np.concatenate(part), _joined(shares)


def _straight(lasts: np.ndarray, sound: np.ndarray, ends: np.ndarray, leaving: np.ndarray) -> Shares:
    """What intervals add to the rows of stretches of two or three rows."""
    first, size = ends[:-1], np.diff(ends)
    single = first[(size == 1) & sound[first]]
    double = first[size == 2]
    double = double[sound[double] & sound[double + 1]]
    before = lasts[double] / (lasts[double] + lasts[double + 1])  # a parabola through the three
    begun, left = np.concatenate([single, double]), np.concatenate([single + 1, double + 2])
    return _joined(
        [
            (begun, begun, leaving[begun]),
            (left, left - 1, 1.0 - leaving[left]),
            (double + 1, double, 1.0 - before),
            (double + 1, double + 1, before),
        ]
    )


def _bend(lasts: np.ndarray, sound: np.ndarray, corners: np.ndarray, leaving: np.ndarray, ends: Ends) -> np.ndarray:
    """What straight moves from corner to corner add to velocities, (n, k)."""
    move = corners[:-1][(np.diff(corners) == 1) & sound[corners[:-1]]]
    begin, end = (part[move] / lasts[move, None] for part in ends)
    total = np.zeros((len(lasts) + 1, begin.shape[1]))
    total[move] += leaving[move, None] * begin
    total[move + 1] += (1.0 - leaving[move + 1])[:, None] * end
    return total


def _none() -> Shares:
    return np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0)


def _joined(shares: list[Shares]) -> Shares:
    row, interval, weight = (np.concatenate(parts) for parts in zip(*shares, strict=True))
    return row, interval, weight


def _added(shares: Shares, slope: np.ndarray, rows: int) -> np.ndarray:
    """Sums of weighted slopes (n - 1, k), (rows, k)."""
    row, interval, weight = shares
    total = np.zeros((rows, slope.shape[1]))
    np.add.at(total, row, weight[:, None] * slope[interval])
    return total


def _corners(
    moved: np.ndarray, length: np.ndarray, lasts: np.ndarray, sound: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows at which the tool turns sharply or stands, and the first and last; rows at which its speed changes."""
    rate = length / lasts
    unit = moved / np.maximum(length, 1e-9)[:, None]
    bend = np.einsum("nc,nc->n", unit[1:], unit[:-1]) < TURN
    change = np.abs(np.diff(rate)) > SAME_SPEED * np.maximum(rate[1:], rate[:-1])
    ends = np.array([True])
    return np.concatenate([ends, bend | ~sound[1:] | ~sound[:-1], ends]), np.concatenate([~ends, change, ~ends])
