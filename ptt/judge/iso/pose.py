"""ISO 9283 figures of poses measured several times: accuracy, repeatability, variation by direction, distance, drift.

ISO 9283:1998, Manipulating industrial robots: performance criteria and related test methods. Positions only.
"""

from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ptt.errors import TooFewError
from ptt.judge.iso.pose_figures import Array, DirectionVariation, DistanceFigures, Drift, PoseFigures, PoseReport
from ptt.run.repeats import SAME_LOAD
from ptt.run.same_pose import SAME_POSE, number_alike, same_places

DRIFT_CYCLES = 10  # cycles in a group for the drift, of ISO 9283


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
    asked = np.flatnonzero(np.isfinite(target).all(axis=1))
    seen = np.asarray(np.isfinite(measured).all(axis=1))
    keys = np.column_stack([same_places(target), number_alike(load, SAME_LOAD), sides])
    visits = [asked[rows] for rows in group_rows(keys[asked])]
    counts = [int(seen[rows].sum()) for rows in visits]
    repeated = [rows for rows, count in zip(visits, counts, strict=True) if count > 1]
    if not repeated:
        fix = "measure poses repeatedly, each time from the same side"
        raise TooFewError("no pose was measured twice", fix=fix)
    poses = tuple(_pose(target, measured, sides, load, rows[seen[rows]]) for rows in repeated)
    distances = [
        distance_figures(measured[one], measured[two], a.target, b.target)
        for (one, a), (two, b) in pairwise(zip(repeated, poses, strict=True))
        if np.linalg.norm(a.target - b.target) > SAME_POSE
    ]
    return PoseReport(
        poses=poses,
        variations=_variations(poses),
        distances=tuple(each for each in distances if each is not None),
        drifts=tuple(_drift(pose.target, measured[pose.rows]) for pose in poses if len(pose.rows) >= 4),
        single=counts.count(1),
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


def distance_figures(first: Array, second: Array, first_target: Array, second_target: Array) -> DistanceFigures | None:
    """Distance accuracy AD and repeatability RD between two poses, the j-th visit of one with the j-th of the other.

    Args:
        first: (n1, 3) readings of the visits of one pose, mm; NaN was not observed.
        second: (n2, 3) of the other; visits beyond the shorter of both, or lost in either, are left out.
        first_target: (3,) mm.
        second_target: (3,) mm.

    Returns:
        The figures; None where fewer than two visits of both were observed.
    """
    cycles = min(len(first), len(second))
    distance = np.linalg.norm(first[:cycles] - second[:cycles], axis=1)
    distance, commanded = distance[np.isfinite(distance)], float(np.linalg.norm(first_target - second_target))
    if len(distance) < 2:
        return None
    accuracy = float(distance.mean()) - commanded
    return DistanceFigures(commanded, len(distance), accuracy, 3.0 * float(distance.std(ddof=1)))


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
    """Drift over groups of ten cycles where there are two of them, else over halves."""
    group = DRIFT_CYCLES if len(measured) >= 2 * DRIFT_CYCLES else len(measured) // 2
    starts = range(0, len(measured) - group + 1, group)
    figures = np.array([accuracy_and_repeatability(target, measured[i : i + group])[1:] for i in starts])
    accuracy, repeatability = np.abs(figures - figures[0]).max(axis=0)
    return Drift(target, group, float(accuracy), float(repeatability))
