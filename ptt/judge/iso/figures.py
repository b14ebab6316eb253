"""`ptt iso`: which figures a file asks for (ISO 230-2 of axis runs, ISO 9283 of a tracker run), both as results."""

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ptt.errors import TableError, shown
from ptt.judge.gross import gross_rows
from ptt.judge.iso.axis import AxisFigures, axis_figures
from ptt.judge.iso.pose import pose_report
from ptt.judge.iso.pose_figures import PoseReport
from ptt.judge.run_errors import seats_of
from ptt.machine import MachineFile
from ptt.record import Record
from ptt.run.direction import travel_direction
from ptt.run.frames import align, kabsch
from ptt.run.mounts import mount_of_rows
from ptt.run.problem import Problem
from ptt.run.readers.columns import UNITS as UNITS_OF
from ptt.run.readers.plain import numbers_of, read_plain
from ptt.run.readers.scale import LARGEST_IN_METRES
from ptt.run.readers.text import LONGEST
from ptt.run.same_pose import same_places
from ptt.run.table import Table, take_rows
from ptt.run.target_frame import in_base, target_frames
from ptt.run.wanted import placed

Array = NDArray[np.float64]
Motion = Callable[[Array, Array], tuple[Array, Array]]

WAYS = {"up": 1.0, "fwd": 1.0, "forward": 1.0, "+": 1.0, "+1": 1.0, "1": 1.0}
WAYS |= {"down": -1.0, "bwd": -1.0, "backward": -1.0, "back": -1.0, "-": -1.0, "-1": -1.0}
LENGTHS = UNITS_OF["length"]
UNITS = {1000.0: "metres", 25.4: "inches"}  # mm in each
UNIT_SLIP = 0.02  # relative deviation of the slope from a unit factor: no axis has so large a scale error
AXIS_COLUMNS = {"target", "direction", "measured"}


@dataclass(frozen=True)
class IsoAxes(Record):
    """ISO 230-2 figures of every axis in a file."""

    keys: ClassVar[str] = "source, axes"

    axes: tuple[AxisFigures, ...]
    source: str


def is_axis_file(path: Path | str) -> bool:
    """Whether a CSV's header has the columns of bidirectional axis runs: target, direction, measured, with unit or not.

    Args:
        path: any file.

    Returns:
        Whether it does; False where it cannot be read as UTF-8 text.
    """
    try:
        if not Path(path).is_file():  # a pipe would be waited for
            return False
        with Path(path).open(encoding="utf-8-sig") as file:
            return set(AXIS_COLUMNS) <= {_titled(name)[0] for name in file.readline(LONGEST).split(",")}
    except (OSError, ValueError):
        return False


def read_axis_figures(path: Path | str) -> IsoAxes:
    """Read bidirectional axis runs and work out their ISO 230-2 figures.

    Args:
        path: CSV with columns `direction` (up or down, fwd or bwd, +1 or -1), `target_mm`, `measured_mm` (empty where
            not observed; either in another unit that its title says, as `measured_um`) and, where it holds several
            axes, `file` or `axis`. A `cycle` column is for people.

    Returns:
        The figures, axes in the order of the file.

    Raises:
        TableError: a missing file or column, an unknown direction, or a cell that is not a number.
    """
    source = str(path)
    table = read_plain(path)
    units = dict(map(_titled, table.columns))
    twice = next((name for name, count in Counter(_titled(each)[0] for each in table.columns).items() if count > 1), "")
    if twice in AXIS_COLUMNS:
        raise TableError(f"two columns {twice}", where=source, fix="leave one of them out")
    table = table.rename(columns=lambda name: _titled(name)[0])
    missing = sorted(AXIS_COLUMNS - set(table.columns))
    if missing:
        raise TableError(f"no column {missing[0]}", where=source, fix="give direction, target_mm and measured_mm")
    direction = table["direction"].str.strip().str.lower().map(WAYS).to_numpy(dtype=np.float64)
    bad = np.flatnonzero(np.isnan(direction))
    if len(bad):
        where = f"{source} row {table.index[bad[0]]}, column direction"
        raise TableError(
            f"unknown direction '{shown(table['direction'].iloc[bad[0]])}'", where=where, fix="use up or down"
        )
    target, measured = (
        numbers_of(table, name, source, empty=name == "measured") * LENGTHS[units[name]][0]
        for name in ("target", "measured")
    )
    _require_mm(target, measured, source)
    names = next((table[key].to_numpy(dtype=str) for key in ("axis", "file") if key in table), np.full(len(table), ""))
    axes = ((name, names == name) for name in dict.fromkeys(names.tolist()))
    figures = tuple(_of_axis(target[r], direction[r], measured[r], str(name), source) for name, r in axes)
    if not figures:
        raise TableError("no rows", where=source, fix="give runs in both directions")
    return IsoAxes(figures, source)


