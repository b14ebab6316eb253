"""A long list of targets block by block: each block goes on where the one before left the machine.

Rows beside a block are looked at with it, so that its speeds are those of the whole travel, and its direction where a
run has only begun; what came before is handed on (`ptt.correct.task.Handover`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.correct.settle import Outcome, hand_on, settle
from ptt.correct.task import CommandTask, Handover
from ptt.fitting.chunks import BESIDE, CHUNK, stretches
from ptt.run.corners import driven_feed, shows_feed
from ptt.run.direction import STANDSTILL
from ptt.run.table import Table, take_rows
from ptt.run.travel import run_starts

ROWS = CHUNK - 2 * BESIDE  # of a block, so that with those beside it is one chunk


@dataclass(frozen=True)
class RowBlock:
    """Some rows of a task, and those beside.

    Attributes:
        first: its first row.
        last: the row after its last.
        high: the row after those looked at with it.
        handover: what the rows before hand on.
    """

    first: int
    last: int
    high: int
    handover: Handover | None

    @property
    def low(self) -> int:
        """The first row looked at with it."""
        return self.first - (0 if self.handover is None else len(self.handover.q))

    @property
    def own(self) -> slice:
        """Its rows among those looked at."""
        return slice(self.first - self.low, self.last - self.low)


@dataclass(frozen=True)
class Settled:
    """A block whose inversion has settled.

    Attributes:
        block: its rows.
        task: that of its rows and those beside.
        outcome: what becomes of these.
    """

    block: RowBlock
    task: CommandTask
    outcome: Outcome


def settle_blocks(task: CommandTask) -> Iterator[Settled]:
    """Invert block after block.

    Args:
        task: all targets.

    Yields:
        Each block.
    """
    handover, table = None, task.targets
    parts = stretches(table.rows, ROWS)
    if len(parts) > 1 and task.clock is not None:
        task = replace(task, clock=with_one_clock(task.clock, shows_feed(task.clock), task.wanted.numpy()))
    for first, last in parts:
        settled = settle_block(task, first, last, handover)
        yield settled
        handover = leave_block(settled) if last < table.rows else None


def settle_block(task: CommandTask, first: int, last: int, handover: Handover | None) -> Settled:
    """Invert one block.

    Args:
        task: it, the rows before it that are handed on, and all behind it that it may look at.
        first: its first row.
        last: the row after its last.
        handover: what the rows before hand on.
    """
    block = RowBlock(first, last, _seen_to(task, first, last, handover), handover)
    part = cut(task, block)
    return Settled(block, part, settle(part))


def leave_block(settled: Settled) -> Handover | None:
    """What a block hands on to the rows behind it."""
    return hand_on(settled.task, settled.outcome.solved, settled.block.own.stop, BESIDE)


def rows_ahead(run: np.ndarray, first: int, last: int, handover: Handover | None) -> int:
    """How many rows behind a block it may look at: many only where a run begins in it.

    Args:
        run: run codes of the rows up to its last, (n,).
        first: its first row.
        last: the row after its last.
        handover: what the rows before hand on.
    """
    return CHUNK if handover is None or first == 0 or (run[first:last] != run[first - 1]).any() else BESIDE


def cut(task: CommandTask, block: RowBlock) -> CommandTask:
    """The task of a block and the rows beside it."""
    rows = slice(block.low, block.high)
    if (block.low, block.high) == (0, task.targets.rows):
        return replace(task, handover=block.handover)
    names = ("wanted", "asked", "nominal", "start", "time")
    own = {name: getattr(task, name)[rows] for name in names}
    index = np.arange(block.low, block.high)
    clock = None if task.clock is None else take_rows(task.clock, index)
    return replace(task, targets=take_rows(task.targets, index), clock=clock, handover=block.handover, **own)


def _seen_to(task: CommandTask, first: int, last: int, handover: Handover | None) -> int:
    """How far a block looks ahead: until each joint of a run that has begun in it was seen to move.

    A joint that stands longer than a chunk is taken to go on upward, as one that never moves.
    """
    run, rows = task.targets.run, task.targets.rows
    high = min(last + BESIDE, rows)
    before = np.flatnonzero(run[first:last] != run[last - 1])
    start = first + (int(before[-1]) + 1 if len(before) else 0)
    begun = handover is None or start > first or run[first] != run[first - 1]
    after = np.flatnonzero(run[last:high] != run[last - 1])
    if not begun or len(after):
        return high
    place = task.nominal[start:high]
    place = place[torch.isfinite(place).all(dim=1)]
    if len(place) and bool((place.amax(dim=0) - place.amin(dim=0) > STANDSTILL).all()):
        return high
    return min(last + CHUNK, rows)


def with_one_clock(table: Table, feed: bool, place: np.ndarray) -> Table:
    """The column alone that tells speeds of the whole list, so that a block without it takes no other.

    A clock stays beside the feed where it shows ramps that the feed does not: each block then asks it for its own rows.

    Args:
        table: some of its rows.
        feed: whether that is the feed.
        place: targets in the base frame, (n, 3) mm.

    Returns:
        The same rows.
    """
    if feed and table.feed_mm_s is not None:
        length = np.linalg.norm(np.diff(place, axis=0), axis=1)
        _, by_clock = driven_feed(length, run_starts(table.run), table)
        return table.replace(feed_mm_s=np.nan_to_num(table.feed_mm_s), time_s=table.time_s if by_clock.any() else None)
    return table.replace(feed_mm_s=None)
