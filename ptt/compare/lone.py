"""Far readings that stand alone: gross errors, told apart from places where the machine fails each time."""

import numpy as np

from ptt.fit.solve import FitResult
from ptt.holdout import pose_groups
from ptt.problem import Problem

AGREE = 0.5  # share of their size by which two far readings may differ and still tell of the same place


def lone_readings(fitted: FitResult, problem: Problem) -> np.ndarray:
    """Far readings that stand alone: a broken beam, not a place where the machine fails.

    Args:
        fitted: the model with its far rows.
        problem: the readings.

    Returns:
        (n,) bool: far rows that neither the reading before or after nor another visit of the same pose confirms.
    """
    far, error = fitted.outliers, fitted.residual
    if not far.any():
        return far.copy()
    group, confirmed = pose_groups(problem.table), np.zeros(len(far), dtype=bool)
    rows = np.flatnonzero(problem.used)
    for order, of_pose in ((rows, False), (rows[np.argsort(group[rows], kind="stable")], True)):
        one, other = order[:-1], order[1:]
        size = np.linalg.norm(error[one], axis=1), np.linalg.norm(error[other], axis=1)
        alike = np.linalg.norm(error[one] - error[other], axis=1) <= AGREE * np.maximum(*size)
        pair = far[one] & far[other] & alike
        if of_pose:
            pair &= group[one] == group[other]
        confirmed[one[pair]] = confirmed[other[pair]] = True
    return far & ~confirmed
