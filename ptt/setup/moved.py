"""A tracker that was set up anew in the middle of a file whose rows share its frame, once or twice."""

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
from ptt.setup.proof import BEYOND_FAULTS, FALL
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many, rms_of_parts
from ptt.setup.seen import FAR, Seen, distances, see, spread
from ptt.setup.setup import Setup

MOVED = 20.0  # mm: homing and links that all change by up to 4 mm from file to file move readings by 10 mm
MOVED_ARM = 10.0  # mm: a joint that slips by as much bends the readings
MOST_MOVES = 2
NEAR = 0.25  # of what a move comes to: rows that are off by less were read from one place
MOST_OF = 0.75  # of the rows that were read from elsewhere: some are near by chance
OWN_FRAMES = 'write frame = "fitted-per-run" under [tracker] in the machine file'


def find_moved(setup: Setup) -> tuple[list[Finding], Setup]:
    """Rows from which on the tracker stood elsewhere.

    Args:
        setup: the machine with one file.

    Returns:
        At most one finding, and both files with a run and a frame of its own for what comes after.
    """
    if setup.file.tracker.frame != "fitted":
        return [], setup
    seen, near = see(setup), NEAR * bounds(setup)[0]
    if len(seen) < 2 * seen.least:
        return [], setup
    whole, found = np.zeros(len(seen), dtype=int), None
    together = distances(seen.of_reflector(whole), seen.reading, whole)
    if not _many_beside(together > near, seen.least):
        return [], setup
    for part in _partings(seen):
        apart = distances(seen.of_reflector(part), seen.reading, part)
        before, after = rms_of_parts(together, part), rms_of_parts(apart, part)
        if _is_proof(setup, seen, part, before, after):
            found = _firsts(part), 1e3 * before, 1e3 * after
            if (apart > near).sum() < seen.least:
                break  # no rows are left that were read from a third place
    return ([], setup) if found is None else _told(setup, seen.rows, *found)


def _many_beside(far: np.ndarray, least: int) -> bool:
    """Whether most of so many rows beside each other are off, (m,) bool: gross errors stand by themselves."""
    return bool(np.convolve(far, np.ones(least)).max(initial=0.0) >= MOST_OF * least)


def _is_proof(setup: Setup, seen: Seen, part: np.ndarray, before: float, after: float) -> bool:
    """Whether frames of their own, and nothing less, make an error fall to what is usual."""
    least, most = bounds(setup)
    fell = before >= max(least, FALL ** part.max() * after) and after <= most
    return bool(fell and _each_counts(seen, part, after) and not _is_of_joints(setup, seen, part))


def bounds(setup: Setup) -> tuple[float, float]:
    """What one frame leaves at least where the tracker was moved, and frames of their own at most, mm."""
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
    cured = setup.with_rows(**_runs_of_their_own(table, within)) if len(within) else setup
    return [found], replace(cured, file=with_own_frames(setup.file))


def _partings(seen: Seen) -> Iterator[np.ndarray]:
    """Rows parted where another frame suits them best, (m,) int: in two, in three."""
    part, place = np.zeros(len(seen), dtype=int), seen.of_reflector_anyhow()
    for _ in range(MOST_MOVES):
        distance = distances(place, seen.reading, part)
        long = [each for each in range(part.max() + 1) if (part == each).sum() >= 2 * seen.least]
        if not long:
            return
        off = max(long, key=lambda each: float(np.minimum(distance[part == each], FAR).sum()))
        part = part + (np.arange(len(part)) >= _first_of_another(seen, place, part == off))
        yield _once_more(seen, place, part)


def _once_more(seen: Seen, place: np.ndarray, part: np.ndarray) -> np.ndarray:
    """The same, each of several sought beside the others, and by where the reflector sits once all hold together."""
    part = _parted_anew(seen, place, part) if part.max() > 1 else part
    if seen.turn is None or rms_of_parts(distances(place, seen.reading, part), part) > FAR:
        return part
    return _parted_anew(seen, seen.of_reflector(part), part)


def _parted_anew(seen: Seen, place: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Where another frame suits rows best, of two parts beside each other at a time."""
    for each in range(part.max(), 0, -1):
        both = (part == each) | (part == each - 1)
        first = _first_of_another(seen, place, both)
        part = np.where(both, each - 1 + (np.arange(len(part)) >= first), part)
    return part


def _first_of_another(seen: Seen, place: np.ndarray, rows: np.ndarray) -> int:
    """Of some rows, (m,) bool, the one from which on another frame suits them best."""
    some = np.flatnonzero(rows)
    return int(some[_moved_from(place[some], seen.reading[some], seen.least)])


def _moved_from(place: np.ndarray, reading: np.ndarray, least: int) -> int:
    """The row from which on another frame suits readings best, first among some rows, then among all, (m, 3) mm."""
    some = spread(len(place))
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


def _left(seen: Seen, part: np.ndarray) -> float:
    """What stays with a frame for each part, mm rms."""
    return rms_of_parts(distances(seen.of_reflector(part), seen.reading, part), part)


def _firsts(part: np.ndarray) -> np.ndarray:
    """Where parts begin, but for the first."""
    return np.flatnonzero(np.diff(part)) + 1


def _each_counts(seen: Seen, part: np.ndarray, after: float) -> bool:
    """Whether no part does as well in the frame of the one before."""
    return all(_left(seen, part - (part >= each)) > FALL * after for each in range(1, part.max() + 1) if part.max() > 1)


def _is_of_joints(setup: Setup, seen: Seen, part: np.ndarray) -> bool:
    """Whether a joint of an arm that slipped leaves as little at some of the rows."""
    if not isinstance(setup.file.machine, SerialSpec):
        return False
    spec = setup.file.machine
    beside = [(part == each) | (part == each - 1) for each in range(1, part.max() + 1)]
    return any(
        is_slip_of_joint(spec, seen.take(rows), part[rows] == part[rows].max(), _left(seen.take(rows), part[rows]))
        for rows in beside
    )


def _runs_of_their_own(table: Table, firsts: np.ndarray) -> dict[str, Any]:
    """Columns of a table whose rows from some on are no longer of the run of those before."""
    run, labels, digests = table.run.copy(), list(table.run_label), list(table.run_sha256)
    named = list(table.run_label)
    for first in firsts:
        code = table.run[first]
        labels[code] = named[code] or f"before row {table.line[firsts[0]]}"
        run[(np.arange(table.rows) >= first) & (table.run == code)] = len(labels)
        labels.append(f"{named[code]} from row {table.line[first]}".strip())
        digests += [table.run_sha256[code]] if digests else []
    return {"run": run, "run_label": tuple(labels), "run_sha256": tuple(digests)}


def with_own_frames(file: MachineFile) -> MachineFile:
    """A machine file with a frame of the tracker for each run."""
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted-per-run"}))
