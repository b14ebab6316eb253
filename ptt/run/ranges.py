"""Between which loads, temperatures and speeds a run was read: what a model fitted on it has seen."""

import numpy as np

from ptt.run.problem import Problem

COLUMNS = ("payload_kg", "temp_c", "feed_mm_s")
QUANTITIES = {"payload_kg": ("payload", "kg"), "temp_c": ("temperature", "degrees C"), "feed_mm_s": ("speed", "mm/s")}
LEAST_BEYOND = {"payload_kg": 0.05, "temp_c": 0.5, "feed_mm_s": 0.5}  # that is worth a word


def ranges_of(problem: Problem) -> dict[str, list[float]]:
    """The range of every context that a run's readings have, as a history keeps it.

    Args:
        problem: the run.

    Returns:
        Column -> lowest and highest value, in the column's unit.
    """
    found = {}
    for column in COLUMNS:
        values = getattr(problem.table, column)
        if values is not None and np.isfinite(values[problem.used]).any():
            found[column] = [float(np.nanmin(values[problem.used])), float(np.nanmax(values[problem.used]))]
    return found
