"""The turns of the travel that an axis still remembers: what one chunk of a run hands on to the next."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

REACH = 1000.0  # mm: travel after which a gradual reversal has forgotten what was before (31 of its longest trials)
REACH_RAD = 10.0


@dataclass(frozen=True)
class Entry:
    """How the joints came to a row, so that whatever has a memory can be carried on from there.

    Play remembers the extremes of the travel that no later move went beyond (wiping out: Visintin, Differential
    Models of Hysteresis, 1994, III.2), whatever its gap; a gradual reversal remembers the latest turns. Both together
    are a short list of waypoints that leaves either in the state that the whole travel left it in.

    Attributes:
        row: the row that comes next.
        way: joint values of the waypoints, oldest first, (m, k); short lists begin with their first value repeated.
        direction: direction in which the first of them was arrived at, (k,), +1 or -1.
    """

    row: int
    way: Tensor
    direction: Tensor


def remember(way: Tensor, direction: Tensor, row: int, reach: float = REACH) -> Entry:
    """Shorten a way to what is still remembered at its end.

    Args:
        way: waypoints of one run since its start, or since a way that was shortened before, (m, k) mm or rad.
        direction: direction in which the first was arrived at, (k,).
        row: the row that comes next.
        reach: travel beyond which only extremes are remembered.

    Returns:
        The entry of that row.
    """
    short = [_shorten(column, float(sign), reach) for column, sign in zip(way.numpy().T, direction, strict=True)]
    length = max(len(column) for column, _ in short)
    padded = [np.concatenate([np.full(length - len(column), column[0]), column]) for column, _ in short]
    return Entry(row, torch.as_tensor(np.column_stack(padded)), torch.tensor([sign for _, sign in short]))


def _shorten(way: np.ndarray, direction: float, reach: float) -> tuple[np.ndarray, float]:
    step = np.diff(way)
    way, step = way[np.concatenate([[True], step != 0.0])], step[step != 0.0]
    turns = np.flatnonzero(np.concatenate([[True], np.sign(step[1:]) != np.sign(step[:-1]), [True]]))
    way = way[turns] if len(step) else way
    left = np.concatenate([np.cumsum(np.abs(np.diff(way))[::-1])[::-1], [0.0]])
    recent = int(np.argmax(left <= reach))
    older = _extremes(way[: recent + 1], direction)
    return np.concatenate([older, way[recent + 1 :]]), direction


def _extremes(way: np.ndarray, direction: float) -> np.ndarray:
    """The extremes that play remembers: the largest of all, the smallest since, the largest since that, to the end.

    What was there before the first waypoint counts as infinitely far behind it, so the first is never outdone.
    """
    kept, start, sign = [], 0, direction
    while start < len(way):
        rest = sign * way[start:]
        start += len(rest) - int(np.argmax(rest[::-1]))
        kept.append(way[start - 1])
        sign = -sign
    return np.array(kept)
