"""Ranges of load, temperature, speed and time of a run, which bound the validity of a model fitted to it."""

from collections.abc import Mapping

import numpy as np

from ptt.machine import MachineFile
from ptt.run.corners import shows_feed
from ptt.run.problem import Problem
from ptt.run.table import Table
from ptt.run.travel import run_starts
from ptt.run.viewing import elapsed

Ranges = Mapping[str, tuple[float, float]]

QUANTITIES = {
    "payload_kg": ("payload", "kg"), "temp_c": ("temperature", "degrees C"), "feed_mm_s": ("speed", "mm/s"),
    "time_s": ("time", "s"),
}  # fmt: skip
# Smallest excess over a range that is mentioned: what scales, thermometers, programmed feeds and the start of a clock
# leave open. Warming up and drift take many minutes, so they go on through one more.
LEAST_BEYOND = {"payload_kg": 0.05, "temp_c": 0.5, "feed_mm_s": 0.5, "time_s": 60.0}


def ranges_of(problem: Problem) -> dict[str, list[float]]:
    """The range of every context of a run's readings, as stored in a machine file's history.

    Args:
        problem: the run.

    Returns:
        Column -> lowest and highest value, in the column's unit; time from the run's first row on.
    """
    found = {}
    for column, values in contexts_of(problem.table, problem.target).items():
        still = column == "feed_mm_s" and "speed" not in problem.view.varies
        if not still and np.isfinite(values[problem.used]).any():
            found[column] = [float(np.nanmin(values[problem.used])), float(np.nanmax(values[problem.used]))]
    return found


def contexts_of(
    table: Table, place: np.ndarray, time: np.ndarray | None = None, *, by_feed: bool | None = None
) -> dict[str, np.ndarray]:
    """Payload, temperature, speed and time of rows, each where it is told: speed by the clock where no feed is.

    Whether speeds follow from the feed is one answer for the whole list, as for lags (`ptt.run.pace`).

    Args:
        table: n rows.
        place: of the tool, (n, 3) mm, NaN where unknown.
        time: seconds since the first row of the whole list, (n,) s; None: the table is the whole list.
        by_feed: whether the whole list shows a feed; None: the table is the whole list.

    Returns:
        Column -> (n,) in its unit, NaN where unknown.
    """
    told = {"payload_kg": table.payload_kg, "temp_c": table.temp_c}
    if shows_feed(table) if by_feed is None else by_feed:
        told["feed_mm_s"] = table.feed_mm_s
    elif table.time_s is not None:
        told["feed_mm_s"] = _speeds_by_clock(table, place)
    if table.time_s is not None:
        told["time_s"] = elapsed(table).numpy() if time is None else time
    return {column: values for column, values in told.items() if values is not None}


def _speeds_by_clock(table: Table, place: np.ndarray) -> np.ndarray:
    """Mean speed of the tool on the way to each row, (n,) mm/s; NaN at the first of a run and where no time passes."""
    step = np.where(run_starts(table.run), np.nan, np.diff(np.asarray(table.time_s, dtype=float), prepend=np.nan))
    way = np.linalg.norm(np.diff(place, axis=0, prepend=np.full((1, 3), np.nan)), axis=1)
    return np.divide(way, step, out=np.full(table.rows, np.nan), where=step > 0.0)


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
