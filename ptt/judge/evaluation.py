"""Error reduction, eq. 21 of the source paper: P_g = (A_b - A_a)/A_b x 100 %, A the mean absolute error of one axis."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ptt.run.axes import AXES
from ptt.run.noise import Noise

GOALS = {"x": 90.0, "y": 90.0, "z": 80.0}  # percent, of the source paper
MEAN_OF_NORMAL = float(np.sqrt(2.0 / np.pi))  # mean absolute value of a normal error, in standard deviations
SURE = 3.0  # standard deviations of the estimate that an error may exceed the noise by and still count as noise


@dataclass(frozen=True)
class Evaluation:
    """Errors before and after a compensation, and their reduction.

    Attributes:
        before: errors of the rows that count, (m, 3) mm.
        after: errors of the same poses afterwards, (m, 3) mm.
        protocol: which rows, frame and z datum, and whether measured or computed.
        raw: errors before and after without frame alignment, (m, 3) mm each; None where they are computed.
        goals: percent by which the error of each axis should fall.
        noise: noise floor of the readings afterwards.
        unmatched: rows of either run without a counterpart.
        matched: indices of the matched rows in either run, (m,) each; empty where the errors are computed.
        gross: 'before' or 'after' -> rows with gross errors; they count all the same.
        without: errors before and after without those rows and their counterparts, (r, 3) mm each; None where there are
            no such rows, or no others.
    """

    before: np.ndarray
    after: np.ndarray
    protocol: dict[str, Any]
    raw: tuple[np.ndarray, np.ndarray] | None = None
    noise: Noise | None = None
    unmatched: dict[str, list[str]] = field(default_factory=dict)
    goals: Mapping[str, float] = field(default_factory=lambda: GOALS)
    matched: tuple[np.ndarray, np.ndarray] = field(default_factory=lambda: (np.zeros(0, int), np.zeros(0, int)))
    gross: Mapping[str, list[int]] = field(default_factory=dict)
    without: tuple[np.ndarray, np.ndarray] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Figures for JSON: axes, total, protocol; length, unaligned, noise_um, unmatched, outlier_rows beside them."""
        data = compare_errors(self.before, self.after, self.goals) | {"protocol": self.protocol}
        data["rest_is_noise"] = {axis: self.rest_is_noise(index) for index, axis in enumerate(AXES)}
        if self.raw is not None:
            data["unaligned"] = compare_errors(*self.raw, self.goals)
        data["noise_um"] = None if self.noise is None else self.noise.to_dict()
        data["unmatched"] = self.unmatched
        data["outlier_rows"] = {side: list(rows) for side, rows in self.gross.items()}
        return data

    def rest_is_noise(self, axis: int) -> bool | None:
        """Whether the remaining error of an axis is no more than noise; None where the noise is unknown."""
        if self.noise is None:
            return None
        wide = self.noise.sigma[axis] * MEAN_OF_NORMAL  # mean absolute error that noise alone would leave
        # Relative variances: of the mean absolute value of m normal errors, and of the noise floor.
        doubt = np.sqrt((1.0 / MEAN_OF_NORMAL**2 - 1.0) / len(self.after) + 0.5 / self.noise.freedom)
        return bool(np.abs(self.after[:, axis]).mean() <= wide * (1.0 + SURE * doubt))


def compare_errors(before: np.ndarray, after: np.ndarray, goals: Mapping[str, float] = GOALS) -> dict[str, Any]:
    """Mean absolute error per axis before and after, and its reduction.

    Args:
        before: (m, 3) mm.
        after: (m, 3) mm.
        goals: percent per axis.

    Returns:
        'axes' -> x, y, z -> before_um, after_um, reduction_percent, goal_percent, goal_met; alike without goal 'total',
        the root of the axes' summed squares, and 'length', of the error vector's length in each row.
    """
    first, second = (1e3 * np.abs(errors).mean(axis=0) for errors in (before, after))
    axes: dict[str, Any] = {}
    for index, axis in enumerate(AXES):
        axes[axis] = _reduction(float(first[index]), float(second[index])) | {"goal_percent": goals[axis]}
        gained = axes[axis]["reduction_percent"]
        axes[axis]["goal_met"] = gained is not None and gained >= goals[axis]
    total = _reduction(float(np.linalg.norm(first)), float(np.linalg.norm(second)))
    lengths = (1e3 * float(np.linalg.norm(errors, axis=1).mean()) for errors in (before, after))
    return {"axes": axes, "total": total, "length": _reduction(*lengths)}


def _reduction(before: float, after: float) -> dict[str, Any]:
    gained = 100.0 * (before - after) / before if before > 0.0 else None
    return {"before_um": before, "after_um": after, "reduction_percent": gained}
