"""Fresh poses of an arm in the range of its run, by which the sweep judges the commands of a diagnosed model."""

from dataclasses import replace

import numpy as np

from ptt.rig.draw import DrawnRig

DIGITS = 6  # of a command in rad


def fresh_poses(drawn: DrawnRig, seed: int) -> DrawnRig:
    """A rig with other targets of the same kind: postures between those that the run reads one after another.

    Args:
        drawn: an arm and its targets.
        seed: of the places between.

    Returns:
        The same rig; each pose that is read lies between the run's own and the new one before it, and is visited when
        and as often as that, under its load.
    """
    random = np.random.default_rng([seed, 84])
    targets, columns = drawn.targets.copy(), drawn.rig.commanded
    q = targets[columns].to_numpy(float)
    read = np.flatnonzero(targets["read"].to_numpy() != 0) if "read" in targets else np.arange(len(q))
    _, first, which = np.unique(q[read], axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # poses as they come
    pose = q[read][first[order]]
    before = np.roll(pose, 1, axis=0)
    before[0] = pose[min(1, len(pose) - 1)]
    fresh = pose + random.uniform(0.15, 0.85, (len(pose), 1)) * (before - pose)
    moved = q.copy()
    moved[read] = fresh[np.argsort(order)[which.ravel()]]
    # What is passed on the way to a pose stays as far from it as it was.
    passed = np.setdiff1d(np.arange(len(q)), read)
    to = read[np.minimum(np.searchsorted(read, passed), len(read) - 1)]
    moved[passed] = q[passed] + moved[to] - q[to]
    targets[columns] = np.round(moved, DIGITS)
    return replace(drawn, targets=targets)
