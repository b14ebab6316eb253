"""Readings that are held in one frame of the tracker although it stood elsewhere for a file, or from some row on."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ptt.machine import MachineFile, ThreePttSpec
from ptt.run.table import Table
from ptt.setup.judged import thinned
from ptt.setup.proof import BEYOND_FAULTS, FALL
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many, rms, rms_of_parts
from ptt.setup.rows import LEAST_KNOWN, places
from ptt.setup.setup import Setup

MOVED = 20.0  # mm: homing and links that all change by up to 4 mm from file to file move readings by 10 mm
MOST_ROWS = 400  # of each file: a frame is told by a few dozen
OWN_FRAMES = 'write frame = "fitted-per-run" under [tracker] in the machine file'


def find_stations(setups: Sequence[Setup]) -> tuple[list[Finding], MachineFile]:
    """A tracker that was set up anew between files that share its frame.

    Faults that differ from file to file move readings by millimetres and bend them; a station moves all by more and
    bends nothing, so that frames of their own leave a small part of the error.

    Args:
        setups: the machine with each of its files, mistakes undone.

    Returns:
        At most one finding, and the machine file with a frame for each run where there is one.
    """
    file = setups[-1].file
    if file.tracker.frame != "fitted" or not isinstance(file.machine, ThreePttSpec):
        return [], file
    read = [(setup.table.source, *_points(thinned(setup, MOST_ROWS))) for setup in setups]
    read = [one for one in read if len(one[1]) >= LEAST_KNOWN]
    if len(read) < 2:
        return [], file
    place, reading = (np.concatenate([one[side] for one in read]) for side in (1, 2))
    ends = np.cumsum([len(one[1]) for one in read])[:-1]
    together = np.split(align_many(place[None], reading[None])[2][0], ends)
    apart = [align_many(own[None], seen[None])[2][0] for _, own, seen in read]
    before, after = (np.array([_rms(distance) for distance in distances]) for distances in (together, apart))
    if before.max() < max(MOVED, FALL * after.max()) or after.max() > BEYOND_FAULTS:
        return [], file
    first, other = read[0][0], read[1 + int(np.argmax(before[1:]))][0]
    words = (
        f"the tracker stood elsewhere in {other} than in {first}: with one frame the readings are up to "
        f"{1e3 * before.max():,.0f} um off (rms), with a frame for each file {1e3 * after.max():,.1f} um"
    )
    fix = f"{OWN_FRAMES}, or analyse each file separately"
    found = Finding("wrong-reflector", words, fix, 1e3 * float(before.max()), 1e3 * float(after.max()), True)
    return [found], _with_own_frames(file)


def find_moved(setup: Setup) -> tuple[list[Finding], Setup]:
    """A tracker that was set up anew in the middle of a file whose rows share its frame.

    Args:
        setup: the machine with one file.

    Returns:
        At most one finding, and both files with a run and a frame of its own for what comes after.
    """
    file, table = setup.file, setup.table
    place, reading = places(setup), table.measured
    rows = np.flatnonzero(np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1) & (table.role != "base"))
    if file.tracker.frame != "fitted" or not isinstance(file.machine, ThreePttSpec) or len(rows) < 2 * LEAST_KNOWN:
        return [], setup
    place, reading = place[rows], reading[rows]
    before = _rms(align_many(place[None], reading[None])[2][0])
    if before < MOVED:
        return [], setup
    first = _moved_from(place, reading)
    later = np.arange(len(rows)) >= first
    halves = [align_many(place[None, own], reading[None, own])[2][0] for own in (~later, later)]
    after = rms_of_parts(np.concatenate(halves), later.astype(int))
    if before < FALL * after or after > BEYOND_FAULTS:
        return [], setup
    line, anew = table.line[rows[first]], table.run[rows[first]] != table.run[rows[first - 1]]
    words = (
        f"the tracker stood elsewhere from row {line} on: with one frame the readings are {1e3 * before:,.0f} um off "
        f"(rms), with a frame of their own for the rows from {line} on {1e3 * after:,.1f} um"
    )
    fix = OWN_FRAMES if anew else f"give the rows from {line} on another run in the column run, and {OWN_FRAMES}"
    found = Finding("wrong-reflector", words, fix, 1e3 * before, 1e3 * after, True, table.source)
    apart = setup if anew else setup.with_rows(**_run_of_their_own(table, int(rows[first])))
    return [found], replace(apart, file=_with_own_frames(file))


def _moved_from(place: np.ndarray, reading: np.ndarray) -> int:
    """The row from which on another frame suits readings best, first among some rows, then among all, (m, 3) mm."""
    some = np.unique(np.linspace(0, len(place) - 1, MOST_ROWS).round().astype(int))
    cuts = some[LEAST_KNOWN : len(some) - LEAST_KNOWN + 1]
    before = some < cuts[:, None]
    spread, cost = np.broadcast_to(place[some], (len(cuts), len(some), 3)), np.zeros(len(cuts))
    for own in (before, ~before):
        distance = align_many(spread, np.where(own[..., None], reading[some], np.nan))[2]
        cost += np.nansum(np.minimum(distance, MOVED), axis=1)
    cut = int(cuts[np.argmin(cost)])
    beside = []
    for own in (some < cut, some >= cut):
        turn, shift, _ = align_many(place[None, some[own]], reading[None, some[own]])
        beside.append(np.minimum(np.linalg.norm(reading - place @ turn[0].T - shift[0], axis=1), MOVED))
    change = np.cumsum(beside[0] - beside[1])[LEAST_KNOWN - 1 : len(place) - LEAST_KNOWN]
    return LEAST_KNOWN + int(np.argmin(change))


def _run_of_their_own(table: Table, first: int) -> dict[str, Any]:
    """Columns of a table whose rows from one on are no longer of the run of those before."""
    labels, code = list(table.run_label), table.run[first]
    own = labels[code] or f"before row {table.line[first]}"
    later = (np.arange(table.rows) >= first) & (table.run == code)
    labels = [*labels[:code], own, *labels[code + 1 :], f"{labels[code]} from row {table.line[first]}".strip()]
    digests = table.run_sha256 and (*table.run_sha256, table.run_sha256[code])
    return {
        "run": np.where(later, len(labels) - 1, table.run), "run_label": tuple(labels), "run_sha256": digests,
    }  # fmt: skip


def _with_own_frames(file: MachineFile) -> MachineFile:
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted-per-run"}))


def _points(setup: Setup) -> tuple[np.ndarray, np.ndarray]:
    """Places and readings of the rows that have both, (m, 3) mm each."""
    place, reading = places(setup), setup.table.measured
    known = np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1) & (setup.table.role != "base")
    return place[known], reading[known]


def _rms(distance: np.ndarray) -> float:
    """Root mean square without gross errors, mm."""
    return float(rms(distance[None], np.zeros((1, len(distance)), dtype=bool), 0.0)[0])
