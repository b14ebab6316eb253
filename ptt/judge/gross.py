"""Single readings so far off that no machine is: a beam that broke, another reflector, a digit lost."""

import numpy as np

from ptt.fitting.outliers import inside
from ptt.run.same_pose import same_places
from ptt.run.table import Table
from ptt.setup.proof import BEYOND_FAULTS

ALIKE = 0.3  # of its size: where a reading beside it is off by as much, what is off there is no single reading


def gross_rows(table: Table, error: np.ndarray) -> np.ndarray:
    """Readings that neither noise nor a machine explains.

    They are exceptions, beyond what ordinary faults do, and stand alone: rows in a row, or another visit of the same
    pose, that are off as well are the machine's or the set-up's.

    Args:
        table: n rows in travel order.
        error: measured less target, readings brought into the targets' frame, (n, 3) mm; NaN where that is not known.

    Returns:
        (n,) bool.
    """
    known = np.isfinite(error).all(axis=1)
    size = np.where(known, np.sqrt(np.square(np.nan_to_num(error)).sum(axis=1)), 0.0)
    if not (size > BEYOND_FAULTS).any():
        return np.zeros(table.rows, dtype=bool)
    middle = np.median(size[known])  # the rule widens with the bulk: any unit will do
    far = known & (size > BEYOND_FAULTS) & ~inside(error / max(float(middle), 1e-9), known)
    return far & (_beside(table.run, size, known) < ALIKE * size) & (_again(table, size) < ALIKE * size)


def _beside(run: np.ndarray, size: np.ndarray, known: np.ndarray) -> np.ndarray:
    """How far the readings before and after each are off, the larger, (n,) mm; of the same run."""
    rows, found = np.flatnonzero(known), np.zeros(len(size))
    for one, other in ((rows[:-1], rows[1:]), (rows[1:], rows[:-1])):
        found[one] = np.maximum(found[one], np.where(run[one] == run[other], size[other], 0.0))
    return found


def _again(table: Table, size: np.ndarray) -> np.ndarray:
    """How far the other readings of the same pose are off, the largest, (n,) mm."""
    place = same_places(table.target)
    order = np.lexsort((size, place))
    last = np.flatnonzero(np.diff(place[order], append=-1) != 0)  # the largest of each place; before it the next
    first = np.concatenate([[0], last[:-1] + 1])
    second = np.where(last > first, size[order[np.maximum(last - 1, 0)]], 0.0)
    found = size[order[last]][np.searchsorted(place[order[last]], place)]
    found[order[last]] = second
    return found
