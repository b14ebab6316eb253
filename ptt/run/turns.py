"""Memory of hysteresis: the waypoints of a joint's travel that one chunk of a run passes on to the next."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

REACH = 1000.0  # mm of travel after which Dahl friction has forgotten all before: 31 times the longest length tried
REACH_RAD = 10.0  # the same for joint angles, rad


@dataclass(frozen=True)
class Entry:
    """Waypoints before a row that bring every hysteresis effect into the same state as the whole travel.

    Play of any gap remembers those extremes of the travel that no later move went beyond (wiping-out property:
    Visintin, Differential Models of Hysteresis, 1994, III.2); Dahl friction remembers the latest turning points. Both
    together are a short list.

    Attributes:
        way: joint values of the waypoints, oldest first, (m, k); a joint with fewer of them repeats its first.
        direction: direction of arrival of each joint at the first of them, (k,), +1 or -1.
        row: index of the row that comes next.
    """

    way: Tensor
    direction: Tensor
    row: int = 0


def remember(way: Tensor, direction: Tensor, reach: float) -> Entry:
    """Reduce a travel to the waypoints that are still remembered at its end.

    Args:
        way: waypoints of one run since its start, or since the waypoints of an entry, (m, k) mm or rad.
        direction: direction of arrival at the first, (k,).
        reach: travel beyond which only extremes are remembered, mm or rad.

    Returns:
        The entry of the row that comes next, the first of a view that it begins.
    """
    short = [_shorten(column, float(sign), reach) for column, sign in zip(way.numpy().T, direction, strict=True)]
    length = max(len(column) for column, _ in short)
    padded = [np.concatenate([np.full(length - len(column), column[0]), column]) for column, _ in short]
    return Entry(torch.as_tensor(np.column_stack(padded)), torch.tensor([sign for _, sign in short]))


def _shorten(way: np.ndarray, direction: float, reach: float) -> tuple[np.ndarray, float]:
    """Waypoints (m,) of one joint reduced to old extremes and recent turning points; the direction at the first."""
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

    The travel before the first waypoint is taken to come from infinitely far behind it, so nothing wipes out the first.
    """
    kept, start, sign = [], 0, direction
    while start < len(way):
        rest = sign * way[start:]
        start += len(rest) - int(np.argmax(rest[::-1]))
        kept.append(way[start - 1])
        sign = -sign
    return np.array(kept)
