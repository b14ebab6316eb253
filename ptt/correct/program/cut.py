"""A program's moves as places close together, and as few of them as keep the path.

Places are looked at so closely that what lies between is straight; after correction those are left out without which
the path stays within the tolerance.
"""

from dataclasses import dataclass

import numpy as np
import torch

from ptt.correct.program.moves import Move
from ptt.mechanisms.protocol import Mechanism

Array = np.ndarray

CLOSEST, PER_TURN = 1.0, 12  # mm between places that are looked at, and how many of them a turn of a screw gets
SAG = 0.125  # share of the tolerance that an arc may sag between places that are looked at
KEPT = 0.75  # share of the tolerance that is used up by leaving places out
TIE = 1e-7  # mm: nearer than that, places are equally far
STARTED = 0.25  # of the tolerance: a place this far behind a corner, so that play is taken up there and not on the way


@dataclass(frozen=True, eq=False)
class Places:
    """What is looked at, n places in the order of travel.

    Attributes:
        place: (n, 3) mm, in the base frame.
        share: (n,) of its move's way.
        move: (n,) int, the move each belongs to; a move's end is its last.
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


def look_along(
    moves: list[Move], frame: ProgramFrame, mechanism: Mechanism, tolerance: float, lead: float | None
) -> Places:
    """Lay places along every move: its start and end, evenly between, and where a slider turns.

    Args:
        moves: of the program.
        frame: where its coordinates lie.
        mechanism: the drawing.
        tolerance: mm.
        lead: of the screws, mm, where that is known.

    Returns:
        The places. Of a move from an unknown place only the end is looked at.
    """
    step = CLOSEST if lead is None else min(CLOSEST, lead / PER_TURN)
    shares = [_shares(move, step, tolerance) for move in moves]
    count = np.array([len(each) for each in shares], dtype=int)
    index, share = np.repeat(np.arange(len(moves)), count), np.concatenate([*shares, np.zeros(0)])
    points = [move.points(each) for move, each in zip(moves, shares, strict=True)]
    place = frame.into_base(np.concatenate([*points, np.zeros((0, 3))]))
    turns = _turns(place, index, share, mechanism)
    if len(turns):
        index, share, place = _with_turns(moves, frame, index, share, place, turns)
    feed = np.nan_to_num(np.array([move.feed for move in moves]))[index] if moves else np.zeros(0)
    return Places(place, share, index, feed)


def thin_out(path: Array, tolerance: float) -> Array:
    """Leave out what a straight line stands for.

    Source: Douglas and Peucker, The Canadian Cartographer 10, 1973.

    Args:
        path: (n, 3) mm.
        tolerance: mm, by which a place that is left out may lie beside the line.

    Returns:
        Indices of those that are kept, ascending; the first and the last are.
    """
    keep, open_ = {0, len(path) - 1}, [(0, len(path) - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        off = beside(path[first + 1 : last], path[first], path[last])
        worst = int(np.argmax(off >= off.max() - TIE))  # the first: rounding decides between none
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


def _turns(place: Array, index: Array, share: Array, mechanism: Mechanism) -> list[tuple[int, float]]:
    """Places in the middle of moves near which a slider turns: the row before, and the share of the way there."""
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


def _with_turns(
    moves: list[Move], frame: ProgramFrame, index: Array, share: Array, place: Array, turns: list[tuple[int, float]]
) -> tuple[Array, Array, Array]:
    rows = np.array([row for row, _ in turns])
    at = np.array([value for _, value in turns])
    more = np.concatenate([moves[index[row]].points(np.array([value])) for row, value in turns])
    order = np.lexsort((np.concatenate([share, at]), np.concatenate([index, index[rows]])))
    index, share = np.concatenate([index, index[rows]])[order], np.concatenate([share, at])[order]
    return index, share, np.concatenate([place, frame.into_base(more)])[order]


def beside(points: Array, begin: Array, end: Array) -> Array:
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
