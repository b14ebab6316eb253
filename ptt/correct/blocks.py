"""A long list of targets block by block, each from the state in which the one before left the machine.

Rows before and after a block are solved with it, so that its speeds are those of the whole travel, and its directions
where a run has only begun; the state before is handed on (`ptt.correct.task.Handover`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.correct.settle import Outcome, hand_on, settle
from ptt.correct.task import CommandTask, Handover
from ptt.fitting.chunks import CHUNK, NEIGHBOUR_ROWS, stretches
from ptt.run.corners import driven_feed, shows_feed
from ptt.run.direction import STANDSTILL
from ptt.run.table import Table, take_rows
from ptt.run.travel import run_starts

ROWS = CHUNK - 2 * NEIGHBOUR_ROWS  # of a block, which with the rows on both sides is then one chunk


@dataclass(frozen=True)
class RowBlock:
    """Some rows of a task, and the rows before and after that are solved with them.

    Attributes:
        first: its first row.
        last: the row after its last.
        high: the row after the lookahead.
        handover: state handed on by the rows before.
    """

    first: int
    last: int
    high: int
    handover: Handover | None

    @property
    def low(self) -> int:
        """The first row that is solved with it."""
        return self.first - (0 if self.handover is None else len(self.handover.q))

    @property
    def own(self) -> slice:
        """Its own rows among those."""
        return slice(self.first - self.low, self.last - self.low)


@dataclass(frozen=True)
class Settled:
    """An inverted block.

    Attributes:
        block: its rows.
        task: the task of these and of the rows on both sides.
        outcome: commands and status of all of them.
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
        task: its rows, those before that are handed on, and all behind that it may look ahead to.
        first: its first row.
        last: the row after its last.
        handover: state handed on by the rows before.
    """
    block = RowBlock(first, last, _seen_to(task, first, last, handover), handover)
    part = cut(task, block)
    return Settled(block, part, settle(part))


def leave_block(settled: Settled) -> Handover | None:
    """State that a block hands on to the rows behind it."""
    return hand_on(settled.task, settled.outcome.solved, settled.block.own.stop, NEIGHBOUR_ROWS)


def rows_ahead(run: np.ndarray, first: int, last: int, handover: Handover | None) -> int:
    """Largest lookahead of a block: a whole chunk only where a run begins in it.

    Args:
        run: run codes of the rows up to its last, (n,).
        first: its first row.
        last: the row after its last.
        handover: state handed on by the rows before.
    """
    return CHUNK if handover is None or first == 0 or (run[first:last] != run[first - 1]).any() else NEIGHBOUR_ROWS


def cut(task: CommandTask, block: RowBlock) -> CommandTask:
    """The task of a block and the rows on both sides."""
    rows = slice(block.low, block.high)
    if (block.low, block.high) == (0, task.targets.rows):
        return replace(task, handover=block.handover)
    names = ("wanted", "asked", "nominal", "start", "time")
    own = {name: getattr(task, name)[rows] for name in names}
    index = np.arange(block.low, block.high)
    clock = None if task.clock is None else take_rows(task.clock, index)
    return replace(task, targets=take_rows(task.targets, index), clock=clock, handover=block.handover, **own)


def _seen_to(task: CommandTask, first: int, last: int, handover: Handover | None) -> int:
    """End of a block's lookahead: until every joint has moved, where a run begins in it.

    A joint that stands longer than a chunk is taken to arrive upward, as one that never moves.
    """
    run, rows = task.targets.run, task.targets.rows
    high = min(last + NEIGHBOUR_ROWS, rows)
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
