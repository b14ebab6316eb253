"""Joints that show nothing of an effect: of seven one may have play, and the others are no evidence against it."""

from math import comb

import numpy as np

SHOWN_ENERGY = 9.0  # three standard errors, squared: of a joint where an effect shows less it may not be at all


def idle_columns(joint: np.ndarray, energy: np.ndarray) -> tuple[np.ndarray, float]:
    """Columns of joints that show nothing of an effect, and the odds against just these joints.

    Args:
        joint: whose value each column is, (m,) int.
        energy: square of each value over its variance were it the only one, (m,).

    Returns:
        (m,) bool, none where all joints show it or none does; and nats.
    """
    shows = np.bincount(joint, energy) > SHOWN_ENERGY
    joints, busy = len(np.unique(joint)), int(shows.sum())
    if not 0 < busy < joints:
        return np.zeros(len(joint), dtype=bool), 0.0
    return ~shows[joint], float(np.log(comb(joints, busy) * joints))
