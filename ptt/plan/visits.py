"""Visits: a few rows driven one after another around one pose, and the table that a list of visits makes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.plan.space import Space, can_drive, directions, draw_poses
from ptt.run.table import Table, make_table
from ptt.run.target_frame import RunFrame
from ptt.run.travel import read_travel

DECIMALS = 4  # of targets in mm, 0.1 um
DECIMALS_RAD = 7  # of joint commands
NEAREST, FARTHEST = 2.0, 15.0  # mm that each slider moves on an approach, drawn log-uniformly
NEAREST_RAD, FARTHEST_RAD = 0.02, 0.15  # rad that each joint of an arm moves
TRIES = 60  # candidate poses beyond three for each visit


@dataclass(frozen=True, eq=False)
class Visit:
    """Rows driven one after another.

    Attributes:
        q: (m, k) joint values, mm or rad.
        name: one for each row.
        role: of all rows.
        payload: kg, NaN where it does not matter.
        temp: wanted temperature, degrees Celsius, NaN where it does not matter.
        feed: mm/s, NaN where it does not matter.
    """

    q: Tensor
    name: tuple[str, ...]
    role: str = "pose"
    payload: float = float("nan")
    temp: float = float("nan")
    feed: float = float("nan")

    @property
    def rows(self) -> int:
        """Number of rows m."""
        return len(self.q)

    def named(self, name: str) -> "Visit":
        """The same visit, its pose renamed; rows beside the pose keep their suffix."""
        return replace(self, name=tuple(name + text[len(self.name[1]) :] for text in self.name))


def both_ways(space: Space, count: int, random: np.random.Generator, *, repeats: int = 1) -> list[Visit]:
    """Visits that reach a pose from either side of every joint: before, pose, beyond, pose.

    The joints overtravel by a random amount, so that readings soon and long after a reversal are among them. Opposite
    ways take turns, so first arrivals are balanced too.

    Args:
        space: where the machine can go.
        count: how many.
        random: of poses and overtravel.
        repeats: how often each pose is visited from either side.

    Returns:
        The visits.
    """
    poses = draw_poses(space, 3 * count + TRIES, random)
    ways = directions(space.joints)
    ways = ways[(random.permutation(len(ways) // 2)[:, None] * 2 + np.arange(2)).ravel()]
    near, far = (NEAREST, FARTHEST) if space.by_tool else (NEAREST_RAD, FARTHEST_RAD)
    reachable = ((space.upper - space.lower) / (10.0 * far)).clamp(max=1.0)  # share of the overtravel, (k,)
    visits: list[Visit] = []
    while len(visits) < count and len(poses):
        tried, poses = poses[: count - len(visits)], poses[count - len(visits) :]
        way = torch.as_tensor(ways[(len(visits) + np.arange(len(tried))) % len(ways)])
        before, beyond = torch.as_tensor(np.exp(random.uniform(np.log(near), np.log(far), (2, len(tried)))))
        away = torch.stack([-before, 0.0 * before, beyond, 0.0 * beyond] * repeats, dim=1)  # shape: (m, rows)
        q = tried[:, None] + away[..., None] * (way * reachable)[:, None]
        driven = can_drive(space, q.flatten(0, 1)).reshape(len(tried), -1).all(axis=1)
        for row in np.flatnonzero(driven):
            name = f"p{len(visits) + 1}"
            visits.append(Visit(q[row], (f"{name} before", name, f"{name} beyond", name) * repeats))
    return visits


def singles(poses: Tensor) -> list[Visit]:
    """Visits of one row each, (m, k) joint values in all."""
    return [Visit(q[None], ("v",)) for q in poses]


def in_driving_order(visits: Sequence[Visit], space: Space) -> list[Visit]:
    """Order visits for short travel, cold before warm, then one payload after the other.

    Within each group nearest neighbour, improved by 2-opt.

    Args:
        visits: in any order.
        space: for tool positions.

    Returns:
        The same visits.
    """
    groups: dict[tuple[float, float], list[Visit]] = {}
    for visit in visits:
        groups.setdefault((_level(visit.temp), _level(visit.payload)), []).append(visit)
    ordered: list[Visit] = []
    for number, key in enumerate(sorted(groups)):
        path = _short_path(groups[key], space)
        ordered += path if number % 2 == 0 else path[::-1]
    return ordered


def _level(value: float) -> float:
    return -1.0 if np.isnan(value) else value


def _short_path(visits: Sequence[Visit], space: Space) -> list[Visit]:
    places = space.mechanism.forward(torch.stack([visit.q[min(1, visit.rows - 1)] for visit in visits])).numpy()
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    order, left = [0], set(range(1, len(visits)))
    while left:
        nearest = min(sorted(left), key=lambda index: apart[order[-1], index])
        order.append(nearest)
        left.remove(nearest)
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                after = order[j + 1] if j + 1 < len(order) else None
                old = apart[order[i - 1], order[i]] + (apart[order[j], after] if after is not None else 0.0)
                new = apart[order[i - 1], order[j]] + (apart[order[i], after] if after is not None else 0.0)
                if new < old - 1e-9:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return [visits[index] for index in order]


def table_of(visits: Sequence[Visit], space: Space, *, straight: bool) -> Table:
    """Table of targets of visits in the given order, with the direction of arrival of each joint.

    Args:
        visits: rows; base reflectors are visits of role 'base' with any joint values.
        space: for tool positions.
        straight: the tool runs straight between rows.

    Returns:
        The table: targets for a 3-PTT, joint commands for an arm.
    """
    q = torch.cat([visit.q for visit in visits])
    rows = np.array([len(visit.name) for visit in visits])  # quicker than to ask a tensor
    role = np.repeat([visit.role for visit in visits], rows)
    base = role == "base"
    decimals = DECIMALS if space.by_tool else DECIMALS_RAD
    places = np.round((space.mechanism.forward(q) if space.by_tool else q).numpy(), decimals) + 0.0
    places[base] = np.nan
    columns = {
        "payload_kg": _column(visits, "payload", rows),
        "temp_c": _column(visits, "temp", rows),
        "feed_mm_s": _column(visits, "feed", rows),
    }
    name = np.array([text for visit in visits for text in visit.name])
    stated = {title: values for title, values in columns.items() if values is not None}
    prefix = "b" if space.by_tool else "q"
    place = {"target": places} if space.by_tool else {"target": None, "command": places}
    table = make_table(**place, name=name, role=role, source="targets", joint_prefix=prefix, **stated)
    sent = _sent(space, places, base)
    travel = read_travel(space.mechanism, sent, space.mechanism.forward(sent), table, straight=straight)
    direction = np.where(base[:, None], np.nan, travel.direction.numpy())
    return table.replace(direction=direction)


def as_counted(table: Table, frame: RunFrame) -> Table:
    """A plan as the controller counts targets.

    Args:
        table: with targets in the base frame.
        frame: in which the machine's targets are stated.

    Returns:
        The table with its targets in that frame; an arm's joint commands stay.
    """
    if frame.source == "base":
        return table
    return table.replace(target=np.round(frame.as_stated(table.target), DECIMALS) + 0.0)


def _sent(space: Space, places: np.ndarray, base: np.ndarray) -> Tensor:
    """Joint commands of the rounded places; the machine stands still while base reflectors are read."""
    rows = np.arange(len(places))
    last = np.maximum.accumulate(np.where(base, -1, rows))
    known = torch.as_tensor(places[np.where(last < 0, int(np.argmin(base)), last)])
    return space.mechanism.inverse(known) if space.by_tool else known


def _column(visits: Sequence[Visit], field: str, rows: np.ndarray) -> np.ndarray | None:
    values = np.array([getattr(visit, field) for visit in visits])
    return None if np.isnan(values).all() else np.repeat(values, rows)
