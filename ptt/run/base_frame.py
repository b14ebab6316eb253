"""Where a tracker's frames stand: the first rigid motion of each, from poses or from reflectors fixed to the base."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ptt.errors import TableError
from ptt.machine import MachineFile
from ptt.run.base_visits import sound_visits, visits_apart
from ptt.run.frames import align
from ptt.run.noise import DEFAULT_SIGMA, Noise
from ptt.run.table import Table
from ptt.run.target_frame import LIMIT, RunFrame
from ptt.run.view import View


@dataclass(frozen=True)
class BaseReadings:
    """Base reflectors as seen: one averaged reading for each point and frame.

    Attributes:
        place: (m, 3) mm, drawn.
        reading: (m, 3) mm, read, near the base frame.
        sigma: (m,) mm, of one coordinate, the drawn place's uncertainty included.
        frame: (m,) int, index of the frame.
    """

    place: np.ndarray
    reading: np.ndarray
    sigma: np.ndarray
    frame: np.ndarray


def into_base(reading: np.ndarray, frame: np.ndarray, rotations: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Bring readings into the base frame.

    Args:
        reading: (n, 3) mm in tracker coordinates.
        frame: (n,) int, frame of each row.
        rotations: (f, 3, 3), base axes in tracker coordinates.
        shifts: (f, 3) mm, base origin in tracker coordinates.

    Returns:
        (n, 3) mm.
    """
    return np.einsum("ni,nij->nj", reading - shifts[frame], rotations[frame])


def refuse_untrue(table: Table, view: View, stated_in: Sequence[RunFrame], used: np.ndarray) -> None:
    """Refuse a frame that is said to be the base's where readings follow targets that are stated in another."""
    for run, frame in enumerate(stated_in):
        here = used & (table.run == run) & np.isfinite(table.target).all(axis=1)
        if frame.source not in ("stated", "commands") or not here.any():
            continue
        read, place = table.measured[here], view.p.numpy()[here]
        apart, beside = (np.median(np.linalg.norm(read - to, axis=1)) for to in (place, table.target[here]))
        if beside < LIMIT < apart:
            raise TableError(
                f'frame = "trusted", but the readings are in the frame of the targets, {apart:.0f} mm from the base\'s',
                where=table.source,
                fix='set frame = "fitted" under [tracker] in the machine file',
            )


def from_poses(
    view: View, table: Table, used: np.ndarray, frame: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Each frame's best rigid motion onto the drawing."""
    rotations, shifts = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for index in range(count):
        rows = used & (frame == index)
        if rows.sum() >= 4:
            rotations[index], shifts[index] = align(view.p.numpy()[rows], table.measured[rows])
    return rotations, shifts


def from_base(
    file: MachineFile, table: Table, frame: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, BaseReadings]:
    """Each frame's best rigid motion from the reflectors that it sees onto their places, and these readings."""
    drawn = {point.name: point for point in file.tracker.base_point}
    rotations, shifts = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    rows: list[tuple[np.ndarray, np.ndarray, float, int]] = []
    for index in range(count):
        here = (table.role == "base") & (frame == index) & np.isfinite(table.measured).all(axis=1)
        seen = _seen(table, list(drawn), here, index)
        visits = {name: table.measured[here & (table.name == name)] for name in seen}
        spots = {name: np.array(drawn[name].xyz_mm) for name in seen}
        readings = sound_visits(visits, spots, max(DEFAULT_SIGMA, *(drawn[name].sigma_mm for name in seen)))
        place = np.array([drawn[name].xyz_mm for name in seen])
        mean = np.array([np.median(readings[name], axis=0) for name in seen])
        rotations[index], shifts[index] = align(place, mean)
        near = into_base(mean, np.full(len(mean), index), rotations, shifts)
        apart = visits_apart(list(readings.values()))
        read = [max(DEFAULT_SIGMA / np.sqrt(len(readings[name])), apart) for name in seen]
        rows += [(place[i], near[i], np.hypot(drawn[name].sigma_mm, read[i]), index) for i, name in enumerate(seen)]
    base = BaseReadings(*(np.array(column) for column in zip(*rows, strict=True)))
    return rotations, shifts, base


def _seen(table: Table, drawn: Sequence[str], here: np.ndarray, run: int) -> list[str]:
    """Names of the reflectors that a run reads, in the order of the machine file; refused where they cannot do."""
    unknown = sorted(set(table.name[here]) - set(drawn))
    if unknown:
        raise TableError(
            f"base reflector '{unknown[0]}' is not in the machine file",
            where=table.source,
            fix="add a [[tracker.base_point]] for it",
        )
    seen = [name for name in drawn if (here & (table.name == name)).any()]
    if len(seen) < 3:
        raise TableError(
            f'frame = "measured" but run {table.run_label[run]} reads only {len(seen)} base reflectors',
            where=table.source,
            fix='add rows with role = "base", or set frame = "fitted" in the machine file',
        )
    return seen


def weigh_base(base: BaseReadings, noise: Noise | None) -> BaseReadings:
    """Nothing fixed to the base is read better than the noise floor allows for one visit in four."""
    if noise is None:
        return base
    return replace(base, sigma=np.hypot(base.sigma, noise.total / np.sqrt(3.0) / 2.0))
