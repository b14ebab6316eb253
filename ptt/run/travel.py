"""Travel of the joints from row to row: direction of arrival at each row, and turning points on the way."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ptt.mechanisms.protocol import Mechanism
from ptt.run.corners import TURN
from ptt.run.direction import STANDSTILL, hold_direction

if TYPE_CHECKING:
    from ptt.run.table import Table

OVERTRAVEL = 1.0  # mm or rad: assumed overtravel past a pose whose stated direction of arrival the rows do not show
TRANSIT_STEPS = 12  # intervals along a straight tool move at whose ends the joint values are computed


@dataclass(frozen=True)
class Travel:
    """How the joints arrive at each row.

    Attributes:
        direction: (n, k), +1 or -1; standstill keeps the last one, a run's first row arrives as the second moves.
        turning_point: (n, k) joint value where it last reversed between the row before and the row; the row's own value
            where it did not.
        starts: (n,) bool, the first row of each run.
    """

    direction: Tensor
    turning_point: Tensor
    starts: Tensor

    @property
    def two_sided(self) -> bool:
        """Whether some joint arrives from both sides."""
        return bool(((self.direction > 0).any(dim=0) & (self.direction < 0).any(dim=0)).any())


def read_travel(
    mechanism: Mechanism, q: Tensor, p: Tensor, table: "Table", *, straight: bool, smooth: bool = False
) -> Travel:
    """Read the travel from the order of the rows.

    Base reflectors are fixed to the base, so the machine stands still while they are read.

    Args:
        mechanism: the nominal mechanism.
        q: joint commands, (n, k).
        p: nominal tool positions, (n, 3) mm.
        table: n rows in travel order.
        straight: the tool runs straight between rows, so a joint may reverse on the way.
        smooth: it follows a smooth path through rows without a corner, where a joint may reverse as well.

    Returns:
        The travel.
    """
    starts = run_starts(table.run)
    if smooth:
        turning_point = _turning_points_on_smooth_path(q.numpy(), p.numpy(), starts)
    else:
        turning_point = _turning_points_on_lines(mechanism, q, p, starts) if straight else q.numpy().copy()
    stated = None if table.direction is None else np.nan_to_num(table.direction)
    if stated is not None:
        turning_point = np.where(
            _unshown(stated, q.numpy(), turning_point, starts), q.numpy() - np.sign(stated) * OVERTRAVEL, turning_point
        )
    direction = arrival_direction(q.numpy(), turning_point, starts)
    if stated is not None:
        direction = np.where(stated != 0, stated, direction)
    return Travel(torch.as_tensor(direction), torch.as_tensor(turning_point), torch.as_tensor(starts))


def _unshown(stated: np.ndarray, q: np.ndarray, turning_point: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Directions (n, k) that the table states and the rows do not show; of a run's first row they show none.

    A joint that stands keeps its direction from before, which the table may have stated then.
    """
    own = arrival_direction(q, turning_point, starts)
    moved = (np.abs(np.diff(q, axis=0, prepend=q[:1])) > STANDSTILL) | (np.abs(q - turning_point) > STANDSTILL)
    held = hold_direction(np.where(stated != 0, stated, np.where(moved | starts[:, None], own, 0.0)), starts)
    shown = np.where(moved, own, np.concatenate([held[:1], held[:-1]]))
    return (stated != 0) & (starts[:, None] | (shown != stated))


def run_starts(run: np.ndarray) -> np.ndarray:
    """Mark the first row of each run.

    Args:
        run: (n,) run codes in travel order.

    Returns:
        (n,) bool.
    """
    return np.concatenate([[True], run[1:] != run[:-1]]) if len(run) else np.zeros(0, dtype=bool)


