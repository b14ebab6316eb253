"""Targets of a run that has joint commands only, where it is compared with a run before it.

Commands of a compensated run differ from those before it on purpose. Where they would put the drawing's tool is no
target: it is off by the correction, and judged against it no compensation does any good.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ptt.machine import MachineFile
from ptt.run.same_pose import SAME_POSE, same_places
from ptt.run.table import Table
from ptt.run.target_frame import in_base, kept_frame, target_frames
from ptt.run.wanted import placed

ROUNDED_MM = 0.1  # commands in thousandths of a degree: 35 um at 2 m, several joints together
NEAR_MM = 5.0  # `ptt predict` corrects by no more, unless told to
MISSING = "give them with --targets T.csv, or name the points as BEFORE does"


@dataclass(frozen=True, eq=False)
class Aimed:
    """Two runs, the second with targets wherever the first or its own commands tell them.

    Attributes:
        before: n rows.
        after: m rows.
        told: rows of `after` whose target is stated, or that of their counterpart or of their pose, (m,) bool.
        lent: how many have the target of their counterpart and other commands.
    """

    before: Table
    after: Table
    told: np.ndarray
    lent: int = 0

    @property
    def untold(self) -> int:
        """How many readings of `after` have commands alone and nothing that tells their target."""
        read = np.isfinite(self.after.measured).all(axis=1)
        return int(np.count_nonzero(read[_posed(self.after)] & ~self.told[_posed(self.after)]))


def aim(before: Table, after: Table, file: MachineFile | None) -> Aimed:
    """Give the rows of the later run that state no target that of their counterpart in the run before.

    Args:
        before: n rows.
        after: m rows, as compensated.
        file: the machine; None: both runs stay as they are.

    Returns:
        Both runs; a row without counterpart has the place where the drawing puts the tool for its target.

    Raises:
        WorkspaceError: commands at which the mechanism cannot be assembled, by line.
    """
    told = np.isfinite(after.target).all(axis=1)
    if file is None:
        return Aimed(before, after, told)
    if told[after.role != "base"].all():
        return Aimed(_as_stated_after(before, after, file), after, told)
    given, own = placed(file, before), placed(file, after)
    place, later = _drawn(file, before), _drawn(file, after)
    first, second = _counterparts(given, own, place, later)
    first, second = first[~told[second]], second[~told[second]]
    target, told = own.target.copy(), told.copy()
    moved = np.linalg.norm(later[second] - place[first], axis=1) > SAME_POSE  # targets may be a workpiece's
    target[second], told[second] = given.target[first], True
    open_ = np.flatnonzero(~told & np.isin(np.arange(own.rows), _posed(own)))
    first, here = _same_pose(given, [place, _stated(file, before)], later[open_])
    target[open_[here]], told[open_[here]] = given.target[first], True
    return Aimed(given, after.replace(target=target), told, int(moved.sum()))


def _as_stated_after(before: Table, after: Table, file: MachineFile) -> Table:
    """The run before with the targets that the run after states, where it has commands alone: these are rounded.

    Args:
        before: n rows.
        after: m rows, each with a target.
        file: the machine.
    """
    given, open_ = placed(file, before), ~np.isfinite(before.target).all(axis=1)
    rows, wanted = np.flatnonzero(open_ & np.isin(np.arange(before.rows), _posed(given))), _stated(file, after)
    if not len(rows):
        return given
    place, target = _drawn(file, before), given.target.copy()
    first, second = _counterparts(given, after, place, wanted)
    own = np.isin(first, rows)
    target[first[own]] = after.target[second[own]]
    rest = np.setdiff1d(rows, first)
    later, here = _same_pose(after, [wanted], place[rest], ROUNDED_MM)
    target[rest[here]] = after.target[later]
    return given.replace(target=target)


def with_frame_of(file: MachineFile, table: Table) -> MachineFile:
    """The machine file with the frame that all runs of a table state their targets in, where they share one.

    Args:
        file: the machine.
        table: rows before a correction: those after it, whose commands tell less, are then taken to be in its frame.
    """
    kept = kept_frame(file.targets, target_frames(file, table, corrected=True))
    return file if kept.frame == "unknown" else replace(file, targets=kept)


def lent_in_words(rows: int) -> str:
    """What is told of rows that are judged against the targets of the run before; '' of none."""
    if not rows:
        return ""
    count = "1 row of AFTER states no target and has" if rows == 1 else f"{rows} rows of AFTER state no target and have"
    return f"{count} other commands than BEFORE: judged against where BEFORE was told to go"


def _drawn(file: MachineFile, table: Table) -> np.ndarray:
    """Where the drawing puts the tool at each row, in the base frame, (n, 3) mm; its target where it has no command."""
    bare = table if table.command is None else table.replace(target=np.full_like(table.target, np.nan))
    place = placed(file, bare).target
    return np.where(np.isfinite(place), place, _stated(file, table))


def _stated(file: MachineFile, table: Table) -> np.ndarray:
    """The targets that a run states, in the base frame, (n, 3) mm."""
    return in_base(table, target_frames(file, table)).target


def _same_pose(
    before: Table, places: list[np.ndarray], later: np.ndarray, within: float = SAME_POSE
) -> tuple[np.ndarray, np.ndarray]:
    """Rows without counterpart that were sent to a pose of another run: indices in that, and of those rows.

    Args:
        before: the other run, n rows.
        places: where its commands put the tool or where its targets are, (n, 3) mm each.
        later: where the commands of the rows put the tool, (m, 3) mm.
        within: largest distance, mm.
    """
    from scipy.spatial import cKDTree  # only where there is something to ask: it takes a while to load

    rows = np.tile(_posed(before), len(places))
    sites = np.concatenate([place[_posed(before)] for place in places])
    rows, sites = rows[np.isfinite(sites).all(axis=1)], sites[np.isfinite(sites).all(axis=1)]
    if not len(rows) or not len(later):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    far, nearest = cKDTree(sites).query(later)
    here = np.flatnonzero(far <= within)
    return rows[nearest[here]], here


def _counterparts(
    before: Table, after: Table, place: np.ndarray, later: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Rows of both runs that are the same pose, by name, else in order.

    Args:
        before: n rows.
        after: m rows.
        place: where the commands of `before` put the tool, (n, 3) mm.
        later: the same of `after`, (m, 3) mm.
    """
    rows = [_posed(table) for table in (before, after)]
    names = set(before.name[rows[0]]) & set(after.name[rows[1]]) - {""}
    first, second = _by_name(before, after, *rows) if names else rows
    if len(first) != len(second) or not len(first):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    near = np.linalg.norm(later[second] - place[first], axis=1) <= NEAR_MM
    # In order, a missing row would shift all the rest.
    ordered = not names and near.all() and _own_is_nearest(before.target[first], place[first], later[second])
    alike = np.mean(near) > 0.5 if names else ordered
    return first[near & alike], second[near & alike]


