"""Two runs of one machine side by side: the tool's error against its targets before and after, and where it changed."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.errors import TableError
from ptt.judge.aimed import MISSING, aim, lent_in_words, with_frame_of
from ptt.judge.compare.comparison import figures
from ptt.judge.match import match_rows, targets_of
from ptt.judge.run_errors import LEAST_ROWS, errors_of
from ptt.machine import MachineFile
from ptt.run.axes import AXES_TOTAL, rms_length
from ptt.run.same_pose import count_places
from ptt.run.table import Table

PARTS = ("low", "middle", "high")
SHOWN_POSES = 5  # of those that got worse, at most


@dataclass(frozen=True, eq=False)
class Side:
    """The errors of one run.

    Attributes:
        source: names of its files.
        place: targets in the base frame, (m, 3) mm.
        error: reading less target, the tracker's frame taken out as the machine file says, (m, 3) mm.
    """

    source: str
    place: np.ndarray
    error: np.ndarray

    def to_dict(self) -> dict[str, Any]:
        """For JSON: source, number of rows, and figures as of `ptt compare`."""
        return {"source": self.source, "rows": len(self.error), **figures(self.error)}


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """Errors of two runs of one machine, and of the poses that both have.

    Attributes:
        before: the first run.
        after: the second.
        frame: how the tracker's frame was taken out of both.
        shared: error lengths of readings at poses that both runs measured, pair by pair, (s, 2) mm.
        names: of those poses, with file and row, (s,).
        unmatched: number of rows of each run without a counterpart.
        lent: rows of the second run that state no target and are judged against that of their counterpart.
    """

    before: Side
    after: Side
    frame: str
    shared: np.ndarray
    names: tuple[str, ...]
    unmatched: tuple[int, int]
    lent: int = 0

    @property
    def gained(self) -> np.ndarray:
        """Fall of the error length at each shared pose, (s,) mm; negative where it got worse."""
        return np.asarray(self.shared[:, 0] - self.shared[:, 1])

    def to_dict(self) -> dict[str, Any]:
        """Figures for JSON."""
        first, second = self.before.to_dict(), self.after.to_dict()
        fall = {key: _percent(first["rms_um"][key], second["rms_um"][key]) for key in AXES_TOTAL}
        order = np.argsort(self.gained, kind="stable")[:SHOWN_POSES]
        worse = [
            {"row": self.names[i], "before_um": 1e3 * self.shared[i, 0], "after_um": 1e3 * self.shared[i, 1]}
            for i in order
            if self.gained[i] < 0.0
        ]
        return {
            "before": first,
            "after": second,
            "frame": self.frame,
            "reduction_percent": fall,
            "shared_poses": len(self.shared),
            "unmatched": {"before": self.unmatched[0], "after": self.unmatched[1]},
            "targets_from_before": self.lent,
            "nearer_share": float(np.mean(self.gained > 0.0)) if len(self.shared) else None,
            "worse": worse,
            "where": self.where(),
        }

    def where(self) -> list[dict[str, Any]]:
        """Rms errors in thirds of z and in quadrants of x and y, where both runs have readings; um."""
        both = np.concatenate([self.before.place, self.after.place])
        # Each height counts once: most poses may lie in one plane of several.
        heights = np.quantile(np.unique(np.round(both[:, 2], 3)), [1 / 3, 2 / 3])
        middle = np.median(both[:, :2], axis=0)
        parts = []
        for side in (self.before, self.after):
            third = np.searchsorted(heights, side.place[:, 2])
            quarter = (side.place[:, 0] >= middle[0]) + 2 * (side.place[:, 1] >= middle[1])
            parts.append((third, quarter))
        flat = float(np.ptp(both[:, 2])) < 1e-3 * float(np.ptp(both[:, :2]))
        zones = [] if flat else [(f"z {PARTS[i]}", [third == i for third, _ in parts]) for i in range(3)]
        ground = ("x low, y low", "x high, y low", "x low, y high", "x high, y high")
        zones += [(ground[i], [quarter == i for _, quarter in parts]) for i in range(4)]
        return [
            {"where": words, "before_um": _rms_um(self.before, rows[0]), "after_um": _rms_um(self.after, rows[1])}
            for words, rows in zones
            if rows[0].any() and rows[1].any()
        ]


def compare_pair(before: Table, after: Table, file: MachineFile) -> BeforeAfter:
    """Compare two runs of one machine, whether or not they have the same poses.

    Errors are against the targets, since a compensation changes the commands on purpose. Where a row of `after` has
    joint commands only, its target is that of its counterpart; without one it does not count.

    Args:
        before: the first run.
        after: the second.
        file: the machine, whose tracker policy counts for both.

    Returns:
        Both.

    Raises:
        TableError: a run without targets or with too few readings.
    """
    file = with_frame_of(file, before)
    aimed = aim(before, after, file)
    before, after = runs = aimed.before, aimed.after
    if not aimed.told[after.role != "base"].any():
        raise TableError("no targets to judge against", where=after.source, fix=MISSING)
    errors = [errors_of(before, file), errors_of(after, file, rows=aimed.told)]
    found = [np.isfinite(each.aligned).all(axis=1) for each in errors]
    first, second, left = match_rows(before, after, *found)
    places = [targets_of(table, file) for table in runs]
    one, two = (
        Side(table.source, place[rows], each.aligned[rows])
        for table, place, rows, each in zip(runs, places, found, errors, strict=True)
    )
    if any(left.values()) and count_places(places[0][first]) >= LEAST_ROWS:
        # Frames from the shared poses alone: poses of one run only would turn its frame.
        pairs = zip(runs, (first, second), strict=True)
        errors = [errors_of(table, file, rows=np.isin(np.arange(table.rows), own)) for table, own in pairs]
    lengths = [np.linalg.norm(each.aligned[rows], axis=1) for each, rows in zip(errors, (first, second), strict=True)]
    names = tuple(f"{before.place(int(row))} {before.name[row]}".strip() for row in first)
    unmatched = len(left["before"]), len(left["after"]) + aimed.untold
    return BeforeAfter(one, two, errors[0].frame, np.column_stack(lengths), names, unmatched, aimed.lent)


def format_pair(pair: BeforeAfter) -> str:
    """The figures as text."""
    data = pair.to_dict()
    rows = [f"tool against its targets, rms in um ({data['frame']})", f"{'':24}{'x':>9}{'y':>9}{'z':>9}{'total':>9}"]
    for words, key in (("before", "before"), ("after", "after")):
        values = data[key]["rms_um"]
        rows.append(f"{words:<24}" + "".join(f"{values[axis]:>9.1f}" for axis in AXES_TOTAL))
    fall = data["reduction_percent"]
    told = ("-" if fall[axis] is None else f"{fall[axis]:.1f} %" for axis in AXES_TOTAL)
    rows.append(f"{'less by':<24}" + "".join(f"{value:>9}" for value in told))
    rows += [f"{zone['where']:<24}{zone['before_um']:>9.1f} -> {zone['after_um']:.1f}" for zone in data["where"]]
    if data["shared_poses"]:
        share = f"{data['nearer_share']:.0%} of {data['shared_poses']} readings at poses measured in both"
        left = f"rows without a counterpart: {pair.unmatched[0]} before, {pair.unmatched[1]} after"
        rows.append(f"{share} are nearer to their targets; {left}")
    else:
        rows.append("no pose was measured in both: totals and parts of the workspace are compared")
    rows += [words] if (words := lent_in_words(pair.lent)) else []
    rows += [f"worse: {one['row']}, {one['before_um']:.1f} -> {one['after_um']:.1f} um" for one in data["worse"]]
    return "\n".join(rows)


def _percent(before: float, after: float) -> float | None:
    return 100.0 * (1.0 - after / before) if before > 0.0 else None


def _rms_um(side: Side, rows: np.ndarray) -> float:
    return 1e3 * rms_length(side.error[rows])
