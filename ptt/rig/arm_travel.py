"""The path of the joints of an arm through the rows of a run, each run led in."""

import numpy as np

from ptt.rig.motion import Path, first_directions
from ptt.rig.nominal import Array

LEAD_IN = 1.0  # rad of travel before a run's first row: more than play or wind-up of any joint take


def arm_path(q: Array, run: Array | None = None) -> Path:
    """Path of the joints through the rows.

    Each joint is led in to a run's first row: it arrives there in the direction in which it moves first afterwards.

    Args:
        q: (n, k) rad, commands in travel order; each joint moves monotonically between rows.
        run: (n,) number of each row's run; None for a single one.

    Returns:
        The path, its `slider` the joints in rad.
    """
    rows = np.arange(len(q))
    number = np.zeros(len(q), dtype=int) if run is None else run
    first = np.flatnonzero(np.diff(number, prepend=number[:1] - 1))
    before = q[first] - LEAD_IN * first_directions(q[:, None], first)
    last = rows + np.cumsum(np.isin(rows, first))
    passed = np.insert(q, first, before, axis=0)
    return Path(passed, np.insert(rows, first, first), last)
