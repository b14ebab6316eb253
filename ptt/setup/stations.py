"""Files that share a tracker frame although the tracker was set up anew between them."""

from collections.abc import Sequence

import numpy as np

from ptt.machine import MachineFile, SerialSpec
from ptt.setup.joint_slip import is_slip_of_joint
from ptt.setup.moved import OWN_FRAMES, bounds, with_own_frames
from ptt.setup.posed_readings import PosedReadings, distances, joined, posed_readings
from ptt.setup.proof import FALL
from ptt.setup.result import Finding
from ptt.setup.rigid import rms_of_parts
from ptt.setup.setup import Setup


def find_stations(setups: Sequence[Setup]) -> tuple[list[Finding], MachineFile]:
    """A tracker that was set up anew between files that share its frame.

    Faults that differ from file to file shift readings by millimetres and distort them; a new station is a larger,
    purely rigid motion, so that a frame for each file removes nearly all of the error.

    Args:
        setups: the machine with each of its files, mistakes undone.

    Returns:
        At most one finding, and the machine file with a frame for each run where there is one.
    """
    file = setups[-1].file
    read = [(setup.table.source, posed_readings(setup).thinned()) for setup in setups if file.tracker.frame == "fitted"]
    read = [one for one in read if len(one[1]) >= one[1].least]
    if len(read) < 2:
        return [], file
    posed, part = joined([one[1] for one in read])
    least, most = bounds(setups[0])
    before, after = (_rms_of_each(posed, each, part) for each in (np.zeros_like(part), part))
    if before.max() < max(least, FALL * after.max()) or after.max() > most or _is_of_a_joint(file, posed, part):
        return [], file
    first, other = read[0][0], read[1 + int(np.argmax(before[1:]))][0]
    words = (
        f"the tracker stood elsewhere in {other} than in {first}: with one frame the readings are up to "
        f"{1e3 * before.max():,.0f} um off (rms), with a frame for each file {1e3 * after.max():,.1f} um"
    )
    fix = f"{OWN_FRAMES}, or analyse each file separately"
    found = Finding("wrong-reflector", words, fix, 1e3 * float(before.max()), 1e3 * float(after.max()), True)
    return [found], with_own_frames(file)


def _rms_of_each(posed: PosedReadings, frame: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Rms residual of each part, mm, without gross errors, with one tracker frame for each value of `frame` (m,)."""
    distance = distances(posed.reflector(frame), posed.reading, frame)
    return np.array([rms_of_parts(distance[part == each], part[part == each]) for each in np.unique(part)])


def _is_of_a_joint(file: MachineFile, posed: PosedReadings, part: np.ndarray) -> bool:
    """Whether another zero of one joint of an arm explains the difference of a file from the first as well."""
    if not isinstance(file.machine, SerialSpec):
        return False
    for each in range(1, part.max() + 1):
        rows = (part == 0) | (part == each)
        two, later = posed.take(rows), part[rows] == each
        if is_slip_of_joint(file.machine, two, later, float(_rms_of_each(two, part[rows], part[rows]).max())):
            return True
    return False
