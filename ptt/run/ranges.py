"""Ranges of load, temperature and speed of a run, which bound the validity of a model fitted to it."""

from collections.abc import Mapping

import numpy as np

from ptt.machine import MachineFile
from ptt.run.problem import Problem

Ranges = Mapping[str, tuple[float, float]]

COLUMNS = ("payload_kg", "temp_c", "feed_mm_s")
QUANTITIES = {"payload_kg": ("payload", "kg"), "temp_c": ("temperature", "degrees C"), "feed_mm_s": ("speed", "mm/s")}
LEAST_BEYOND = {"payload_kg": 0.05, "temp_c": 0.5, "feed_mm_s": 0.5}  # smallest excess over a range that is mentioned


def ranges_of(problem: Problem) -> dict[str, list[float]]:
    """The range of every context of a run's readings, as stored in a machine file's history.

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


def ranges_of_steps(file: MachineFile) -> tuple[Ranges | None, ...]:
    """The ranges of every run that a model was made from, as its history keeps them.

    Args:
        file: the model's.

    Returns:
        Column -> lowest and highest value, for each step, oldest first; None where a step has none. The user's own
        entries of the history are skipped.
    """
    told = [step.get("ranges") for step in file.steps]
    return tuple(ranges if isinstance(ranges, Mapping) else None for ranges in told)


def ranges_of_model(file: MachineFile) -> Ranges | None:
    """The ranges of the last run that a model was fitted to; None where unknown.

    Args:
        file: the model's.
    """
    return (None, *ranges_of_steps(file))[-1]
