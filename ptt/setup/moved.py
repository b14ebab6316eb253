"""Search for rows from which on the tracker stood elsewhere (once or twice in a file with one tracker frame)."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ptt.machine import MachineFile, SerialSpec, ThreePttSpec
from ptt.mechanisms.serial import Serial
from ptt.run.table import Table
from ptt.setup.arm import BROKEN
from ptt.setup.arm_fit import arm_spec
from ptt.setup.joint_slip import is_slip_of_joint
from ptt.setup.posed_readings import FAR, PosedReadings, distances, posed_readings, sample_rows
from ptt.setup.proof import BEYOND_FAULTS, FALL
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many, rms_of_parts
from ptt.setup.setup import Setup

MOVED = 20.0  # mm: homing and links that all change by up to 4 mm from file to file move readings by 10 mm
MOVED_ARM = 10.0  # mm: a joint that slips by as much distorts the readings, so that no rigid motion fits
MOST_MOVES = 2  # each needs rows enough for a frame of its own
NEAR = 0.25  # of the smallest move that is looked for: rows with a smaller residual belong to one tracker frame
MOST_OF = 0.75  # of the rows of a stretch after a move: some happen to fit the old frame
OWN_FRAMES = 'write frame = "fitted-per-run" under [tracker] in the machine file'


def find_moved(setup: Setup) -> tuple[list[Finding], Setup]:
    """Rows from which on the tracker stood elsewhere.

    Args:
        setup: the machine with one file.

    Returns:
        At most one finding, and both files with the rows after each move as a run with its own tracker frame.
    """
    if setup.file.tracker.frame != "fitted":
        return [], setup
    posed, near = posed_readings(setup), NEAR * bounds(setup)[0]
    if len(posed) < 2 * posed.least:
        return [], setup
    whole, found = np.zeros(len(posed), dtype=int), None
    together = distances(posed.reflector(whole), posed.reading, whole)
    if not _has_dense_stretch(together > near, posed.least):
        return [], setup
    for part in _partitions(posed):
        apart = distances(posed.reflector(part), posed.reading, part)
        before, after = rms_of_parts(together, part), rms_of_parts(apart, part)
        if _is_proof(setup, posed, part, before, after):
            found = _starts_of_parts(part), 1e3 * before, 1e3 * after
            if (apart > near).sum() < posed.least:
                break  # no rows are left that were read from a third place
    return ([], setup) if found is None else _told(setup, posed.rows, *found)


def _has_dense_stretch(far: np.ndarray, least: int) -> bool:
    """Whether some stretch of `least` consecutive rows is mostly off, (m,) bool: gross errors are isolated."""
    return bool(np.convolve(far, np.ones(least)).max(initial=0.0) >= MOST_OF * least)


def _is_proof(setup: Setup, posed: PosedReadings, part: np.ndarray, before: float, after: float) -> bool:
    """Whether a frame for each part, and nothing simpler, reduces the error to that of ordinary faults."""
    least, most = bounds(setup)
    fell = before >= max(least, FALL ** part.max() * after) and after <= most
    return bool(fell and _each_counts(posed, part, after) and not _is_of_joints(setup, posed, part))


def bounds(setup: Setup) -> tuple[float, float]:
    """Least rms of one frame where the tracker was moved, and greatest rms of a frame for each part, mm."""
    if isinstance(setup.file.machine, ThreePttSpec):
        return MOVED, BEYOND_FAULTS
    return MOVED_ARM, BROKEN * Serial.from_spec(arm_spec(setup)).reach_mm


def _told(
    setup: Setup, rows: np.ndarray, at: np.ndarray, before_um: float, after_um: float
) -> tuple[list[Finding], Setup]:
    table, lines = setup.table, " and ".join(str(line) for line in setup.table.line[rows[at]])
    words = (
        f"the tracker stood elsewhere from row {lines.replace(' and ', ' on, and again from row ')} on: with one frame "
        f"the readings are {before_um:,.0f} um off (rms), with a frame of their own for the rows from {lines} on "
        f"{after_um:,.1f} um"
    )
    within = rows[at[table.run[rows[at]] == table.run[rows[at - 1]]]]
    apart = " and those from ".join(f"{line} on" for line in table.line[within])
    each = "another run each" if len(within) > 1 else "another run"
    fix = f"give the rows from {apart} {each} in the column run, and {OWN_FRAMES}" if len(within) else OWN_FRAMES
    found = Finding("wrong-reflector", words, fix, before_um, after_um, True, table.source)
    cured = setup.with_rows(**_columns_with_new_runs(table, within)) if len(within) else setup
    return [found], replace(cured, file=with_own_frames(setup.file))


def _partitions(posed: PosedReadings) -> Iterator[np.ndarray]:
    """Part of each row, (m,) int, with rows divided into two, then three parts at the best change points."""
    part, place = np.zeros(len(posed), dtype=int), posed.reflector_of_best_stretch()
    for _ in range(MOST_MOVES):
        distance = distances(place, posed.reading, part)
        long = [each for each in range(part.max() + 1) if (part == each).sum() >= 2 * posed.least]
        if not long:
            return
        off = max(long, key=lambda each: float(np.minimum(distance[part == each], FAR).sum()))
        part = part + (np.arange(len(part)) >= _change_row(posed, place, part == off))
        yield _refined(posed, place, part)


def _refined(posed: PosedReadings, place: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Parts with each change point searched anew, given the others, then with this partition's reflector offset."""
    part = _repartitioned(posed, place, part) if part.max() > 1 else part
    if posed.turn is None or rms_of_parts(distances(place, posed.reading, part), part) > FAR:
        return part
    return _repartitioned(posed, posed.reflector(part), part)