def _of_axis(target: Array, direction: Array, measured: Array, axis: str, source: str) -> AxisFigures:
    """Figures of one axis, whose refusal names the file too."""
    try:
        return axis_figures(target, direction, measured, axis or source)
    except TableError as error:
        raise type(error)(error.what, where=f"{source}, axis {axis}" if axis else source, fix=error.fix) from None


def _require_mm(target: Array, measured: Array, source: str) -> None:
    """Refuse readings in another unit than their targets, by the slope of one over the other."""
    seen = np.isfinite(measured) & np.isfinite(target)
    reach = np.ptp(target[seen]) if seen.any() else 0.0
    spread = {"measured_mm": np.ptp(measured[seen]) if seen.any() else 0.0, "target_mm": reach}
    slope = float(np.polyfit(target[seen], measured[seen], 1)[0]) if reach > 0.0 else 1.0
    for factor, unit in UNITS.items():
        for title, read in (("measured_mm", slope * factor), ("target_mm", factor / slope if slope else 0.0)):
            if abs(read - 1.0) < UNIT_SLIP:
                if unit == "metres" and spread[title] > LARGEST_IN_METRES:  # no axis is as long: the other is in um
                    title, unit = max(spread, key=lambda name: spread[name]), "micrometres"
                what = f"measured_mm rises by {slope:.4g} for each mm of target_mm: {title} looks like {unit}"
                raise TableError(what, where=source, fix=f"give {title} in mm, or its unit in its title")


def _titled(name: object) -> tuple[str, str]:
    """Title of a column without its unit, and the unit; 'mm' where it states none."""
    title = str(name).strip().strip('"').lower()
    unit = next((unit for unit in LENGTHS if title.endswith(f"_{unit}")), "")
    return title.removesuffix(f"_{unit}"), unit or "mm"


@dataclass(frozen=True)
class IsoPoses(Record):
    """ISO 9283 figures of a tracker run, in the tracker's frame and after the rigid motion onto the targets.

    With one frame for all runs only AP and its drift differ between the two. Where every run has a frame of its own,
    RP, AD and RD of poses in several runs do as well: as measured they hold the distances of the frames. All readings
    count, as the standard asks.

    Attributes:
        as_measured: in the tracker's frame.
        aligned: after the motion.
        source: the run's file.
        gross: rows with gross errors, in words.
        without: the aligned figures without these; None where there are none, or no repeated pose is left.
    """

    keys: ClassVar[str] = "source, standard: aligned.standard, as_measured, aligned, gross, without_gross: without"

    as_measured: PoseReport
    aligned: PoseReport
    source: str
    gross: tuple[str, ...] = ()
    without: PoseReport | None = None


def align_to_targets(measured: Array, target: Array, motion: Motion = kabsch) -> Array:
    """Readings moved by the rigid motion that brings them nearest to their targets (Kabsch 1976).

    Args:
        measured: (n, 3) mm, NaN rows allowed.
        target: (n, 3) mm.
        motion: estimator of the motion; `ptt.run.frames.align` leaves gross errors out.

    Returns:
        (n, 3) mm.
    """
    seen = np.isfinite(measured).all(axis=1) & np.isfinite(target).all(axis=1)
    turn, shift = motion(target[seen], measured[seen])
    return (measured - shift) @ turn


