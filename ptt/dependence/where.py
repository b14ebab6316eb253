"""Where a model fails: worst part of the workspace, worst rows, error by joint, direction of arrival, load and time."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ptt.dependence.contexts import residual_views
from ptt.dependence.parts import PartError, Unit, by_payload, by_quarter, mean_over_poses, part_of
from ptt.record import Record
from ptt.run.problem import Problem

CELLS = 3  # of the workspace along each axis
WORST = 10  # rows that are listed


@dataclass(frozen=True)
class Region(Record):
    """A cell of the workspace.

    Attributes:
        low: (3,) mm, its lowest corner.
        high: (3,) mm.
        mean: mean size of the error in it, mm.
        error: standard error of that mean, mm, repeats of a pose counted as one.
        rows: readings in it.
    """

    keys: ClassVar[str] = "low_mm: low, high_mm: high, mean_um: mean [um], standard_error_um: error [um], rows"

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    mean: float
    error: float
    rows: int


@dataclass(frozen=True)
class WorstRow(Record):
    """One of the worst readings: its run, its line in that run's file, its name, its target and error, mm."""

    keys: ClassVar[str] = "run, line, name, target_mm: target, residual_um: residual [um], size_um: size [um]"

    run: str
    line: int
    name: str
    target: tuple[float, float, float]
    residual: tuple[float, float, float]
    size: float


@dataclass(frozen=True)
class WhereItFails(Record):
    """Where a model fails.

    Attributes:
        region: the cell with the largest mean error less its standard error, None with too few readings.
        rows: the worst readings, worst first.
        by_joint: joint errors that would cause the residual, a part for each joint.
        by_direction: joint errors, a part for each joint and direction of arrival.
        by_payload: size of the tool error by load; empty where it does not vary.
        by_time: size of the tool error by quarter of the run.
    """

    keys: ClassVar[str] = "worst_region: region, worst_rows: rows, by_joint, by_direction, by_payload, by_time"

    region: Region | None
    rows: tuple[WorstRow, ...]
    by_joint: tuple[PartError, ...]
    by_direction: tuple[PartError, ...]
    by_payload: tuple[PartError, ...]
    by_time: tuple[PartError, ...]


def where_it_fails(problem: Problem, residual: np.ndarray) -> WhereItFails:
    """Find where the error is.

    Args:
        problem: n rows.
        residual: (n, 3) mm, base frame, NaN on rows to leave out.

    Returns:
        The places.
    """
    seen = problem.used & np.isfinite(residual).all(axis=1)
    size = np.where(seen, np.linalg.norm(residual, axis=1), np.nan)
    views = {name: values for name, values in residual_views(problem, residual).items() if name[:1] in "sj"}
    direction, moves = problem.view.direction.numpy(), problem.table
    unit: Unit = problem.file.machine.unit
    sides = []
    for index, (name, values) in enumerate(views.items()):
        words = ("up", "down") if name.startswith("slider") else ("forward", "back")
        for sign, word in zip((1.0, -1.0), words, strict=True):
            sides.append(part_of(f"{name} {word}", values[seen & (direction[:, index] == sign)], unit))
    payload = np.zeros(len(size)) if moves.payload_kg is None else np.asarray(moves.payload_kg, dtype=float)
    return WhereItFails(
        worst_region(problem.target[seen], size[seen]),
        rows_by_size(problem, residual, seen, WORST),
        tuple(part_of(name, values[seen], unit) for name, values in views.items()),
        tuple(part for part in sides if part.rows),
        by_payload(payload[seen], size[seen]),
        by_quarter(size[seen]),
    )


def worst_region(place: np.ndarray, size: np.ndarray) -> Region | None:
    """The cell of the workspace with the largest mean error less its standard error.

    Args:
        place: (n, 3) mm.
        size: (n,) mm, error of each reading.

    Returns:
        One of 3 x 3 x 3 cells (fewer along an axis that hardly varies); None where no cell holds four readings.
    """
    if not len(size):
        return None
    low, span = place.min(axis=0), np.ptp(place, axis=0)
    cells = np.where(span > 1e-3 * max(float(span.max()), 1e-9), CELLS, 1)
    step = np.maximum(span / cells, 1e-9)
    index = np.minimum((place - low) // step, cells - 1).astype(int)
    best: Region | None = None
    for cell in np.unique(index, axis=0):
        inside = (index == cell).all(axis=1)
        if inside.sum() < max(4, len(size) // 100):
            continue
        mean, error = mean_over_poses(place[inside], size[inside])
        corner = low + cell * step
        region = Region(_triple(corner), _triple(corner + span / cells), mean, error, int(inside.sum()))
        if best is None or mean - error > best.mean - best.error:
            best = region
    return best


def rows_by_size(
    problem: Problem, residual: np.ndarray, chosen: np.ndarray, most: int | None = None
) -> tuple[WorstRow, ...]:
    """Name chosen rows, the largest error first.

    Args:
        problem: n rows.
        residual: (n, 3) mm.
        chosen: (n,) bool.
        most: how many are wanted; None for all.

    Returns:
        The rows.
    """
    size, table, target = np.linalg.norm(residual, axis=1), problem.table, problem.target
    rows = np.flatnonzero(chosen)
    order = rows[np.argsort(-size[rows], kind="stable")][:most]
    return tuple(
        WorstRow(
            table.run_label[table.run[row]],
            int(table.line[row]),
            str(table.name[row]),
            _triple(target[row]),
            _triple(residual[row]),
            float(size[row]),
        )
        for row in order
    )


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