def _posed(table: Table) -> np.ndarray:
    """Indices of the rows that have a target; whether they were read is all the same to where they were told to go."""
    return np.flatnonzero(np.isfinite(table.target).all(axis=1) & (table.role != "base"))


def _own_is_nearest(target: np.ndarray, place: np.ndarray, later: np.ndarray) -> bool:
    """Whether each row is nearer to the pose of its counterpart than to any other pose.

    Args:
        target: of the run before, (n, 3) mm; equal ones are one pose.
        place: where its commands put the tool, (n, 3) mm.
        later: the same of the run after, row by row, (n, 3) mm.
    """
    from scipy.spatial import cKDTree  # only where there is something to ask: it takes a while to load

    pose, nearest = same_places(target), cKDTree(place).query(later)[1]
    return bool((pose[nearest] == pose).all())


def _by_name(before: Table, after: Table, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of equal names, repeats by their order; of the rows `first` and `second`."""
    row_of = dict(_numbered(after, second))
    pairs = [(row, row_of[key]) for key, row in _numbered(before, first) if key in row_of]
    return np.array([row for row, _ in pairs], dtype=int), np.array([row for _, row in pairs], dtype=int)


def _numbered(table: Table, rows: np.ndarray) -> Iterator[tuple[tuple[str, int], int]]:
    """((name, occurrence), row) of each row that has a name."""
    seen: Counter[str] = Counter()
    for row in rows.tolist():
        name = str(table.name[row])
        if name:
            yield (name, seen[name]), row
            seen[name] += 1
