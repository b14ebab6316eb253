"""Single readings so far off that no machine is: a beam that broke, another reflector, a digit lost."""

import numpy as np

from ptt.fitting.outliers import inside
from ptt.run.same_pose import same_places
from ptt.run.table import Table

BEYOND_FAULTS = 2.0  # mm: what ordinary faults put into a reading is less, and no reading below is taken for gross


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
    rows, place = np.flatnonzero(known), same_places(table.target)
    beside = np.zeros_like(far)
    for one, other in ((rows[:-1], rows[1:]), (rows[1:], rows[:-1])):
        beside[one] |= (size[other] > BEYOND_FAULTS) & (table.run[one] == table.run[other])
    again = np.bincount(place[known & (size > BEYOND_FAULTS)], minlength=int(place.max()) + 1) > 1
    return np.asarray(far & ~beside & ~again[place])
