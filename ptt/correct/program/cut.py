"""Sampling of a program's moves, and thinning of the corrected path to as few points as the tolerance allows.

Moves are sampled so densely that the corrected path between samples is straight.
"""

from dataclasses import dataclass

import numpy as np
import torch

from ptt.correct.program.moves import Move
from ptt.mechanisms.protocol import Mechanism

Array = np.ndarray

SAMPLING, PER_TURN = 1.0, 12  # mm between samples, and least samples per turn of a screw (periodic errors)
SAG = 0.125  # share of the tolerance that an arc may sag between samples
KEPT = 0.75  # share of the tolerance that thinning uses
TIE = 1e-7  # mm: distances that differ by less are equal
STARTED = 0.25  # of the tolerance: a sample this far behind a corner, so that backlash is taken up at the corner


@dataclass(frozen=True, eq=False)
class Places:
    """Samples of a program, n positions in travel order.

    Attributes:
        place: (n, 3) mm, in the base frame.
        share: (n,), travelled fraction of its move.
        move: (n,) int, the move each belongs to; a move's end is its last sample.
        feed: (n,) mm/s, 0 where the program says none.
    """

    place: Array
    share: Array
    move: Array
    feed: Array


@dataclass(frozen=True, eq=False)
class ProgramFrame:
    """Where a program's coordinates lie: base = turn @ program + origin.

    Attributes:
        turn: (3, 3).
        origin: (3,) mm.
    """

    turn: Array
    origin: Array

    def into_base(self, place: Array) -> Array:
        """(n, 3) mm in the program's coordinates -> in the base frame."""
        return np.asarray(place @ self.turn.T + self.origin)

    def from_base(self, place: Array) -> Array:
        """(n, 3) mm in the base frame -> in the program's coordinates."""
        return np.asarray((place - self.origin) @ self.turn)


def sample_moves(
    moves: list[Move], frame: ProgramFrame, mechanism: Mechanism, tolerance: float, lead: float | None
) -> Places:
    """Sample every move: just behind its start, evenly, at its end, and where a slider reverses.

    Args:
        moves: of the program.
        frame: where its coordinates lie.
        mechanism: the drawing.
        tolerance: mm.
        lead: of the screws, mm, where that is known.

    Returns:
        The samples; of a move from an unknown position only the end.
    """
    step = SAMPLING if lead is None else min(SAMPLING, lead / PER_TURN)
    shares = [_shares(move, step, tolerance) for move in moves]
    count = np.array([len(each) for each in shares], dtype=int)
    index, share = np.repeat(np.arange(len(moves)), count), np.concatenate([*shares, np.zeros(0)])
    points = [move.points(each) for move, each in zip(moves, shares, strict=True)]
    place = frame.into_base(np.concatenate([*points, np.zeros((0, 3))]))
    turns = _reversals(place, index, share, mechanism)
    if len(turns):
        index, share, place = _with_reversals(moves, frame, index, share, place, turns)
    feed = np.nan_to_num(np.array([move.feed for move in moves]))[index] if moves else np.zeros(0)
    return Places(place, share, index, feed)


def thin_out(path: Array, tolerance: float) -> Array:
    """Thin a path to the points that a polyline needs within a tolerance.

    Source: Douglas and Peucker, The Canadian Cartographer 10, 1973.

    Args:
        path: (n, 3) mm.
        tolerance: mm, largest distance of an omitted point from the line.

    Returns:
        Indices of the points kept, ascending, first and last included.
    """
    keep, open_ = {0, len(path) - 1}, [(0, len(path) - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        off = distance_from_segment(path[first + 1 : last], path[first], path[last])
        worst = int(np.argmax(off >= off.max() - TIE))  # the first of equals, so that rounding decides nothing
        if off[worst] > KEPT * tolerance:
            middle = first + 1 + worst
            keep.add(middle)
            open_ += [(first, middle), (middle, last)]
    return np.array(sorted(keep))


def _shares(move: Move, step: float, tolerance: float) -> Array:
    length = move.length
    if not move.begun or length == 0.0:
        return np.ones(1)
    if move.arc is not None:
        step = min(step, float(np.sqrt(8.0 * SAG * tolerance * max(move.arc.radius))))
    even = np.linspace(0.0, 1.0, max(int(np.ceil(length / step)), 1) + 1)[1:]
    start = STARTED * tolerance / length
    return np.concatenate([[start], even]) if start < 0.5 * even[0] else even


def _reversals(place: Array, index: Array, share: Array, mechanism: Mechanism) -> list[tuple[int, float]]:
    """Reversals of sliders within moves: row before, and fraction of the move by a parabola through 3 samples."""
    if len(place) < 3:
        return []
    q = mechanism.inverse(torch.as_tensor(place)).numpy()
    step = np.diff(q, axis=0)
    inner = (index[2:] == index[:-2]) & (share[1:-1] > share[:-2])
    found = []
    for row, joint in np.argwhere(inner[:, None] & (step[:-1] * step[1:] < 0.0)):
        left, right = share[row + 1] - share[row], share[row + 2] - share[row + 1]
        rise, fall = step[row, joint] / left, step[row + 1, joint] / right
        at = 0.5 * (share[row] + share[row + 1]) + 0.5 * (left + right) * rise / (rise - fall)
        found.append((int(row) if at < share[row + 1] else int(row) + 1, float(at)))
    return found


def _with_reversals(
    moves: list[Move], frame: ProgramFrame, index: Array, share: Array, place: Array, turns: list[tuple[int, float]]
) -> tuple[Array, Array, Array]:
    rows = np.array([row for row, _ in turns])
    at = np.array([value for _, value in turns])
    more = np.concatenate([moves[index[row]].points(np.array([value])) for row, value in turns])
    order = np.lexsort((np.concatenate([share, at]), np.concatenate([index, index[rows]])))
    index, share = np.concatenate([index, index[rows]])[order], np.concatenate([share, at])[order]
    return index, share, np.concatenate([place, frame.into_base(more)])[order]


def distance_from_segment(points: Array, begin: Array, end: Array) -> Array:
    """Distance of points from the stretch between two others.

    Args:
        points: (m, 3) mm.
        begin: (3,) mm.
        end: (3,) mm.

    Returns:
        (m,) mm.
    """
    way = end - begin
    square = float(way @ way)
    along = np.clip((points - begin) @ way / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - begin - along[:, None] * way, axis=1))
