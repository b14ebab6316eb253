"""The joints' way through the rows of a run of an arm, each run led in as every machine leads in."""

import numpy as np

from ptt.rig.motion import Path, first_directions
from ptt.rig.nominal import Array

LEAD_IN = 1.0  # rad before a run's first row: longer than any play or wind-up of a joint


def arm_path(q: Array, run: Array | None = None) -> Path:
    """Lay the joints' path through the rows.

    A run's first row is arrived at in the direction in which the second one sets off.

    Args:
        q: (n, k) rad, commands in travel order; each joint runs monotonically between rows.
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