def _repartitioned(posed: PosedReadings, place: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Parts with the change point between each two neighbours searched anew."""
    for each in range(part.max(), 0, -1):
        both = (part == each) | (part == each - 1)
        first = _change_row(posed, place, both)
        part = np.where(both, each - 1 + (np.arange(len(part)) >= first), part)
    return part


def _change_row(posed: PosedReadings, place: np.ndarray, rows: np.ndarray) -> int:
    """Index of the best change point among some rows, (m,) bool."""
    some = np.flatnonzero(rows)
    return int(some[_change_point(place[some], posed.reading[some], posed.least)])


def _change_point(place: np.ndarray, reading: np.ndarray, least: int) -> int:
    """Row from which on a second tracker frame fits best: first among sampled rows, then among all, (m, 3) mm.

    Distances are capped at FAR, so that gross errors do not decide.
    """
    some = sample_rows(len(place))
    cuts = some[least : len(some) - least + 1]
    before = some < cuts[:, None]
    points, cost = np.broadcast_to(place[some], (len(cuts), len(some), 3)), np.zeros(len(cuts))
    for own in (before, ~before):
        distance = align_many(points, np.where(own[..., None], reading[some], np.nan))[2]
        cost += np.nansum(np.minimum(distance, FAR), axis=1)
    at = least + int(np.argmin(cost))
    beside = []
    for own in (some < some[at], some >= some[at]):
        turn, shift, _ = align_many(place[None, some[own]], reading[None, some[own]])
        beside.append(np.minimum(np.linalg.norm(reading - place @ turn[0].T - shift[0], axis=1), FAR))
    first, last = some[max(at - 1, least)], some[min(at + 1, len(some) - least)]  # rows further on may fit again
    change = np.cumsum(beside[0] - beside[1])[first - 1 : last]
    return int(first + np.argmin(change))


def _rms_of_parts(posed: PosedReadings, part: np.ndarray) -> float:
    """Rms residual with a frame for each part, mm."""
    return rms_of_parts(distances(posed.reflector(part), posed.reading, part), part)


def _starts_of_parts(part: np.ndarray) -> np.ndarray:
    """First row of each part except part 0."""
    return np.flatnonzero(np.diff(part)) + 1


def _each_counts(posed: PosedReadings, part: np.ndarray, after: float) -> bool:
    """Whether each of several parts needs its own frame: merged with the one before, the error is much larger."""
    return all(
        _rms_of_parts(posed, part - (part >= each)) > FALL * after
        for each in range(1, part.max() + 1)
        if part.max() > 1
    )


def _is_of_joints(setup: Setup, posed: PosedReadings, part: np.ndarray) -> bool:
    """Whether a slipped joint of an arm explains one of the changes as well."""
    if not isinstance(setup.file.machine, SerialSpec):
        return False
    spec = setup.file.machine
    beside = [(part == each) | (part == each - 1) for each in range(1, part.max() + 1)]
    return any(
        is_slip_of_joint(
            spec, posed.take(rows), part[rows] == part[rows].max(), _rms_of_parts(posed.take(rows), part[rows])
        )
        for rows in beside
    )


def _columns_with_new_runs(table: Table, firsts: np.ndarray) -> dict[str, Any]:
    """Run columns of a table in which a new run begins at each of the given rows."""
    run, labels, digests = table.run.copy(), list(table.run_label), list(table.run_sha256)
    files = list(table.run_file)
    named = list(table.run_label)
    for first in firsts:
        code = table.run[first]
        labels[code] = named[code] or f"before row {table.line[firsts[0]]}"
        run[(np.arange(table.rows) >= first) & (table.run == code)] = len(labels)
        labels.append(f"{named[code]} from row {table.line[first]}".strip())
        digests += [table.run_sha256[code]] if digests else []
        files += [table.run_file[code]] if files else []
    return {"run": run, "run_label": tuple(labels), "run_sha256": tuple(digests), "run_file": tuple(files)}


def with_own_frames(file: MachineFile) -> MachineFile:
    """A machine file with a tracker frame for each run."""
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted-per-run"}))
