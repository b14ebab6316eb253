"""Error figures of parts of a run: by level of a context, and by quarter of the run."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

QUARTERS = 4
MOST_LEVELS = 8  # more payloads than this are put into quarters
TO_UM = 1e3
TO_URAD = 1e6
Unit = Literal["mm", "rad"]


@dataclass(frozen=True)
class PartError:
    """The error on part of the rows.

    Attributes:
        label: 'slider 2', 'slider 2 up', '2.5 kg', 'first quarter'.
        rows: readings.
        rms: root mean square of the values, in `unit`: signed joint errors, or lengths of tool errors.
        mean: their mean.
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


def by_payload(values: np.ndarray, size: np.ndarray) -> tuple[PartError, ...]:
    """Error by level of the payload.

    Args:
        values: (n,) kg; NaN where nobody knows it.
        size: (n,) mm.

    Returns:
        A part for each level, or for each quarter of many levels; empty where there is one level only.
    """
    known = np.isfinite(values)
    values, size = np.round(values[known], 6), size[known]
    levels = np.unique(values)
    if len(levels) < 2:
        return ()
    if len(levels) <= MOST_LEVELS:
        return tuple(part_of(f"{level:g} kg", size[values == level]) for level in levels)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, QUARTERS + 1)))
    number = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    return tuple(part_of(f"{edges[i]:g} to {edges[i + 1]:g} kg", size[number == i]) for i in range(len(edges) - 1))


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


def mean_over_poses(place: np.ndarray, size: np.ndarray) -> tuple[float, float]:
    """Mean and standard error; visits of one pose share their error, so each pose counts once in the latter."""
    number = np.unique(np.round(place, 3), axis=0, return_inverse=True)[1].reshape(-1)
    mean = np.bincount(number, size) / np.bincount(number)
    error = mean.std(ddof=1) / np.sqrt(len(mean)) if len(mean) > 1 else size.std(ddof=1)
    return float(mean.mean()), float(error)
