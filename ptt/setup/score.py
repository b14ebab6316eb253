"""How well targets, commands and readings of a 3-PTT agree, for many hypotheses at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch

from ptt.errors import MachineError
from ptt.machine import ThreePttSpec
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.setup.rigid import align_many, middle, rms
from ptt.setup.setup import Setup

LEAST_ROWS = 5  # with fewer a rigid motion alone explains nearly everything
LOST = 100.0  # mm that a command which does not close is wrong by, at least: links in metres are short
FLOOR = 0.05  # mm: agreement beyond this is no further proof


@dataclass(frozen=True, eq=False)
class Agreement:
    """What stays between the three columns of a run.

    Attributes:
        rms: (3,) mm, readings against targets, readings against commands, targets against commands; NaN for a pair
            that the run does not have.
        turn: (3, 3) rotation of the tracker frame against the drawing.
        shift: (3,) mm.
        width: how far the closest of the three lie apart, mm: an error shrinks with it and is none the smaller.
    """

    rms: np.ndarray
    turn: np.ndarray
    shift: np.ndarray
    width: float

    def beside(self, width: float) -> np.ndarray:
        """The errors (3,), mm, made up for where all lies closer together than before."""
        return self.rms * max(1.0, width / max(self.width, 1e-12))

    def total(self, width: float) -> float:
        """Sum of logarithms: a fall by one of it is an error smaller by the factor e in one pair."""
        return float(np.nansum(np.log(np.maximum(self.beside(width), FLOOR))))

    @property
    def worst(self) -> float:
        """Largest of the pairs, mm; 0 where there is none."""
        return float(np.nanmax(self.rms)) if np.isfinite(self.rms).any() else 0.0


def agree(setups: Sequence[Setup]) -> list[Agreement]:
    """How well each hypothesis makes the columns agree.

    Args:
        setups: hypotheses, all of the same m rows.

    Returns:
        One agreement for each.
    """
    if not setups:
        return []
    target = np.stack([setup.table.target for setup in setups])
    reading = np.stack([setup.table.measured for setup in setups])
    sent = np.array([_sent(setup) for setup in setups])
    size = max(LOST, *(setup.file.machine.link_length_mm for setup in setups))  # type: ignore[union-attr]
    sizes = np.full((len(setups), 1), size)
    return agree_points(target, forward_many(setups), reading, sent, sizes, setups[0].free)


def agree_points(
    target: np.ndarray, commanded: np.ndarray, reading: np.ndarray, sent: np.ndarray, sizes: np.ndarray, free: bool
) -> list[Agreement]:
    """The same of points.

    Args:
        target: (h, m, 3) mm.
        commanded: (h, m, 3) mm, where the commands put the tool, NaN where they do not close.
        reading: (h, m, 3) mm.
        sent: (h, m) bool, rows with a command.
        sizes: (h, 1) mm, how wrong a row is whose command does not close.
        free: whether the tracker may stand anywhere.

    Returns:
        One agreement for each.
    """
    read, wanted = (np.isfinite(points).all(axis=2) for points in (reading, target))
    columns: list[np.ndarray] = []
    turn, shift = np.zeros(0), np.zeros(0)
    for place, certain in ((target, wanted), (commanded, sent)):
        distance, first = np.full(read.shape, np.nan), not columns or not np.isfinite(columns[0]).any()
        if first or np.isfinite(place).any():
            turn_now, shift_now, distance = align_many(place, reading, free)
            turn, shift = (turn_now, shift_now) if first else (turn, shift)
        lost = certain & read & ~np.isfinite(place).all(axis=2)
        columns.append(_enough(rms(distance, lost, sizes), distance, lost))
    columns.append(_between(target, commanded, sent, sizes))
    width = np.nanmin(np.stack([_spread(points) for points in (target, commanded, reading)]), axis=0)
    table = np.stack(columns, axis=1)
    return [Agreement(table[i], turn[i], shift[i], float(width[i])) for i in range(len(table))]


def _spread(points: np.ndarray) -> np.ndarray:
    """How far the points of each case lie apart, (h,) mm, infinite where there are none."""
    known = np.isfinite(points).all(axis=2)
    count = np.maximum(known.sum(axis=1), 1)
    filled = np.where(known[..., None], points, 0.0)
    middle = filled.sum(axis=1) / count[:, None]
    square = np.where(known, ((filled - middle[:, None]) ** 2).sum(axis=2), 0.0).sum(axis=1)
    return np.where(known.any(axis=1), np.sqrt(square / count), np.inf)


def forward_many(setups: Sequence[Setup]) -> np.ndarray:
    """Where each hypothesis' commands put the tool, (h, m, 3) mm, NaN where there are none or it does not close."""
    rows = setups[0].table.rows
    place = np.full((len(setups), rows, 3), np.nan)
    groups: dict[ThreePttSpec, list[int]] = {}
    for index, setup in enumerate(setups):
        if setup.table.command is not None and isinstance(setup.file.machine, ThreePttSpec):
            groups.setdefault(setup.file.machine, []).append(index)
    for spec, members in groups.items():
        mechanism = build(spec)
        if mechanism is None:
            continue
        q = np.concatenate([setups[index].table.command for index in members])
        p = mechanism.forward(torch.as_tensor(q, dtype=torch.float64)).numpy()
        place[members] = p.reshape(len(members), rows, 3)
    return place


@lru_cache(maxsize=256)
def build(spec: ThreePttSpec) -> ThreePtt | None:
    """The mechanism, None where the links are too short for it."""
    try:
        return ThreePtt.from_spec(spec)
    except MachineError:
        return None


def _sent(setup: Setup) -> np.ndarray:
    """Rows with a command, (m,) bool."""
    command = setup.table.command
    return np.zeros(setup.table.rows, dtype=bool) if command is None else np.isfinite(command).all(axis=1)


def _between(target: np.ndarray, commanded: np.ndarray, sent: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Targets against commands; a constant shift is none of it, heights may count from another zero."""
    apart = target - commanded
    known = np.isfinite(apart).all(axis=2)
    apart = np.where(known[..., None], apart, np.nan)
    apart = apart - np.stack([middle(apart[..., axis]) for axis in range(3)], axis=1)[:, None]
    lost = sent & np.isfinite(target).all(axis=2) & ~known
    return _enough(rms(np.linalg.norm(apart, axis=2), lost, sizes), np.linalg.norm(apart, axis=2), lost)


def _enough(values: np.ndarray, distance: np.ndarray, lost: np.ndarray) -> np.ndarray:
    return np.where((np.isfinite(distance) | lost).sum(axis=1) >= LEAST_ROWS, values, np.nan)