def iso_of_poses(
    table: Table, per_run: bool = False, by_direction: bool = True, file: MachineFile | None = None
) -> IsoPoses:
    """ISO 9283 figures of a tracker table.

    Args:
        table: n rows in travel order, with targets.
        per_run: every run has a tracker set-up of its own.
        by_direction: tell the approaches of a pose apart, from the table's directions where it has them, else from the
            order of the commands, else of the targets.
        file: the machine; of an arm whose reflector seat is unknown, the seat is fitted with the frame.

    Returns:
        The figures before and after frame alignment.

    Raises:
        TableError: no targets, or no pose measured twice.
    """
    keep = np.flatnonzero(table.role != "base")
    target, measured, run = table.target[keep], table.measured[keep], table.run[keep]
    if not np.isfinite(target).all(axis=1).any():
        raise TableError("no targets", where=table.source, fix="add x_cmd, y_cmd, z_cmd or name a machine with --model")
    direction = _arrival(table, keep) if by_direction else None
    payload = None if table.payload_kg is None else table.payload_kg[keep]
    set_up = run if per_run else np.zeros_like(run)
    seat = _seats(table, file, table.run if per_run else np.zeros_like(table.run))[keep]
    aligned = _aligned(measured, target + seat, set_up) - seat
    before, after = (pose_report(target, values, direction, payload) for values in (measured, aligned))
    robust = _aligned(measured, target + seat, set_up, align) - seat
    gross = gross_rows(take_rows(table, keep), robust - target)
    off = np.linalg.norm(robust - target, axis=1)
    words = tuple(f"{table.place(int(keep[row]))} ({off[row]:.3g} mm off)" for row in np.flatnonzero(gross))
    without = None
    if words:
        clean = np.where(gross[:, None], np.nan, measured)
        with suppress(TableError):  # no pose is left that was measured twice
            without = pose_report(target, _aligned(clean, target + seat, set_up) - seat, direction, payload)
    return IsoPoses(before, after, table.source, words, without)


def iso_of_problem(problem: Problem) -> IsoPoses:
    """ISO 9283 figures as from `ptt iso`: missing targets are computed from the joint commands."""
    return iso_of_poses(
        placed(problem.file, problem.table), problem.file.tracker.frame == "fitted-per-run", file=problem.file
    )


def _seats(table: Table, file: MachineFile | None, frame: NDArray[np.intp]) -> Array:
    """Offset of the reflector from the tool point, in the axes of the targets, (n, 3) mm; zero where none is fitted."""
    if file is None or (mount_of_rows(file, table) < 0).all():
        return np.zeros_like(table.measured)
    pose = (table.role != "base") & np.isfinite(table.target).all(axis=1) & np.isfinite(table.measured).all(axis=1)
    stated_in = target_frames(file, table)
    place = in_base(table, stated_in).target
    seats = seats_of(table, file, place, table.measured, pose, frame, free=True)
    seat = np.zeros_like(place) if seats is None else seats
    for run, own in enumerate(stated_in):
        here = table.run == run
        seat[here] = own.as_stated(seat[here]) - own.as_stated(np.zeros(3))
    return seat


def _aligned(measured: Array, target: Array, set_up: NDArray[np.intp], motion: Motion = kabsch) -> Array:
    """Readings (n, 3) of each set-up of the tracker moved nearest to their targets."""
    aligned = np.empty_like(measured)
    for code in np.unique(set_up):
        rows = set_up == code
        aligned[rows] = align_to_targets(measured[rows], target[rows], motion)
    return aligned


def _arrival(table: Table, keep: NDArray[np.intp]) -> NDArray[np.int8]:
    """Directions of arrival, (n, k); of a run's first row that of later visits of its pose, where these agree."""
    run = table.run[keep]
    path = (table.target if table.command is None else table.command)[keep]
    starts = np.flatnonzero(np.diff(run, prepend=run[:1] - 1))
    direction = travel_direction(path, starts)
    place = same_places(table.target[keep])
    for first in starts:
        again = np.flatnonzero((run == run[first]) & (place == place[first]) & (np.arange(len(run)) > first))
        sides = np.unique(direction[again], axis=0)
        direction[first] = sides[0] if len(sides) == 1 else direction[first]
    if table.direction is None:
        return direction
    stated = table.direction[keep]
    if stated.shape != direction.shape:  # of an arm's joints, beside targets alone, whose directions are of x, y, z
        direction = np.zeros(stated.shape, dtype=np.int8)
    return np.where(np.isfinite(stated) & (stated != 0), np.nan_to_num(stated), direction).astype(np.int8)
