"""Velocity of the joints at each row of a travel: linear in their values once durations and corners are known.

Along smooth stretches it is that of a cubic spline over time. At a corner it is that of the arrival, because an axis
that lags cannot know where it goes next. The first row of a run has the velocity of the move to the second; so have, on
a way through rows, that of a sweep that is entered anew after a pause and that of a lap that begins where another
ended. The move to a row that repeats the one before has none. On a single move between corners the velocity is
constant, or varies so that the tool runs straight.
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

# Definitions of the velocity at a row. SMOOTH: of a smooth path, at a corner of the move to it. MEAN: of the parabola
# through three rows, everywhere. EVEN: of the move to the row, joint velocities constant. STRAIGHT: of the move to the
# row, the tool running straight.
SMOOTH, MEAN, EVEN, STRAIGHT = PACES = (0, 1, 2, 3)
SLOW = 4.0  # lags: after a move of that duration an axis has 98 % of its speed
ROUNDED = 0.2  # s: the corner behind a shorter move is rounded off (mean of both sides); ten lags of a usual drive
INSTANT = 1e-9  # s: no speed follows from rows closer in time


@dataclass(frozen=True)
class Pace:
    """The linear map from joint values to velocities of a travel of n rows.

    The slope of an interval is the difference of joint values over its duration. Velocities are weighted sums of slopes
    in stretches of two or three rows between corners, and spline slopes, from a tridiagonal system, in longer ones.

    Attributes:
        lasts: duration of each interval from row to row, (n - 1,) s; infinite where it is not known.
        straight: weights of the slopes in the velocities of rows in stretches of two or three rows.
        bands: tridiagonal matrix of the spline slopes of all longer stretches, as of `solve_banded`, (3, m).
        owner: row that each spline slope belongs to, (m,) int.
        part: weight of each spline slope in the velocity of its row, (m,).
        right: weights of the intervals' slopes in the right-hand side of that system.
        bend: added to the velocities, (n, k) mm/s or rad/s, where the tool runs straight; None: joints run evenly.
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
            (n, k) mm/s or rad/s, zero where it is not known.
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
    """Joint velocities at both ends of straight tool moves, less those of even joint motion.

    They are the least-norm change of the even motion that gives the tool its direction.

    Args:
        jacobian: dp/dq at each row, (n, 3, k).
        q: joint values, (n, k); rows out of reach are NaN.
        p: tool positions, (n, 3) mm.
        rank: number of directions in which the joints can move the tool at all (`translation_rank`).

    Returns:
        At the beginning and at the end of each move, (n - 1, k) mm or rad per duration of the move; zero where a row is
        out of reach.
    """
    turned, moved = q.diff(dim=0)[:, :, None], p.diff(dim=0)
    begin, end = (
        least_move(jacobian[rows], moved - (jacobian[rows] @ turned)[:, :, 0], rank).nan_to_num(0.0, 0.0, 0.0).numpy()
        for rows in (slice(None, -1), slice(1, None))
    )
    return begin, end


def runs_straight(kind: int, *, straight: bool) -> bool:
    """Whether a definition of velocity has the tool run straight.

    Args:
        kind: one of `PACES`.
        straight: the tool runs straight between rows.
    """
    return kind == STRAIGHT or (straight and kind == SMOOTH)


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
    """Velocity of the joints at each row, by every definition of it.

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
        By `SMOOTH`, (n, k) mm/s or rad/s, zero where it is not known; by the other `PACES`, (n, k, 3), None where no
        speed is known.
    """
    if len(p) < 2 or not (shows_feed(table) or table.time_s is not None):
        return torch.zeros_like(q), None
    ends = line_ends(jacobian, q, p, rank)
    speeds = []
    for kind in PACES:
        bent = ends if runs_straight(kind, straight=straight) else None
        pace = pace_of(p.numpy(), starts, table, bent, kind, smooth=smooth)
        speeds.append(torch.zeros_like(q) if pace is None else torch.as_tensor(pace.velocity(q.numpy())))
    return speeds[0], torch.stack(speeds[1:], dim=-1)


def pace_of(
    p: np.ndarray, starts: np.ndarray, table: "Table", ends: Ends | None = None, kind: int = SMOOTH, lag: float = 0.0,
    *, smooth: bool = False,
) -> Pace | None:  # fmt: skip
    """Durations, corners and splines of a travel.

    Args:
        p: tool positions, (n, 3) mm.
        starts: first rows of runs, (n,) bool.
        table: the rows, with feed or time.
        ends: of straight moves, by `line_ends`; None: joints run evenly.
        kind: one of `PACES`.
        lag: of the slowest axis, s: between rows closer in time than `SLOW` lags no axis reaches the speed of a single
            move, so the motion counts as smooth there.
        smooth: the tool follows a smooth path through rows that are no corners.

    Returns:
        The pace; None where neither feed nor time is known.
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
    # Of the move to a row that repeats the one before there is no speed; on a way through rows a lap begins there.
    if kind in (SMOOTH, MEAN):
        entered = (~starts & begun_again(length, sound, table)) | entered_anew(lasts, bends, table)
        if entered.any():
            return pace_of(p, starts | entered, table, ends, kind, lag, smooth=smooth)
    if kind == SMOOTH:  # the feed is along the arc, not along its chord
        lasts = np.where(by_clock, lasts, lasts * arcs_of(moved, bends))
        before, after = np.append(np.inf, lasts), np.append(lasts, np.inf)
    # By the clock the speed varies between rows; by the feed it is constant up to its row.
    changing = np.append(by_clock[:1], by_clock) & np.append(by_clock, by_clock[-1:])
    both = np.where(bends, before < ROUNDED, changing) & np.isfinite(after)
    leaving = np.where(starts, 1.0, np.where(both, 0.5, 0.0))
    if kind != SMOOTH:
        alone = np.minimum(before, after) >= SLOW * lag
        inner = np.isfinite(before) & np.isfinite(after)
        share = np.divide(before, before + after, out=np.zeros_like(before), where=inner & (kind == MEAN))
        leaving, bends = np.where(alone & ~starts, share, leaving), bends | alone
    corners = np.flatnonzero(bends | changes)
    wide = np.flatnonzero(np.diff(corners) > 2)
    edges = zip(corners[wide].tolist(), corners[wide + 1].tolist(), strict=True)
    stretches = [(a, b) for a, b in edges if sound[a:b].all()]
    bend = None if ends is None else bend_of(lasts, sound, corners, leaving, ends)
    return Pace(lasts, short_stretches(lasts, sound, corners, leaving), *splines(lasts, stretches, leaving), bend)
