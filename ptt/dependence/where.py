"""Where a model fails: the worst part of the workspace, the worst rows, and the error by joint, side, load and time."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from ptt.dependence.contexts import residual_views
from ptt.record import Record

if TYPE_CHECKING:
    from ptt.run.problem import Problem

CELLS = 3  # along each axis
WORST = 10
QUARTERS = 4
MOST_LEVELS = 8  # more payloads than this are put into quarters
TO_UM = 1e3
TO_URAD = 1e6

Unit = Literal["mm", "rad"]


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
class PartError:
    """The error on part of the rows.

    Attributes:
        label: 'slider 2', 'slider 2 up', '2.5 kg', 'first quarter'.
        rows: readings.
        rms: root mean square of what is looked at, in `unit`.
        mean: its mean; for sizes of tool errors, the mean size.
        error: standard error of that mean.
        unit: 'mm', or 'rad' for a joint that turns.
    """

    label: str
    rows: int
    rms: float
    mean: float
    error: float
    unit: Unit = "mm"

    def to_dict(self) -> dict[str, object]:
        """Figures for JSON, in um, or urad for an angle; the keys say which."""
        name, factor = ("um", TO_UM) if self.unit == "mm" else ("urad", TO_URAD)
        return {
            "label": self.label,
            "rows": self.rows,
            f"rms_{name}": self.rms * factor,
            f"mean_{name}": self.mean * factor,
            f"standard_error_{name}": self.error * factor,
        }


@dataclass(frozen=True)
class WhereItFails(Record):
    """Where a model fails.

    Attributes:
        region: the cell with the largest error that is well founded, None with too few readings.
        rows: the worst readings, worst first.
        by_joint: joint errors that would cause the residual, a part for each joint.
        by_direction: the same, split by the side of arrival.
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


def where_it_fails(problem: "Problem", residual: np.ndarray) -> WhereItFails:
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
        by_level(payload[seen], size[seen], "kg"),
        by_quarter(size[seen]),
    )


def worst_region(place: np.ndarray, size: np.ndarray) -> Region | None:
    """The cell of the workspace with the largest mean error, less its standard error.

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
        mean, error = _mean_over_poses(place[inside], size[inside])
        corner = low + cell * step
        region = Region(_triple(corner), _triple(corner + span / cells), mean, error, int(inside.sum()))
        if best is None or mean - error > best.mean - best.error:
            best = region
    return best


def part_of(label: str, values: np.ndarray, unit: Unit = "mm") -> PartError:
    """Summarise a part of the rows.

    Args:
        label: its name.
        values: (m,) in the unit.
        unit: 'mm' or 'rad'.

    Returns:
        The part; zeros where it is empty.
    """
    rows = len(values)
    if not rows:
        return PartError(label, 0, 0.0, 0.0, 0.0, unit)
    error = float(values.std(ddof=1) / np.sqrt(rows)) if rows > 1 else float("inf")
    return PartError(label, rows, float(np.sqrt(np.mean(values**2))), float(values.mean()), error, unit)


def by_level(values: np.ndarray, size: np.ndarray, unit: str) -> tuple[PartError, ...]:
    """Error by level of a context.

    Args:
        values: (n,) context.
        size: (n,) mm.
        unit: for the labels.

    Returns:
        A part for each level, or for each quarter of many levels; empty where there is one level only.
    """
    values = np.round(np.nan_to_num(values), 6)
    levels = np.unique(values)
    if len(levels) < 2:
        return ()
    if len(levels) <= MOST_LEVELS:
        return tuple(part_of(f"{level:g} {unit}", size[values == level]) for level in levels)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, QUARTERS + 1)))
    number = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    return tuple(part_of(f"{edges[i]:g} to {edges[i + 1]:g} {unit}", size[number == i]) for i in range(len(edges) - 1))


def by_quarter(size: np.ndarray) -> tuple[PartError, ...]:
    """Error by quarter of the run, rows in travel order.

    Args:
        size: (n,) mm.

    Returns:
        Four parts, fewer of a very short run.
    """
    words = ("first quarter", "second quarter", "third quarter", "last quarter")
    parts = zip(words, np.array_split(size, QUARTERS), strict=True)
    return tuple(part_of(word, values) for word, values in parts if len(values))


def rows_by_size(
    problem: "Problem", residual: np.ndarray, chosen: np.ndarray, most: int | None = None
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


def _mean_over_poses(place: np.ndarray, size: np.ndarray) -> tuple[float, float]:
    """Mean and standard error; visits of one pose share their error, so each pose counts once in the latter."""
    number = np.unique(np.round(place, 3), axis=0, return_inverse=True)[1].reshape(-1)
    mean = np.bincount(number, size) / np.bincount(number)
    error = mean.std(ddof=1) / np.sqrt(len(mean)) if len(mean) > 1 else size.std(ddof=1)
    return float(mean.mean()), float(error)


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
