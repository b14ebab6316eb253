"""Where commands or targets put the tool and where it was read, alike for machines that turn it and that do not."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.setup.arm import LEAST_ROWS as FEWEST_OF_ARM
from ptt.setup.arm_fit import Posed, arm_spec, mount_of, pose_many
from ptt.setup.rigid import align_many
from ptt.setup.rows import LEAST_KNOWN, places, stretches
from ptt.setup.setup import Setup, used_rows

MOST_ROWS = 400  # a frame is told by a few dozen
FAR = 20.0  # mm: how much a row that is further off counts


@dataclass(frozen=True, eq=False)
class Seen:
    """Rows with a place and a reading.

    Attributes:
        rows: (m,) int, of the table.
        reading: (m, 3) mm.
        place: (m, 3) mm, of the drawing's tool point.
        turn: (m, 3, 3), the tool's axes, in which the reflector sits anywhere; None where the tool only translates.
        command: (m, k) rad of an arm's joints; None where the tool only translates.
    """

    rows: np.ndarray
    reading: np.ndarray
    place: np.ndarray
    turn: np.ndarray | None = None
    command: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def least(self) -> int:
        """Rows that a frame of their own needs, lest it fit anything."""
        return LEAST_KNOWN if self.turn is None else FEWEST_OF_ARM

    def take(self, rows: np.ndarray) -> "Seen":
        """Some of them, by index or mask."""
        turn, command = (None if each is None else each[rows] for each in (self.turn, self.command))
        return Seen(self.rows[rows], self.reading[rows], self.place[rows], turn, command)

    def thinned(self) -> "Seen":
        """So many of them as a frame needs."""
        return self.take(spread(len(self)))

    def of_reflector(self, part: np.ndarray) -> np.ndarray:
        """Where the reflector should be, (m, 3) mm, if the tracker stood still in each part, (m,) int."""
        if self.turn is None:
            return self.place
        some = spread(len(self))
        return self._with(mount_of(self._posed(some), self.reading[some], True, part[some]))

    def of_reflector_anyhow(self) -> np.ndarray:
        """The same by the stretch of rows that makes most stretches fit, wherever the tracker stood in the others."""
        if self.turn is None:
            return self.place
        some = spread(len(self))
        posed, reading, kept = self._posed(some), self.reading[some], stretches(len(some), self.least)
        mounts = [mount_of(Posed(posed.place[own], posed.turn[own]), reading[own], True) for own in kept]
        within = np.where(kept[..., None], reading, np.nan)
        left = []
        for mount in mounts:
            place = np.broadcast_to(posed.place + posed.turn @ mount, within.shape)
            left.append(np.nansum(np.minimum(align_many(place, within)[2], FAR)))
        return self._with(mounts[int(np.argmin(left))])

    def _with(self, mount: np.ndarray) -> np.ndarray:
        return self.place + self.turn @ mount

    def _posed(self, rows: np.ndarray) -> Posed:
        assert self.turn is not None
        return Posed(self.place[rows], self.turn[rows])


def see(setup: Setup) -> Seen:
    """The rows of a run that have a place and a reading.

    Args:
        setup: both files.
    """
    table = setup.table
    known = used_rows(table) & np.isfinite(table.measured).all(axis=1)
    if isinstance(setup.file.machine, ThreePttSpec):
        place = places(setup)
        rows = np.flatnonzero(known & np.isfinite(place).all(axis=1))
        return Seen(rows, table.measured[rows], place[rows])
    sent = np.full((table.rows, len(arm_spec(setup).joint)), np.nan) if table.command is None else table.command
    rows = np.flatnonzero(known & np.isfinite(sent).all(axis=1))
    (pose,) = pose_many([(arm_spec(setup), sent[rows])])
    return Seen(rows, table.measured[rows], pose.place, pose.turn, sent[rows])


def joined(parts: Sequence[Seen]) -> tuple[Seen, np.ndarray]:
    """Rows of several files as those of one, and the file of each, (m,) int.

    Args:
        parts: one for each file of one machine.
    """
    columns = {each.name: [getattr(part, each.name) for part in parts] for each in fields(Seen)}
    whole = {name: np.concatenate(column) for name, column in columns.items() if column[0] is not None}
    return Seen(**whole), np.repeat(np.arange(len(parts)), [len(part) for part in parts])


def spread(count: int) -> np.ndarray:
    """So many rows of a run as a frame needs, from the first to the last, as indices."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))


def distances(place: np.ndarray, reading: np.ndarray, part: np.ndarray) -> np.ndarray:
    """How far readings stay from places, (m,) mm, each part, (m,) int, in a frame of its own."""
    distance = np.empty(len(place))
    for each in np.unique(part):
        own = part == each
        distance[own] = align_many(place[None, own], reading[None, own])[2][0]
    return distance
