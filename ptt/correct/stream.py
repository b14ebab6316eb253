"""A list of targets of any length from disk to commands on disk: in memory are a block and the rows beside it."""

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ptt.correct.blocks import ROWS, leave_block, settle_block, with_one_clock
from ptt.correct.commands import Commands
from ptt.correct.compensate import Correction, Inside, Plan, finish, prepare
from ptt.correct.nearest import Nearest
from ptt.correct.task import Behind, Task, nearest_commands
from ptt.fitting.chunks import BESIDE, CHUNK, stretches
from ptt.progress import Progress
from ptt.run.spool import Spool
from ptt.run.table import Table
from ptt.run.view import elapsed

Aid = Callable[[Table], tuple[Correction | None, Inside | None]]  # what a network adds at some rows, and where it knows


@dataclass(frozen=True)
class Part:
    """Some rows on their way out.

    Attributes:
        first: their first.
        last: the row after their last.
        commands: what to send there.
        wanted: targets in the base frame, (n, 3) mm.
        nominal: their joint values by the drawing, (n, k).
    """

    first: int
    last: int
    commands: Commands
    wanted: Tensor
    nominal: Tensor


class Stream:
    """Commands of a list on disk, worked out once and then there to be read.

    Attributes:
        bounds: first row of each part, and the row after its last.
        sent: whether every row has a command.
    """

    def __init__(self, plan: Plan, spool: Spool, aid: Aid, folder: Path) -> None:
        self._plan, self._spool, self._aid, self._folder = plan, spool, aid, folder
        self.bounds = stretches(spool.rows, ROWS)
        self.sent = True

    def table(self, index: int) -> Table:
        """The targets of a part."""
        return self._spool.take(*self.bounds[index])

    def part(self, index: int) -> Part:
        """A part that was worked out."""
        with self._file(index).open("rb") as file:
            part: Part = pickle.load(file)
        return part

    def invert(self, tell: Progress) -> Iterator[Part]:
        """Work out block after block; rows that are not sent have no nearest command yet."""
        behind, start = None, 0.0
        for index, (first, last) in enumerate(self.bounds):
            low = first - (0 if behind is None else len(behind.q))
            task = self._task(low, self._seen_to(first, last, behind), start)
            settled = settle_block(task, first - low, last - low, behind)
            block, cut, solved, said, moved = settled
            commands = finish(self._plan, cut, block.own, (solved, said, moved), self._aid(cut.targets)[1])
            behind = leave_block(settled)
            start = float(task.time[last - (0 if behind is None else len(behind.q)) - low])
            own = slice(first - low, last - low)
            part = Part(first, last, commands, task.wanted[own].clone(), task.nominal[own].clone())
            self.sent &= bool(commands.sent.all())
            self._keep(index, part)
            tell("invert", last, self._spool.rows)
            yield part

    def find_nearest(self) -> None:
        """Give rows that are not sent the nearest commands that work."""
        for index, (first, last) in enumerate(self.bounds):
            part = self.part(index)
            rows = np.flatnonzero(~part.commands.sent)
            if len(rows):
                nearest, gap = nearest_commands(self._task(first, last, 0.0), rows, self._nearest())
                self._keep(index, replace(part, commands=replace(part.commands, nearest=nearest, nearest_gap=gap)))

    def _task(self, low: int, high: int, start: float) -> Task:
        table = self._spool.take(low, high).replace(command=None)  # it tells the frame of targets, and that is known
        task = prepare(self._plan, table, self._aid(table)[0], elapsed(table) + start)
        if task.clock is None or len(self.bounds) == 1:
            return task
        return replace(task, clock=with_one_clock(task.clock, self._spool.feed))

    def _seen_to(self, first: int, last: int, behind: Behind | None) -> int:
        """A block may look far ahead where a run begins in it: until each of its joints was seen to move."""
        run = self._spool.take(max(first - 1, 0), last).run
        begins = behind is None or first == 0 or bool((run[1:] != run[0]).any())
        return min(last + (CHUNK if begins else BESIDE), self._spool.rows)

    def _nearest(self) -> Nearest:
        """The nearest target that is sent, looked for part by part."""
        from scipy.spatial import cKDTree

        parts = [index for index in range(len(self.bounds)) if self.part(index).commands.sent.any()]
        if not parts:
            return None

        def nearest(goal: Tensor) -> tuple[Tensor, Tensor]:
            least = torch.full((len(goal),), torch.inf, dtype=torch.float64)
            begin, near = torch.empty(len(goal), 3, dtype=torch.float64), None
            for index in parts:
                part = self.part(index)
                rows = torch.as_tensor(np.flatnonzero(part.commands.sent))
                way, found = cKDTree(part.wanted[rows].numpy()).query(goal.numpy())
                distance, here = torch.as_tensor(way), rows[torch.as_tensor(found)]
                near = part.nominal[here] if near is None else near
                better = (distance < least)[:, None]
                begin, near = (
                    torch.where(better, part.wanted[here], begin),
                    torch.where(better, part.nominal[here], near),
                )
                least = torch.minimum(least, distance)
            assert near is not None
            return begin, near

        return nearest

    def _keep(self, index: int, part: Part) -> None:
        with self._file(index).open("wb") as file:
            pickle.dump(part, file, protocol=pickle.HIGHEST_PROTOCOL)

    def _file(self, index: int) -> Path:
        return self._folder / f"commands{index}"
