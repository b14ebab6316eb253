"""Files that are held in one frame of the tracker although it stood elsewhere in one of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.machine import MachineFile, ThreePttSpec
from ptt.setup.judged import thinned
from ptt.setup.proof import BEYOND_FAULTS, FALL
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many, rms
from ptt.setup.rows import LEAST_KNOWN, places
from ptt.setup.setup import Setup

MOVED = 20.0  # mm: homing and links that all change by up to 4 mm from file to file move readings by 10 mm
MOST_ROWS = 400  # of each file: a frame is told by a few dozen


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
    fix = 'write frame = "fitted-per-run" under [tracker] in the machine file, or analyse each file separately'
    own = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted-per-run"}))
    return [Finding("wrong-reflector", words, fix, 1e3 * float(before.max()), 1e3 * float(after.max()), True)], own


def _points(setup: Setup) -> tuple[np.ndarray, np.ndarray]:
    """Places and readings of the rows that have both, (m, 3) mm each."""
    place, reading = places(setup), setup.table.measured
    known = np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1) & (setup.table.role != "base")
    return place[known], reading[known]


def _rms(distance: np.ndarray) -> float:
    """Root mean square without gross errors, mm."""
    return float(rms(distance[None], np.zeros((1, len(distance)), dtype=bool), 0.0)[0])
