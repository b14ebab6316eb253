"""ISO 9283 figures of poses measured several times: accuracy, repeatability, variation by direction, distance, drift.

ISO 9283:1998, Manipulating industrial robots: performance criteria and related test methods. Positions only. Lengths
are mm here and um in `to_dict`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ptt.errors import TableError
from ptt.record import Record
from ptt.run.noise import SAME_LOAD
from ptt.run.same_pose import SAME_POSE, number_alike, same_places

Array = NDArray[np.float64]

POSE_CYCLES = 30  # the standard asks for so many cycles
DRIFT_CYCLES = 10  # it looks at drift by groups of so many


@dataclass(frozen=True)
class PoseFigures:
    """One pose approached the same way under the same load in n cycles.

    Attributes:
        target: (3,) commanded position, mm.
        direction: (k,) directions of arrival +1 or -1; empty where they were not told apart.
        payload: kg, NaN where unknown.
        rows: (n,) rows it was measured in, in time order.
        offset: (3,) mean less target, mm.
        accuracy: AP = |offset|, mm.
        repeatability: RP = mean l + 3 s_l with l_j = |x_j - mean|, mm.
    """

    target: Array
    direction: tuple[int, ...]
    payload: float
    rows: NDArray[np.intp]
    offset: Array
    accuracy: float
    repeatability: float

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "target_mm": self.target.tolist(),
            "direction": list(self.direction) or None,
            "payload_kg": None if np.isnan(self.payload) else self.payload,
            "cycles": len(self.rows),
            "offset_um": (1e3 * self.offset).tolist(),
            "AP_um": 1e3 * self.accuracy,
            "RP_um": 1e3 * self.repeatability,
        }


@dataclass(frozen=True)
class DirectionVariation(Record):
    """How far the means of one pose lie apart when it is approached from different sides.

    Attributes:
        target: (3,) mm.
        directions: number of ways of arrival compared.
        variation: vAP, the largest distance between two of the means, mm.
    """

    keys: ClassVar[str] = "target_mm: target, directions, vAP_um: variation [um]"

    target: Array
    directions: int
    variation: float


@dataclass(frozen=True)
class DistanceFigures(Record):
    """Distance between two poses, cycle by cycle.

    Attributes:
        commanded: mm.
        cycles: pairs of readings.
        accuracy: AD = mean distance less commanded, mm, with its sign.
        repeatability: RD = 3 s of the distance, mm.
    """

    keys: ClassVar[str] = "commanded_mm: commanded, cycles, AD_um: accuracy [um], RD_um: repeatability [um]"

    commanded: float
    cycles: int
    accuracy: float
    repeatability: float


@dataclass(frozen=True)
class Drift(Record):
    """Change of one pose's figures over time, by groups of cycles against the first group.

    Attributes:
        target: (3,) mm.
        group: cycles in a group.
        accuracy: dAP = max |AP - AP of the first group|, mm.
        repeatability: dRP likewise, mm.
    """

    keys: ClassVar[str] = "target_mm: target, group_cycles: group, dAP_um: accuracy [um], dRP_um: repeatability [um]"

    target: Array
    group: int
    accuracy: float
    repeatability: float


@dataclass(frozen=True)
class PoseReport:
    """ISO 9283 figures of a run.

    Attributes:
        poses: those measured at least twice, in the order of first visit.
        variations: one per target reached from several sides.
        distances: between poses that follow one another in `poses`, the same way of arrival or not.
        drifts: one per pose with at least four cycles.
        single: number of poses measured once only, left out.
    """

    poses: tuple[PoseFigures, ...]
    variations: tuple[DirectionVariation, ...]
    distances: tuple[DistanceFigures, ...]
    drifts: tuple[Drift, ...]
    single: int

    @property
    def cycles(self) -> int:
        """The fewest cycles of any pose."""
        return min(len(pose.rows) for pose in self.poses)

    @property
    def standard(self) -> str:
        """What these figures may be called."""
        return "ISO 9283:1998" if self.cycles >= POSE_CYCLES else f"ISO style, n = {self.cycles}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON: the figures' mean and worst, then each of them."""
        return {
            "standard": self.standard,
            "cycles": self.cycles,
            "single_poses": self.single,
            "AP_um": _mean_and_worst([pose.accuracy for pose in self.poses]),
            "RP_um": _mean_and_worst([pose.repeatability for pose in self.poses]),
            "vAP_um": _mean_and_worst([one.variation for one in self.variations]),
            "AD_um": _mean_and_worst([one.accuracy for one in self.distances]),
            "RD_um": _mean_and_worst([one.repeatability for one in self.distances]),
            "dAP_um": _mean_and_worst([one.accuracy for one in self.drifts]),
            "dRP_um": _mean_and_worst([one.repeatability for one in self.drifts]),
            "poses": [pose.to_dict() for pose in self.poses],
            "variations": [one.to_dict() for one in self.variations],
            "distances": [one.to_dict() for one in self.distances],
            "drifts": [one.to_dict() for one in self.drifts],
        }


