"""Single readings further off than any machine: after a broken beam, of another reflector, with a digit lost."""

import numpy as np

from ptt.fitting.outliers import inside
from ptt.run.same_pose import same_places
from ptt.run.table import Table
from ptt.setup.proof import BEYOND_FAULTS

# Ratio to the error of a reading, from which the error of a neighbouring one says that it is no single gross error.
ALIKE = 0.3


def gross_rows(table: Table, error: np.ndarray) -> np.ndarray:
    """Readings that neither noise nor an error of the machine explains.

    They exceed ordinary faults and are isolated: where neighbouring rows, or other visits of the same pose, are off as
    well, the error belongs to the machine or the set-up.

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
    middle = np.median(size[known])  # `inside` is scale-invariant: any unit will do
    far = known & (size > BEYOND_FAULTS) & ~inside(error / max(float(middle), 1e-9), known)
    return far & (_beside(table.run, size, known) < ALIKE * size) & (_again(table, size) < ALIKE * size)


def _beside(run: np.ndarray, size: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Larger error of the two neighbouring readings in the same run, (n,) mm."""
    rows, found = np.flatnonzero(known), np.zeros(len(size))
    for one, other in ((rows[:-1], rows[1:]), (rows[1:], rows[:-1])):
        found[one] = np.maximum(found[one], np.where(run[one] == run[other], size[other], 0.0))
    return found


def _again(table: Table, size: np.ndarray) -> np.ndarray:
    """Largest error of the other readings of the same pose, (n,) mm."""
    place = same_places(table.target)
    order = np.lexsort((size, place))
    last = np.flatnonzero(np.diff(place[order], append=-1) != 0)  # the largest of each place; before it the next
    first = np.concatenate([[0], last[:-1] + 1])
    second = np.where(last > first, size[order[np.maximum(last - 1, 0)]], 0.0)
    found = size[order[last]][np.searchsorted(place[order[last]], place)]
    found[order[last]] = second
    return found
