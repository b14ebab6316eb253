"""ISO 230-2 figures of one axis.

ISO 230-2:2014, Test code for machine tools, part 2: accuracy and repeatability of positioning of numerically controlled
axes. Lengths are mm here and um in `to_dict`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ptt.errors import TableError, TooFewError
from ptt.record import Record

Array = NDArray[np.float64]

AXIS_RUNS = 5  # the standard asks for at least so many runs each way


@dataclass(frozen=True)
class BothWays(Record):
    """One figure from the approaches upward, from those downward, and from both, mm; NaN where not measured."""

    keys: ClassVar[str] = "up: up [um], down: down [um], both: both [um]"

    up: float
    down: float
    both: float


@dataclass(frozen=True)
class AxisFigures:
    """ISO 230-2 figures of one axis with m targets; a direction that was not run holds NaN.

    Attributes:
        axis: its name.
        runs: the fewest runs n at any target and direction.
        target: (m,) mm, ascending.
        mean: (2, m) mean positional deviation upward and downward, mm.
        std: (2, m) estimator of repeatability s, with n - 1, mm.
        reversal: (m,) B_i = mean up - mean down, mm.
        reversal_max: B = max |B_i|, mm.
        reversal_mean: mean of B_i, mm.
        repeatability: R = the largest 4 s one way; both ways max(2 s up + 2 s down + |B_i|, 4 s up, 4 s down), mm.
        systematic: E, range of the means, mm.
        mean_deviation: M, range of the means of both ways, mm.
        accuracy: A = max(mean + 2 s) - min(mean - 2 s), mm.
    """

    axis: str
    runs: int
    target: Array
    mean: Array
    std: Array
    reversal: Array
    reversal_max: float
    reversal_mean: float
    repeatability: BothWays
    systematic: BothWays
    mean_deviation: float
    accuracy: BothWays

    @property
    def standard(self) -> str:
        """What these figures may be called."""
        return "ISO 230-2:2014" if self.runs >= AXIS_RUNS else f"ISO style, n = {self.runs}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON: micrometres under the standard's letters, None where not measured."""
        return {
            "standard": self.standard,
            "axis": self.axis,
            "runs": self.runs,
            "B_um": _um(self.reversal_max),
            "B_mean_um": _um(self.reversal_mean),
            "R_um": self.repeatability.to_dict(),
            "E_um": self.systematic.to_dict(),
            "M_um": _um(self.mean_deviation),
            "A_um": self.accuracy.to_dict(),
            "targets": [
                {
                    "target_mm": float(self.target[i]),
                    "mean_um": {"up": _um(self.mean[0, i]), "down": _um(self.mean[1, i])},
                    "s_um": {"up": _um(self.std[0, i]), "down": _um(self.std[1, i])},
                    "B_um": _um(self.reversal[i]),
                }
                for i in range(len(self.target))
            ],
        }


def axis_figures(target: Array, direction: Array, measured: Array, axis: str = "") -> AxisFigures:
    """ISO 230-2 figures of one axis.

    Args:
        target: (n,) mm.
        direction: (n,) +1 for an approach upward, -1 for one downward; one direction alone will do.
        measured: (n,) mm; NaN was not observed.
        axis: name for messages.

    Returns:
        The figures.

    Raises:
        TableError: a target that lacks a direction which others have, or was run fewer than twice that way.
    """
    seen = np.isfinite(measured)
    targets, place = np.unique(target[seen], return_inverse=True)
    mean, std = np.full((2, len(targets)), np.nan), np.full((2, len(targets)), np.nan)
    fewest = []
    for way, sign in enumerate((1.0, -1.0)):
        rows = direction[seen] == sign
        if not np.any(rows):
            continue
        deviation = (measured[seen] - target[seen])[rows]
        count = np.bincount(place[rows], minlength=len(targets))
        _check_runs(count, targets, ("upward", "downward")[way], axis)
        mean[way] = np.bincount(place[rows], deviation, len(targets)) / count
        square = np.bincount(place[rows], (deviation - mean[way][place[rows]]) ** 2, len(targets))
        std[way] = np.sqrt(square / (count - 1))
        fewest.append(int(count.min()))
    if not fewest:
        raise TableError("no readings", where=axis, fix="measure every target at least twice, up, down or both")
    return _axis_from_moments(axis, min(fewest), targets, mean, std)


def _check_runs(count: NDArray[np.intp], targets: Array, way: str, axis: str) -> None:
    """Refuse a target with fewer than two runs in one direction, which have no standard deviation."""
    few = np.flatnonzero(count < 2)
    if len(few):
        what = f"target {targets[few[0]]:g} mm has {count[few[0]]} run(s) {way}"
        raise TooFewError(what, where=axis, fix="measure every target at least twice each way")


def _axis_from_moments(axis: str, runs: int, target: Array, mean: Array, std: Array) -> AxisFigures:
    """The standard's formulas from means and deviations (2, m), mm."""
    reversal = mean[0] - mean[1]
    one_way = 4.0 * std
    spread = np.maximum(2.0 * std.sum(axis=0) + np.abs(reversal), one_way.max(axis=0))
    high, low = mean + 2.0 * std, mean - 2.0 * std
    middle = mean.mean(axis=0)
    return AxisFigures(
        axis=axis,
        runs=runs,
        target=target,
        mean=mean,
        std=std,
        reversal=reversal,
        reversal_max=float(np.max(np.abs(reversal))),
        reversal_mean=float(np.mean(reversal)),
        repeatability=BothWays(float(one_way[0].max()), float(one_way[1].max()), float(spread.max())),
        systematic=_ranges(mean, mean),
        mean_deviation=float(np.ptp(middle)),
        accuracy=_ranges(high, low),
    )


def _ranges(high: Array, low: Array) -> BothWays:
    """Largest of `high` less smallest of `low`, (2, m) each, per way and over both."""
    per_way = high.max(axis=1) - low.min(axis=1)
    return BothWays(float(per_way[0]), float(per_way[1]), float(high.max() - low.min()))


def _um(value: float) -> float | None:
    """Millimetres to micrometres, None for NaN."""
    return None if np.isnan(value) else 1e3 * float(value)
