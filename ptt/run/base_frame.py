"""First rigid motion of each tracker frame: from the poses, or from reflectors fixed to the base."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ptt.errors import TableError, TooFewError
from ptt.machine import MachineFile
from ptt.run.base_drawn import misplaced
from ptt.run.base_readings import BaseReadings
from ptt.run.base_visits import ENOUGH, sound_visits, visits_scatter
from ptt.run.frames import align
from ptt.run.noise import DEFAULT_SIGMA
from ptt.run.same_pose import number_rows
from ptt.run.table import Table
from ptt.run.target_frame import LIMIT, RunFrame
from ptt.run.view import View

BASE_FIX = (
    "correct the names in the run or xyz_mm under [[tracker.base_point]], leave out the rows of the reflector that was "
    'moved, or set frame = "fitted" under [tracker]'
)
MOST_VISITS = 400  # visits to base reflectors kept apart; where there are more, neighbouring rounds are averaged


@dataclass(frozen=True)
class BaseFrames:
    """Rigid motions of f tracker frames by the base reflectors read in n rows.

    Attributes:
        rotations: (f, 3, 3), base axes in tracker coordinates.
        shifts: (f, 3) mm, base origin in tracker coordinates.
        sound: rows with a sound visit, (n,) bool.
    """

    rotations: np.ndarray
    shifts: np.ndarray
    sound: np.ndarray


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


def refuse_untrue(table: Table, place: np.ndarray, stated_in: Sequence[RunFrame], used: np.ndarray) -> None:
    """Refuse frame = "trusted" where the readings are in the frame of targets that are stated in another one.

    Args:
        table: n rows.
        place: where the tool should be, in the base frame, (n, 3) mm.
        stated_in: in which each run states its targets.
        used: rows that count, (n,) bool.

    Raises:
        TableError: they are.
    """
    for run, frame in enumerate(stated_in):
        here = used & (table.run == run) & np.isfinite(table.target).all(axis=1)
        if frame.source not in ("stated", "commands") or not here.any():
            continue
        apart, beside = (
            np.median(np.linalg.norm(table.measured[here] - to[here], axis=1)) for to in (place, table.target)
        )
        if beside < LIMIT < apart:
            raise TableError(
                f'frame = "trusted", but the readings are in the frame of the targets, {apart:.0f} mm from the base',
                where=table.source,
                fix='set frame = "fitted" under [tracker] in the machine file',
            )


def from_poses(
    view: View, table: Table, read: np.ndarray, frame: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Each frame's least-squares rigid motion onto the drawing's positions; not unique for one or two readings."""
    rotations, shifts = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for index in range(count):
        rows = read & (frame == index)
        if rows.any():
            rotations[index], shifts[index] = align(view.p.numpy()[rows], table.measured[rows])
    return rotations, shifts


def from_base(file: MachineFile, table: Table, frame: np.ndarray, count: int) -> BaseFrames:
    """Each frame's least-squares rigid motion from its base reflectors onto their drawn positions.

    Args:
        file: the machine.
        table: n rows.
        frame: (n,) int, frame of each row.
        count: number of frames.

    Raises:
        TableError: a reflector that the machine file lacks.
        TooFewError: a frame with readings of too few.
    """
    drawn = {point.name: point for point in file.tracker.base_point}
    rotations, shifts = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    sound = np.zeros(table.rows, dtype=bool)
    for index in range(count):
        here = (table.role == "base") & (frame == index) & np.isfinite(table.measured).all(axis=1)
        seen = _seen(table, list(drawn), here, index)
        when = {name: np.flatnonzero(here & (table.name == name)) for name in seen}
        fit = _sound(file, table, when)
        for rows in fit.values():
            sound[rows] = True
        read = [table.measured[rows] for rows in fit.values()]
        rotations[index], shifts[index] = align(
            np.array([drawn[name].xyz_mm for name in fit]), np.array([np.median(own, axis=0) for own in read])
        )
    return BaseFrames(rotations, shifts, sound)


def untrue_base(file: MachineFile, table: Table) -> str:
    """Contradiction between the base reflectors read in one set-up and the machine file, in words; '' for none.

    Args:
        file: the machine.
        table: the rows of the set-up.
    """
    here = (table.role == "base") & np.isfinite(table.measured).all(axis=1)
    when = {point.name: np.flatnonzero(here & (table.name == point.name)) for point in file.tracker.base_point}
    when = {name: rows for name, rows in when.items() if len(rows)}
    if len(when) < ENOUGH:
        return ""
    fit, drawn = _sound(file, table, when), {point.name: point for point in file.tracker.base_point}
    sigma = max(DEFAULT_SIGMA, file.tracker.sigma_mm or 0.0, *(drawn[name].sigma_mm for name in when))
    read = {name: table.measured[rows] for name, rows in fit.items()}
    return misplaced(read, fit, {name: np.array(drawn[name].xyz_mm) for name in fit}, sigma)