def arrival_direction(q: np.ndarray, turning_point: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Direction in which each joint arrives at each row.

    Args:
        q: joint values, (n, k).
        turning_point: value at the last reversal on the way, (n, k); equal to q where there is none.
        starts: (n,) bool, first rows of runs.

    Returns:
        (n, k), +1 or -1. Standstill keeps the last direction; a run's first row arrives as the next one sets off;
        a joint that never moves in a run counts as +1.
    """
    turned = np.abs(q - turning_point) > STANDSTILL
    whole = np.diff(q, axis=0, prepend=q[:1])
    step = np.where(turned, q - turning_point, whole)
    step[starts & ~turned.any(axis=1)] = 0.0
    begun = np.where(turned, whole - step, whole)
    return hold_direction(np.where(np.abs(step) > STANDSTILL, step, 0.0), starts, begun).astype(float)


def _turning_points_on_lines(mechanism: Mechanism, q: Tensor, p: Tensor, starts: np.ndarray) -> np.ndarray:
    """Turning points (n, k) of the joints while the tool runs straight from the row before.

    An arm keeps its posture on the way, and its redundant freedom follows linear joint motion as nearly as possible.
    """
    part = torch.linspace(0.0, 1.0, TRANSIT_STEPS + 1, dtype=torch.float64)[1:-1, None]
    before, begun = torch.cat([p[:1], p[:-1]]), torch.cat([q[:1], q[:-1]])
    way = before[:, None, :] + part * (p - before)[:, None, :]  # shape: (n, s, 3)
    even = begun[:, None, :] + part * (q - begun)[:, None, :]  # shape: (n, s, k)
    inner = mechanism.inverse(way.reshape(-1, 3), near=even.reshape(-1, q.shape[1])).reshape(even.shape)
    joints = torch.cat([begun[:, None], inner, q[:, None]], dim=1).numpy()  # shape: (n, s + 2, k)
    value, turned = last_turning_point(joints)
    return np.where(turned & ~starts[:, None] & np.isfinite(value), value, q.numpy())


def on_the_way(p: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows that the tool passes without a corner, and the length of each move.

    Args:
        p: tool positions, (n, 3) mm.
        starts: (n,) bool, first rows of runs.

    Returns:
        (n,) bool, and (n - 1,) mm.
    """
    moved = np.diff(p, axis=0)
    length = np.linalg.norm(moved, axis=1)
    unit = moved / np.maximum(length, STANDSTILL)[:, None]
    moves = (length > STANDSTILL) & ~starts[1:]
    inner = np.zeros(len(p), dtype=bool)
    inner[1:-1] = (np.einsum("nc,nc->n", unit[1:], unit[:-1]) > TURN) & moves[1:] & moves[:-1]
    return inner, length


def _turning_points_on_smooth_path(q: np.ndarray, p: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Turning points (n, k) on a smooth path: cubic Hermite pieces between rows, parabolas beside a corner."""
    inner, length = on_the_way(p, starts)
    moves, rise = (length > STANDSTILL) & ~starts[1:], np.diff(q, axis=0)
    slope, part = np.zeros_like(q), length[1:] / np.maximum(length[1:] + length[:-1], STANDSTILL)
    per_mm = rise / np.maximum(length, STANDSTILL)[:, None]
    slope[1:-1] = part[:, None] * per_mm[:-1] + (1.0 - part[:, None]) * per_mm[1:]  # of the parabola through 3 rows
    begun, left = slope[:-1] * length[:, None], slope[1:] * length[:, None]
    begin = np.where(inner[:-1, None], begun, 2.0 * rise - left)
    end = np.where(inner[1:, None], left, 2.0 * rise - begun)
    on = np.linspace(0.0, 1.0, TRANSIT_STEPS + 1)[None, :, None]
    bend = on**2 * (3.0 - 2.0 * on)  # cubic Hermite basis
    way = q[:-1, None] + bend * rise[:, None] + on * (1.0 - on) * ((1.0 - on) * begin[:, None] - on * end[:, None])
    value, turned = last_turning_point(way)
    known = (inner[1:] | inner[:-1]) & moves
    return np.concatenate([q[:1], np.where(turned & known[:, None] & np.isfinite(value), value, q[1:])])


def last_turning_point(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Last turning point of joints on paths sampled at even steps, on cubic Hermite pieces between the samples.

    Play of 0.1 mm needs the turning point within microns; the nearest sample may be a tenth of a millimetre off, and a
    reversal behind the last inner sample would be missed.

    Args:
        joints: (n, s, k) joint values along each path, s at least 3.

    Returns:
        Value at the last turning point, (n, k), undefined where there is none; whether there is one, (n, k) bool.
    """
    slope = np.gradient(joints, axis=1, edge_order=2)
    against = np.sign(slope[:, :-1]) != np.sign(slope[:, -1:])
    at = against.shape[1] - 1 - np.argmax(against[:, ::-1], axis=1)[:, None]  # shape: (n, 1, k)
    low, high, rise, fall = (
        np.take_along_axis(values, at + after, axis=1)[:, 0] for values in (joints, slope) for after in (0, 1)
    )
    on = rise / np.where(rise == fall, 1.0, rise - fall)  # share of the step to where the slope vanishes
    bend = on**2 * (3.0 - 2.0 * on)
    value = low + bend * (high - low) + on * (1.0 - on) * ((1.0 - on) * rise - on * fall)
    return value, against.any(axis=1) & (np.abs(value - joints[:, -1]) > STANDSTILL)
