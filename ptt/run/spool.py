"""A long list of targets on disk, loaded in parts on demand."""

import pickle
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ptt.run.corners import shows_feed
from ptt.run.table import Table, take_rows

KEPT = 3  # parts that stay in memory after they were asked for


class Spool:
    """A list of rows stored as consecutive tables, a file each.

    Attributes:
        rows: number of rows.
        labels: of all runs in order of appearance.
        lines: interpretation of the first part, and warnings on the others.
        feed: whether any part has speeds by its feed.
        commands: whether any part has joint commands.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._firsts: list[int] = []
        self._kept: dict[int, Table] = {}
        self._first_rows = 0
        self.rows = 0
        self.labels: tuple[str, ...] = ()
        self.lines: tuple[str, ...] = ()
        self.feed = False
        self.commands = False

    def add(self, table: Table) -> None:
        """Append a part."""
        self.labels = tuple(dict.fromkeys((*self.labels, *table.run_label)))
        codes = np.array([self.labels.index(label) for label in table.run_label], dtype=np.int64)
        lines = table.understood.lines
        if not self._firsts:
            self.lines, self._first_rows = lines, table.rows
        self.lines += tuple(line for line in lines[1:] if line.startswith("warning") and line not in self.lines)
        self.feed |= shows_feed(table)
        self.commands |= table.command is not None
        part = table.replace(run=codes[table.run])
        with self._file(len(self._firsts)).open("wb") as file:
            pickle.dump(part, file, protocol=pickle.HIGHEST_PROTOCOL)
        self._firsts.append(self.rows)
        self.rows += table.rows

    def understood(self) -> tuple[str, ...]:
        """Interpretation of the whole list, a line each."""
        first, *others = self.lines
        return first.replace(f": {self._first_rows} rows", f": {self.rows} rows", 1), *others

    def take(self, first: int, last: int) -> Table:
        """The rows from the first to the one before the last."""
        bounds = [*self._firsts, self.rows]
        parts = range(int(np.searchsorted(bounds, first, "right")) - 1, int(np.searchsorted(bounds, last, "left")))
        pieces = []
        for part in parts:
            table, start = self._part(part), bounds[part]
            pieces.append(take_rows(table, np.arange(max(first - start, 0), min(last - start, table.rows))))
        return _joined(pieces, self.labels)

    def sample(self, rows: int, stretch: int) -> Table:
        """Evenly spaced stretches of rows, first and last rows included.

        Args:
            rows: number of rows in all.
            stretch: number of rows of each stretch.
        """
        if self.rows <= rows:
            return self.take(0, self.rows)
        firsts = np.linspace(0, self.rows - stretch, rows // stretch).round().astype(int)
        return _joined([self.take(int(first), int(first) + stretch) for first in firsts], self.labels)

    def _part(self, part: int) -> Table:
        if part not in self._kept:
            with self._file(part).open("rb") as file:
                self._kept[part] = pickle.load(file)
            while len(self._kept) > KEPT:
                del self._kept[next(iter(self._kept))]
        return self._kept[part]

    def _file(self, part: int) -> Path:
        return self._folder / f"rows{part}"


def _joined(pieces: Sequence[Table], labels: tuple[str, ...]) -> Table:
    first = pieces[0]
    columns: dict[str, Any] = {}
    for each in fields(first):
        values = [getattr(piece, each.name) for piece in pieces]
        if isinstance(values[0], np.ndarray) and len(values[0]) == first.rows:
            columns[each.name] = np.concatenate(values)
    extra = {title: np.concatenate([piece.extra[title] for piece in pieces]) for title in first.extra}
    digests = (first.run_sha256[0],) * len(labels) if first.run_sha256 else ()
    return replace(first, **columns, extra=extra, run_label=labels, run_sha256=digests)