def pose_report(
    target: Array, measured: Array, direction: NDArray[Any] | None = None, payload: Array | None = None
) -> PoseReport:
    """ISO 9283 figures of a run, its rows grouped by target, direction of arrival and payload.

    Args:
        target: (n, 3) commanded positions in travel order, mm.
        measured: (n, 3) mm in the frame of the targets; NaN was not observed.
        direction: (n, k) directions of arrival, +1 or -1; without it approaches are not told apart.
        payload: (n,) kg.

    Returns:
        The figures.

    Raises:
        TableError: no pose was measured twice the same way.
    """
    load = np.full(len(target), np.nan) if payload is None else np.asarray(payload, dtype=np.float64)
    sides = np.zeros((len(target), 0)) if direction is None else np.asarray(direction, dtype=np.float64)
    seen = np.flatnonzero(np.isfinite(measured).all(axis=1) & np.isfinite(target).all(axis=1))
    keys = np.column_stack([same_places(target), number_alike(load, SAME_LOAD), sides])
    groups = [seen[rows] for rows in group_rows(keys[seen])]
    repeated = [rows for rows in groups if len(rows) > 1]
    if not repeated:
        fix = "measure poses repeatedly, each time from the same side"
        raise TableError("no pose was measured twice", fix=fix)
    poses = tuple(_pose(target, measured, sides, load, rows) for rows in repeated)
    return PoseReport(
        poses=poses,
        variations=_variations(poses),
        distances=tuple(
            distance_figures(measured[a.rows], measured[b.rows], a.target, b.target)
            for a, b in pairwise(poses)
            if np.linalg.norm(a.target - b.target) > SAME_POSE
        ),
        drifts=tuple(_drift(pose.target, measured[pose.rows]) for pose in poses if len(pose.rows) >= 4),
        single=len(groups) - len(repeated),
    )


def group_rows(keys: Array) -> list[NDArray[np.intp]]:
    """Rows that share a key.

    Args:
        keys: (n, m).

    Returns:
        Row indices of each group, ascending; groups in the order of their first row.
    """
    if not len(keys):
        return []
    _, first, place = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(place.reshape(-1)))[:-1])
    return [groups[i] for i in np.argsort(first)]


def accuracy_and_repeatability(target: Array, measured: Array) -> tuple[Array, float, float]:
    """AP and RP of one pose.

    Args:
        target: (3,) mm.
        measured: (n, 3) mm, n at least 2.

    Returns:
        Offset of the mean from the target (3,), AP and RP, mm.
    """
    mean = measured.mean(axis=0)
    distance = np.linalg.norm(measured - mean, axis=1)
    offset = mean - target
    return offset, float(np.linalg.norm(offset)), float(distance.mean() + 3.0 * distance.std(ddof=1))


def distance_figures(first: Array, second: Array, first_target: Array, second_target: Array) -> DistanceFigures:
    """Distance accuracy AD and repeatability RD between two poses, the j-th visit of one with the j-th of the other.

    Args:
        first: (n1, 3) readings of one pose, mm.
        second: (n2, 3) readings of the other, mm; visits beyond the shorter of both are left out.
        first_target: (3,) mm.
        second_target: (3,) mm.

    Returns:
        The figures.
    """
    cycles = min(len(first), len(second))
    distance = np.linalg.norm(first[:cycles] - second[:cycles], axis=1)
    commanded = float(np.linalg.norm(first_target - second_target))
    return DistanceFigures(commanded, cycles, float(distance.mean()) - commanded, 3.0 * float(distance.std(ddof=1)))


def _pose(target: Array, measured: Array, sides: Array, load: Array, rows: NDArray[np.intp]) -> PoseFigures:
    offset, accuracy, repeatability = accuracy_and_repeatability(target[rows[0]], measured[rows])
    direction = tuple(int(side) for side in sides[rows[0]])
    return PoseFigures(target[rows[0]], direction, float(load[rows[0]]), rows, offset, accuracy, repeatability)


def _variations(poses: Sequence[PoseFigures]) -> tuple[DirectionVariation, ...]:
    """Targets reached from several sides under one payload."""
    target, load = np.array([pose.target for pose in poses]), np.array([pose.payload for pose in poses])
    keys = np.column_stack([same_places(target), number_alike(load, SAME_LOAD)])
    groups = [[poses[i] for i in rows] for rows in group_rows(keys) if len(rows) > 1]
    return tuple(
        DirectionVariation(
            group[0].target,
            len(group),
            max(float(np.linalg.norm(a.offset - b.offset)) for a, b in combinations(group, 2)),
        )
        for group in groups
    )


def _drift(target: Array, measured: Array) -> Drift:
    """By groups of ten cycles where there are two, else by halves."""
    group = DRIFT_CYCLES if len(measured) >= 2 * DRIFT_CYCLES else len(measured) // 2
    starts = range(0, len(measured) - group + 1, group)
    figures = np.array([accuracy_and_repeatability(target, measured[i : i + group])[1:] for i in starts])
    accuracy, repeatability = np.abs(figures - figures[0]).max(axis=0)
    return Drift(target, group, float(accuracy), float(repeatability))


def _mean_and_worst(values: Sequence[float]) -> dict[str, float] | None:
    """Mean and the value of largest size, um; None for none."""
    if not values:
        return None
    return {"mean": 1e3 * float(np.mean(values)), "worst": 1e3 * float(max(values, key=abs))}


def named_figures(figures: dict[str, Any]) -> list[tuple[str, dict[str, float] | None]]:
    """The figures of a run under the standard's names.

    Args:
        figures: what `ptt iso` gives in JSON for poses.

    Returns:
        Name, and mean and worst over the poses in um, None where the run does not tell them.
    """
    before, after = figures["as_measured"], figures["aligned"]
    return [
        ("accuracy AP, as measured", before["AP_um"]),
        ("accuracy AP, aligned", after["AP_um"]),
        ("repeatability RP", after["RP_um"]),
        ("variation by direction vAP", after["vAP_um"]),
        ("distance accuracy AD", after["AD_um"]),
        ("distance repeatability RD", after["RD_um"]),
        ("drift of AP, aligned", after["dAP_um"]),
        ("drift of RP", after["dRP_um"]),
    ]