def odd_base(file: MachineFile, table: Table) -> tuple[list[str], list[str]]:
    """Base reflectors that a run reads and the machine file lacks, and those that are not where the file has them.

    Args:
        file: the machine.
        table: the rows of one set-up of the tracker.

    Returns:
        Names of the former, and of the latter.
    """
    here = (table.role == "base") & np.isfinite(table.measured).all(axis=1)
    drawn = {point.name for point in file.tracker.base_point}
    when = {name: np.flatnonzero(here & (table.name == name)) for name in dict.fromkeys(table.name[here].tolist())}
    known = {name: rows for name, rows in when.items() if name in drawn}
    sound = _sound(file, table, known) if len(known) >= ENOUGH else known
    return [name for name in when if name not in drawn], [name for name in known if name not in sound]


def _sound(file: MachineFile, table: Table, when: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Name -> rows of the sound visits, for each reflector that has any."""
    drawn = {point.name: point for point in file.tracker.base_point}
    visits = {name: table.measured[rows] for name, rows in when.items()}
    spots = {name: np.array(drawn[name].xyz_mm) for name in when}
    sigma = max(DEFAULT_SIGMA, *(drawn[name].sigma_mm for name in when))
    fitting = sound_visits(visits, when, spots, sigma)
    return {name: rows[fitting[name]] for name, rows in when.items() if fitting[name].any()}


def base_readings(
    file: MachineFile, table: Table, view: View, near: np.ndarray, frame: np.ndarray, seen: BaseFrames
) -> BaseReadings:
    """The visits to base reflectors as readings, neighbouring rounds averaged where there are many.

    Args:
        file: the machine.
        table: n rows.
        view: the same rows.
        near: readings near the base frame, (n, 3) mm.
        frame: (n,) int, frame of each row.
        seen: sound visits.
    """
    names = [point.name for point in file.tracker.base_point]
    place, drawn = (np.array([getattr(p, own) for p in file.tracker.base_point]) for own in ("xyz_mm", "sigma_mm"))
    rows = np.flatnonzero(seen.sound)
    point = np.array([names.index(name) for name in table.name[rows]])
    apiece = number_rows(np.column_stack([frame[rows], np.cumsum(table.role != "base")[rows]]))
    some = -(-len(rows) // MOST_VISITS)  # rounds that are taken together
    rounds = number_rows(np.column_stack([frame[rows], apiece // some]))
    _, first, which = np.unique(np.column_stack([rounds, point]), axis=0, return_index=True, return_inverse=True)
    total = np.stack([np.bincount(which.ravel(), column) for column in near[rows].T], axis=1)
    kept, order = np.sort(first), np.argsort(first)
    mean, own = (total / np.bincount(which.ravel())[:, None])[order], rows[kept]
    aside = (table.role == "base") & np.isfinite(table.measured).all(axis=1) & ~seen.sound
    visits = view.of_rows(torch.as_tensor(own)).at(p=torch.as_tensor(place[point[kept]]))
    wide, none = np.full(len(own), np.inf), np.zeros((len(own), 3, 0))
    scatter = visits_scatter(mean, point[kept], rounds[kept], place[point[kept]])
    loose = BaseReadings(visits, mean, frame[own], point[kept], rounds[kept], drawn[point[kept]], wide, aside, scatter)
    return loose.beside(loose.place, none)


def _seen(table: Table, drawn: Sequence[str], here: np.ndarray, run: int) -> list[str]:
    """Names of the reflectors that a run reads, in the order of the machine file; unknown or too few are refused."""
    unknown = sorted(set(table.name[here]) - set(drawn))
    if unknown:
        raise TableError(
            f"base reflector '{unknown[0]}' is not in the machine file",
            where=table.source,
            fix="add a [[tracker.base_point]] for it",
        )
    seen = [name for name in drawn if (here & (table.name == name)).any()]
    if len(seen) < 3:
        label = str(table.run_label[run])
        which = label if label.startswith("run") else f"run {label}"
        raise TooFewError(
            f'frame = "measured" but {which} has readings of only {len(seen)} base reflectors',
            where=table.source,
            fix='add rows with role = "base"; give runs the same number in the column run if the tracker was not moved '
            'between them; or set frame = "fitted" in the machine file',
        )
    return seen
