"""A long list of targets block by block, each from the state in which the one before left the machine.

Rows before and after a block are solved with it, so that its speeds are those of the whole travel, and its directions
where a run has only begun; the state before is handed on (`ptt.correct.task.Handover`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.correct.settle import Outcome, hand_on, settle
from ptt.correct.task import CommandTask, rows_of
from ptt.fitting.chunks import CHUNK, NEIGHBOUR_ROWS, stretches
from ptt.run.corners import driven_feed, shows_feed
from ptt.run.direction import STANDSTILL
from ptt.run.table import Table, take_rows
from ptt.run.travel import run_starts

ROWS = CHUNK - 2 * NEIGHBOUR_ROWS  # of a block, which with the rows on both sides is then one chunk


RunsOf = Callable[[int, int], np.ndarray]  # first row, row after the last: their run codes
TaskOf = Callable[[int, int, float], CommandTask]  # the same and the time of the first, s: their task


@dataclass(frozen=True)
class Settled:
    """An inverted block.

    Attributes:
        first: its first row.
        last: the row after its last.
        task: the task of its rows and of those before and after that are solved with them.
        outcome: commands and status of all of these.
    """

    first: int
    last: int
    task: CommandTask
    outcome: Outcome

    @property
    def own(self) -> slice:
        """Its own rows among those of the task."""
        return slice(self.task.given, self.task.given + self.last - self.first)


def settle_task(task: CommandTask) -> Iterator[Settled]:
    """Invert the targets of a task block after block.

    Args:
        task: all targets.

    Yields:
        Each block.
    """
    parts, run = stretches(task.targets.rows, ROWS), task.targets.run
    if len(parts) > 1 and task.clock is not None:
        task = replace(task, clock=with_one_clock(task.clock, shows_feed(task.clock), task.wanted.numpy()))
    return settle_blocks(parts, lambda low, high: run[low:high], lambda low, high, start: cut(task, low, high))


def settle_blocks(parts: Sequence[tuple[int, int]], runs_of: RunsOf, task_of: TaskOf) -> Iterator[Settled]:
    """Invert block after block of a list.

    Args:
        parts: first row of each block, and the row after its last; the list ends with the last block.
        runs_of: gives the runs of some rows.
        task_of: gives the task of some rows.

    Yields:
        Each block.
    """
    handover, start, rows = None, 0.0, parts[-1][1]
    for first, last in parts:
        low = first - rows_of(handover)
        begins = handover is None or bool(np.ptp(runs_of(first - 1, last)))
        high = min(last + (CHUNK if begins else NEIGHBOUR_ROWS), rows)
        task = replace(task_of(low, high, start), handover=handover)
        if begins:
            task = cut(task, 0, _seen_to(task, first - low, last - low))
        settled = Settled(first, last, task, settle(task))
        yield settled
        if last < rows:
            handover = hand_on(task, settled.outcome.solved, settled.own.stop, NEIGHBOUR_ROWS)
            start = float(task.time[settled.own.stop - rows_of(handover)])


def cut(task: CommandTask, low: int, high: int) -> CommandTask:
    """The task of some rows."""
    if (low, high) == (0, task.targets.rows):
        return task
    names = ("wanted", "asked", "in_domain", "nominal", "start", "time")
    own = {name: getattr(task, name)[low:high] for name in names}
    own["behind"] = None if task.behind is None else task.behind[low:high]
    own["contexts"] = {name: values[low:high] for name, values in task.contexts.items()}
    index = np.arange(low, high)
    clock = None if task.clock is None else take_rows(task.clock, index)
    return replace(task, targets=take_rows(task.targets, index), clock=clock, **own)


def _seen_to(task: CommandTask, first: int, last: int) -> int:
    """End of the lookahead of a block in which a run begins: until every joint has moved.

    A joint that stands longer than a chunk is taken to arrive upward, as one that never moves.
    """
    run, rows = task.targets.run, task.targets.rows
    high = min(last + NEIGHBOUR_ROWS, rows)
    if (run[last:high] != run[last - 1]).any():
        return high
    before = np.flatnonzero(run[first:last] != run[last - 1])
    start = first + (int(before[-1]) + 1 if len(before) else 0)
    place = task.nominal[start:high]
    place = place[torch.isfinite(place).all(dim=1)]
    moved = len(place) and bool((place.amax(dim=0) - place.amin(dim=0) > STANDSTILL).all())
    return high if moved else rows


def with_one_clock(table: Table, feed: bool, place: np.ndarray) -> Table:
    """Keep only the column from which speeds of the whole list follow, so that no block falls back on another.

    The clock is kept beside the feed where it shows ramps that the feed does not; each block then uses it for its own
    rows.

    Args:
        table: some rows of the list.
        feed: whether speeds follow from the feed.
        place: targets in the base frame, (n, 3) mm.

    Returns:
        The same rows.
    """
    if feed and table.feed_mm_s is not None:
        length = np.linalg.norm(np.diff(place, axis=0), axis=1)
        _, by_clock = driven_feed(length, run_starts(table.run), table)
        return table.replace(feed_mm_s=np.nan_to_num(table.feed_mm_s), time_s=table.time_s if by_clock.any() else None)
    return table.replace(feed_mm_s=None)
