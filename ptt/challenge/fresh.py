"""Fresh poses of an arm in the range that its run measured."""

from dataclasses import replace

import numpy as np

from ptt.rig.draw import DrawnRig

DIGITS = 6  # of a command in rad


def fresh_poses(drawn: DrawnRig, seed: int) -> DrawnRig:
    """A rig with other targets of the same kind: postures between those that the run read one after another.

    Args:
        drawn: an arm and its targets.
        seed: of the places between.

    Returns:
        The same rig; each pose that is read lies between the run's own and the one read before, under its own load.
    """
    random = np.random.default_rng([seed, 84])
    targets, columns = drawn.targets.copy(), drawn.rig.commanded
    q = targets[columns].to_numpy(float)
    read = np.flatnonzero(targets["read"].to_numpy() != 0) if "read" in targets else np.arange(len(q))
    before = np.roll(read, 1)
    before[0] = read[min(1, len(read) - 1)]
    share = random.uniform(0.15, 0.85, (len(read), 1))
    moved = q.copy()
    moved[read] = q[read] + share * (q[before] - q[read])
    # What is passed on the way to a pose stays as far from it as it was.
    passed = np.setdiff1d(np.arange(len(q)), read)
    to = read[np.minimum(np.searchsorted(read, passed), len(read) - 1)]
    moved[passed] = q[passed] + moved[to] - q[to]
    targets[columns] = np.round(moved, DIGITS)
    return replace(drawn, targets=targets)
