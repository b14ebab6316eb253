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
LOST = 100.0  # mm, least error assigned to a command that does not close: the link length may be given in metres
FLOOR = 0.05  # mm: an error below it is no further proof


@dataclass(frozen=True, eq=False)
class Agreement:
    """Residuals between targets, commands and readings of a run.

    Attributes:
        rms: (3,) mm, readings against targets, readings against commands, targets against commands; NaN for a pair
            that the run does not have.
        turn: (3, 3) rotation from the base frame to the tracker frame.
        shift: (3,) mm, the base frame's origin in the tracker frame.
        width: least rms radius of the three point sets, mm; errors shrink with it without becoming less wrong.
    """

    rms: np.ndarray
    turn: np.ndarray
    shift: np.ndarray
    width: float

    def beside(self, width: float) -> np.ndarray:
        """The errors (3,), mm, scaled up where the points lie closer together than `width`, mm."""
        return self.rms * max(1.0, width / max(self.width, 1e-12))

    def total(self, width: float) -> float:
        """Sum of the logarithms of the errors: one less is an error of one pair smaller by the factor e."""
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
    sent = np.array([_rows_with_command(setup) for setup in setups])
    size = max(LOST, *(setup.file.machine.link_length_mm for setup in setups))  # type: ignore[union-attr]
    sizes = np.full((len(setups), 1), size)
    return agree_points(target, forward_many(setups), reading, sent, sizes, setups[0].free)


def agree_points(
    target: np.ndarray, commanded: np.ndarray, reading: np.ndarray, sent: np.ndarray, sizes: np.ndarray, free: bool
) -> list[Agreement]:
    """How well points of targets, commands and readings agree, in each of h cases.

    Args:
        target: (h, m, 3) mm.
        commanded: (h, m, 3) mm, where the commands put the tool, NaN where they do not close.
        reading: (h, m, 3) mm.
        sent: (h, m) bool, rows with a command.
        sizes: (h, 1) mm, the error assigned to a row whose command does not close.
        free: whether the tracker frame is fitted.

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
        columns.append(_nan_if_few(rms(distance, lost, sizes), distance, lost))
    columns.append(_commands_off_targets(target, commanded, sent, sizes))
    width = np.nanmin(np.stack([_rms_radius(points) for points in (target, commanded, reading)]), axis=0)
    table = np.stack(columns, axis=1)
    return [Agreement(table[i], turn[i], shift[i], float(width[i])) for i in range(len(table))]


def _rms_radius(points: np.ndarray) -> np.ndarray:
    """Rms distance of the points of each case from their centre, (h,) mm, infinite where there are none."""
    known = np.isfinite(points).all(axis=2)
    count = np.maximum(known.sum(axis=1), 1)
    filled = np.where(known[..., None], points, 0.0)
    middle = filled.sum(axis=1) / count[:, None]
    square = np.where(known, ((filled - middle[:, None]) ** 2).sum(axis=2), 0.0).sum(axis=1)
    return np.where(known.any(axis=1), np.sqrt(square / count), np.inf)


def forward_many(setups: Sequence[Setup]) -> np.ndarray:
    """Forward kinematics of each hypothesis' commands, (h, m, 3) mm, NaN without command or solution."""
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


def _rows_with_command(setup: Setup) -> np.ndarray:
    """Rows with a command, (m,) bool."""
    command = setup.table.command
    return np.zeros(setup.table.rows, dtype=bool) if command is None else np.isfinite(command).all(axis=1)


def _commands_off_targets(target: np.ndarray, commanded: np.ndarray, sent: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Rms of targets against commands without their median difference, since heights may count from another zero."""
    apart = target - commanded
    known = np.isfinite(apart).all(axis=2)
    apart = np.where(known[..., None], apart, np.nan)
    apart = apart - np.stack([middle(apart[..., axis]) for axis in range(3)], axis=1)[:, None]
    lost = sent & np.isfinite(target).all(axis=2) & ~known
    return _nan_if_few(rms(np.linalg.norm(apart, axis=2), lost, sizes), np.linalg.norm(apart, axis=2), lost)


def _nan_if_few(values: np.ndarray, distance: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Values (h,), NaN where too few rows of `distance` and `lost` (h, m) count."""
    return np.where((np.isfinite(distance) | lost).sum(axis=1) >= LEAST_ROWS, values, np.nan)
