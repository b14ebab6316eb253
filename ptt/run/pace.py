"""How fast the joints are at each row of a travel: linear in their values, once it is known where the motion is smooth.

Along smooth stretches the velocity is that of a cubic spline over time. At a corner an axis that lags still has that of
its arrival, since it cannot know where it goes next. A run's first row is left as the second is reached, and so is that
of a sweep which is entered anew after a pause, and that of a lap which begins where another ended. On a move of two
rows joints run evenly, or bend so that the tool runs straight.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ptt.mechanisms.least_move import least_move
from ptt.run.corners import arcs_of, begun_again, corners_of, driven_feed, entered_anew, shows_feed
from ptt.run.slopes import Ends, Shares, added, bend_of, short_stretches, splines

if TYPE_CHECKING:
    from ptt.run.table import Table

SMOOTH, MEAN, EVEN, STRAIGHT = PACES = (0, 1, 2, 3)  # what rows mean by the speed at which they are passed:
# that of a smooth way, or of the move to a corner; the parabola's through three rows, everywhere; that of the move to
# the row, everywhere, its joints running evenly; the same, its tool running straight
SLOW = 4.0  # lags: a row later an axis is 98 % of the way to its speed
ROUNDED = 0.2  # s: what follows a move this short is rounded off, the mean of both sides; ten lags of a usual drive
INSTANT = 1e-9  # s: rows that follow each other faster tell no speed


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
        total = added(self.straight, slope, len(q))
        if self.bend is not None:
            total += self.bend
        if len(self.owner):
            from scipy.linalg import solve_banded  # scipy.interpolate takes half a second to load

            slopes = solve_banded((1, 1), self.bands, added(self.right, slope, len(self.owner)))
            np.add.at(total, self.owner, self.part[:, None] * slopes)
        return total


def line_ends(jacobian: Tensor, q: Tensor, p: Tensor, rank: int) -> Ends:
    """How the joints set off and arrive where the tool runs straight from row to row.

    By the least change of an even motion of theirs that gives the tool its direction: all of it where joints have
    nothing to spare.

    Args:
        jacobian: dp/dq at each row, (n, 3, k).
        q: joint values, (n, k); rows out of reach are NaN.
        p: tool positions, (n, 3) mm.
        rank: number of directions in which the joints can move the tool at all (`translation_rank`).

    Returns:
        (n - 1, k) each, beyond those of the even motion and per move; zero at rows out of reach.
    """
    turned, moved = q.diff(dim=0)[:, :, None], p.diff(dim=0)
    begin, end = (
        least_move(jacobian[rows], moved - (jacobian[rows] @ turned)[:, :, 0], rank).nan_to_num(0.0, 0.0, 0.0).numpy()
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
    q: Tensor,
    p: Tensor,
    jacobian: Tensor,
    starts: np.ndarray,
    table: "Table",
    rank: int,
    *,
    straight: bool,
    smooth: bool,
) -> tuple[Tensor, Tensor | None]:  # fmt: skip
    """Velocity of the joints at each row, and what else the rows may mean by it.

    Args:
        q: joint values, (n, k) mm or rad.
        p: tool positions, (n, 3) mm.
        jacobian: dp/dq at each row, (n, 3, k).
        starts: first rows of runs, (n,) bool.
        table: the rows, with feed or time.
        rank: number of directions in which the joints can move the tool at all (`translation_rank`).
        straight: the tool runs straight between rows.
        smooth: it runs smoothly through rows without a corner.

    Returns:
        (n, k) mm/s or rad/s, zero where nothing tells; (n, k, 3) of the paces beside `SMOOTH`, None there.
    """
    if len(p) < 2 or not (shows_feed(table) or table.time_s is not None):
        return torch.zeros_like(q), None
    ends = line_ends(jacobian, q, p, rank)
    speeds = []
    for way in PACES:
        bent = ends if runs_straight(way, straight=straight) else None
        pace = pace_of(p.numpy(), starts, table, bent, way, smooth=smooth)
        speeds.append(torch.zeros_like(q) if pace is None else torch.as_tensor(pace.velocity(q.numpy())))
    return speeds[0], torch.stack(speeds[1:], dim=-1)


def pace_of(
    p: np.ndarray, starts: np.ndarray, table: "Table", ends: Ends | None = None, way: int = SMOOTH, lag: float = 0.0,
    *, smooth: bool = False,
) -> Pace | None:  # fmt: skip
    """Durations and smooth stretches of a travel.

    Args:
        p: tool positions, (n, 3) mm.
        starts: first rows of runs, (n,) bool.
        table: the rows, with feed or time.
        ends: how straight moves set off and arrive; None: joints run evenly.
        way: one of `PACES`.
        lag: of the slowest axis, s: between rows that follow each other in less than `SLOW` of it no axis comes up to
            a speed of its own, so the motion stays smooth there.
        smooth: the tool runs smoothly through rows that are no corners.

    Returns:
        The pace; None where nothing tells it.
    """
    if len(p) < 2:
        return None
    moved = np.diff(p, axis=0)
    length = np.linalg.norm(moved, axis=1)
    if shows_feed(table):
        feed, by_clock = driven_feed(length, starts, table)
        lasts = np.divide(length, feed[1:], out=np.zeros_like(length), where=feed[1:] > 0)
    elif table.time_s is not None:
        lasts, by_clock = np.diff(np.asarray(table.time_s, dtype=float)), np.ones(len(length), dtype=bool)
    else:
        return None
    sound = (lasts > INSTANT) & ~starts[1:]
    lasts = np.where(sound, lasts, np.inf)
    before, after = np.append(np.inf, lasts), np.append(lasts, np.inf)
    bends, changes = corners_of(moved, length, lasts, sound, smooth=smooth)
    entered = ~starts & begun_again(length, sound, table)
    if way in (SMOOTH, MEAN):
        entered |= entered_anew(lasts, bends, table)
    if entered.any():
        return pace_of(p, starts | entered, table, ends, way, lag, smooth=smooth)
    if way == SMOOTH:  # a feed is that along the way
        lasts = np.where(by_clock, lasts, lasts * arcs_of(moved, bends))
        before, after = np.append(np.inf, lasts), np.append(lasts, np.inf)
    # By the clock a speed changes on the way, while a feed is that of its row.
    changing = np.append(by_clock[:1], by_clock) & np.append(by_clock, by_clock[-1:])
    both = np.where(bends, before < ROUNDED, changing) & np.isfinite(after)
    leaving = np.where(starts, 1.0, np.where(both, 0.5, 0.0))
    if way != SMOOTH:
        alone = np.minimum(before, after) >= SLOW * lag
        inner = np.isfinite(before) & np.isfinite(after)
        share = np.divide(before, before + after, out=np.zeros_like(before), where=inner & (way == MEAN))
        leaving, bends = np.where(alone & ~starts, share, leaving), bends | alone
    corners = np.flatnonzero(bends | changes)
    wide = np.flatnonzero(np.diff(corners) > 2)
    edges = zip(corners[wide].tolist(), corners[wide + 1].tolist(), strict=True)
    stretches = [(a, b) for a, b in edges if sound[a:b].all()]
    bend = None if ends is None else bend_of(lasts, sound, corners, leaving, ends)
    return Pace(lasts, short_stretches(lasts, sound, corners, leaving), *splines(lasts, stretches, leaving), bend)
