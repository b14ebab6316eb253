"""A list of targets of any length, from disk to commands on disk, with one block and its neighbours in memory."""

import pickle
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ptt.correct.blocks import ROWS, settle_blocks, with_one_clock
from ptt.correct.commands import Commands
from ptt.correct.compensate import Inside, InversionPlan, finish, prepare
from ptt.correct.nearest import Nearest, nearest_of
from ptt.correct.settle import nearest_commands
from ptt.correct.task import CommandTask, Correction
from ptt.fitting.chunks import stretches
from ptt.progress import Progress
from ptt.run.spool import Spool
from ptt.run.table import Table
from ptt.run.viewing import elapsed


@dataclass(frozen=True)
class Part:
    """Commands of some rows.

    Attributes:
        first: the first of the rows.
        last: the row after their last.
        commands: their commands.
        wanted: targets in the base frame, (n, 3) mm.
        nominal: their joint values by the drawing, (n, k).
        contexts: their payload, temperature, speed and time (`contexts_of`), each (n,).
    """

    first: int
    last: int
    commands: Commands
    wanted: Tensor
    nominal: Tensor
    contexts: Mapping[str, np.ndarray]


class Stream:
    """Commands of a list on disk, computed once and then read part by part.

    Attributes:
        bounds: first row of each part, and the row after its last.
        starts: time of the first row of each part that was computed, s since the first row of the list.
        sent: whether every row has a command.
    """

    def __init__(
        self, plan: InversionPlan, spool: Spool, correction: Correction | None, inside: Inside | None, folder: Path
    ) -> None:
        self._plan, self._spool, self._folder = plan, spool, folder
        self._correction, self._inside = correction, inside
        self.bounds = stretches(spool.rows, ROWS)
        self.starts: list[float] = []
        self.sent = True

    def table(self, index: int) -> Table:
        """The targets of a part."""
        return self._spool.take(*self.bounds[index])

    def part(self, index: int) -> Part:
        """A part that was computed."""
        with self._file(index).open("rb") as file:
            part: Part = pickle.load(file)
        return part

    def invert(self, tell: Progress) -> Iterator[Part]:
        """Compute block after block; rows that are not sent have no nearest command yet."""
        for index, settled in enumerate(settle_blocks(self.bounds, self._runs, self._task)):
            task, own = settled.task, settled.own
            self.starts.append(float(task.time[own.start]))
            commands = finish(self._plan, settled)
            contexts = {name: values[own].copy() for name, values in task.contexts.items()}
            wanted, nominal = task.wanted[own].clone(), task.nominal[own].clone()
            part = Part(settled.first, settled.last, commands, wanted, nominal, contexts)
            self.sent &= bool(commands.sent.all())
            self._keep(index, part)
            tell("invert", settled.last, self._spool.rows)
            yield part

    def find_nearest(self) -> None:
        """Give rows that are not sent the nearest commands that can be."""
        near = self._nearest()
        for index, (first, last) in enumerate(self.bounds):
            part = self.part(index)
            rows = np.flatnonzero(~part.commands.sent)
            if len(rows):
                nearest, gap = nearest_commands(self._task(first, last, self.starts[index]), rows, near)
                self._keep(index, replace(part, commands=replace(part.commands, nearest=nearest, nearest_gap=gap)))

    def _task(self, low: int, high: int, start: float) -> CommandTask:
        table = self._spool.take(low, high).replace(command=None)  # it tells the frame of targets, and that is known
        parts, time = (self._correction, self._inside), elapsed(table) + start
        task = prepare(self._plan, table, *parts, time, by_feed=self._spool.feed)
        if task.clock is None or len(self.bounds) == 1:
            return task
        return replace(task, clock=with_one_clock(task.clock, self._spool.feed, task.wanted.numpy()))

    def _runs(self, first: int, last: int) -> np.ndarray:
        return self._spool.take(first, last).run

    def _nearest(self) -> Nearest:
        """Nearest-neighbour search among the targets of all parts that are sent."""
        parts = [index for index in range(len(self.bounds)) if self.part(index).commands.sent.any()]

        def nearest(goal: Tensor) -> tuple[Tensor, Tensor]:
            best: tuple[Tensor, Tensor] | None = None
            for index in parts:
                part = self.part(index)
                find = nearest_of(part.wanted, part.nominal, part.commands.sent)
                assert find is not None
                best = find(goal) if best is None else _nearer(goal, best, find(goal))
            assert best is not None
            return best

        return nearest if parts else None

    def _keep(self, index: int, part: Part) -> None:
        with self._file(index).open("wb") as file:
            pickle.dump(part, file, protocol=pickle.HIGHEST_PROTOCOL)

    def _file(self, index: int) -> Path:
        return self._folder / f"commands{index}"


def _nearer(goal: Tensor, one: tuple[Tensor, Tensor], other: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """Of two places for each goal (m, 3), with their joint values, the nearer one."""
    closer = ((other[0] - goal).norm(dim=1) < (one[0] - goal).norm(dim=1))[:, None]
    return torch.where(closer, other[0], one[0]), torch.where(closer, other[1], one[1])
