"""Readings with the tool pose at each, for machines with and without rotation of the tool."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.setup.arm import LEAST_ROWS as FEWEST_OF_ARM
from ptt.setup.arm_fit import Posed, arm_spec, mount_of, pose_many
from ptt.setup.rigid import align_many
from ptt.setup.rows import LEAST_KNOWN, places, stretches
from ptt.setup.setup import Setup, used_rows

MOST_ROWS = 400  # for a fit of a frame, which a few dozen determine
FAR = 20.0  # mm, the distance that a row further away counts with: gross errors then do not dominate sums


@dataclass(frozen=True, eq=False)
class PosedReadings:
    """Rows with a tool pose and a reading.

    Attributes:
        rows: (m,) int, of the table.
        reading: (m, 3) mm.
        place: (m, 3) mm, position of the tool point by the drawing.
        turn: (m, 3, 3), rotation of the tool, whose axes the reflector offset is fitted in; None where the tool only
            translates.
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
        """Least rows that determine a frame with redundancy."""
        return LEAST_KNOWN if self.turn is None else FEWEST_OF_ARM

    def take(self, rows: np.ndarray) -> "PosedReadings":
        """Selected rows, by index or mask."""
        turn, command = (None if each is None else each[rows] for each in (self.turn, self.command))
        return PosedReadings(self.rows[rows], self.reading[rows], self.place[rows], turn, command)

    def thinned(self) -> "PosedReadings":
        """A sample of rows that suffices for a frame."""
        return self.take(sample_rows(len(self)))

    def reflector(self, part: np.ndarray) -> np.ndarray:
        """Reflector positions, (m, 3) mm in the base frame, by a fit with one tracker frame for each part, (m,) int."""
        if self.turn is None:
            return self.place
        some = sample_rows(len(self))
        return self._with(mount_of(self._posed(some), self.reading[some], True, part[some]))

    def reflector_of_best_stretch(self) -> np.ndarray:
        """Reflector positions, (m, 3) mm, by the offset that, fitted to one stretch of rows, fits all stretches best.

        Each stretch has a tracker frame of its own, so that the partition need not be known.
        """
        if self.turn is None:
            return self.place
        some = sample_rows(len(self))
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


def posed_readings(setup: Setup) -> PosedReadings:
    """The rows of a run that have a tool pose and a reading.

    Args:
        setup: both files.
    """
    table = setup.table
    known = used_rows(table) & np.isfinite(table.measured).all(axis=1)
    if isinstance(setup.file.machine, ThreePttSpec):
        place = places(setup)
        rows = np.flatnonzero(known & np.isfinite(place).all(axis=1))
        return PosedReadings(rows, table.measured[rows], place[rows])
    sent = np.full((table.rows, len(arm_spec(setup).joint)), np.nan) if table.command is None else table.command
    rows = np.flatnonzero(known & np.isfinite(sent).all(axis=1))
    (pose,) = pose_many([(arm_spec(setup), sent[rows])])
    return PosedReadings(rows, table.measured[rows], pose.place, pose.turn, sent[rows])


def joined(parts: Sequence[PosedReadings]) -> tuple[PosedReadings, np.ndarray]:
    """Rows of several files in one, and the index of each row's file, (m,) int.

    Args:
        parts: one for each file of one machine.
    """
    columns = {each.name: [getattr(part, each.name) for part in parts] for each in fields(PosedReadings)}
    whole = {name: np.concatenate(column) for name, column in columns.items() if column[0] is not None}
    return PosedReadings(**whole), np.repeat(np.arange(len(parts)), [len(part) for part in parts])


def sample_rows(count: int) -> np.ndarray:
    """Indices of evenly spaced rows of `count`, first and last included, that suffice for a frame."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))


def distances(place: np.ndarray, reading: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Distances of readings from places, (m,) mm, after alignment with a frame for each part, (m,) int."""
    distance = np.empty(len(place))
    for each in np.unique(part):
        own = part == each
        distance[own] = align_many(place[None, own], reading[None, own])[2][0]
    return distance
