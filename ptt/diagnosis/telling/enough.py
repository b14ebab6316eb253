"""Refusal of runs with too few readings for any verdict."""

import numpy as np

from ptt.errors import TooFewError
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem

LEAST_READINGS = 12  # twice what a rigid motion alone takes
# Poses where a frame is free: it takes six of the nine coordinates of three, and any joint fits the others
FRAME_POSES = 4
MOTION_COORDINATES = 6  # coordinates that a rigid motion takes
LEAST_FREE = 3 * LEAST_READINGS - MOTION_COORDINATES  # coordinates that the fewest readings leave beside one frame


def require_enough(problem: Problem) -> None:
    """Refuse a run of too few readings.

    Args:
        problem: the readings.

    Raises:
        TooFewError: too few readings or poses, or too few beside what their frames take.
    """
    count = int(problem.used.sum())
    fix = f"measure at least {LEAST_READINGS} poses, better 100 or more; `ptt plan` lists which"
    if count < LEAST_READINGS:
        raise TooFewError(f"{count} readings are too few for a verdict", where=problem.table.source, fix=fix)
    poses = len(np.unique(pose_groups(problem.table)[problem.used]))
    if poses < (FRAME_POSES if problem.frames else 2):
        raise TooFewError(
            f"{count} readings of {poses} {'pose' if poses == 1 else 'poses'} are too few for a verdict",
            where=problem.table.source,
            fix=f"measure at least {LEAST_READINGS} poses, better 100 or more;"
            " `ptt compare` says what the error there depends on",
        )  # fmt: skip
    each = np.bincount(problem.frame[problem.used], minlength=problem.frames)
    if (
        problem.frames > 1
        and problem.base is None
        and 3 * count - np.minimum(3 * each, MOTION_COORDINATES).sum() < LEAST_FREE
    ):
        frames = np.count_nonzero(each)
        what = f"{count} readings in {frames} frames are too few for a verdict: each frame takes up two of them"
        raise TooFewError(
            what, where=problem.table.source, fix=f"measure more poses without moving the tracker, or {fix}"
        )
