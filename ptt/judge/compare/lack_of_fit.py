"""Lack of fit: whether a model misses more than readings of the same pose scatter."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.run.axes import AXES
from ptt.run.holdout import visit_groups
from ptt.run.means import group_means
from ptt.run.problem import Problem
from ptt.run.repeats import ENOUGH, first_of_copies, first_rows, repeat_groups
from ptt.run.tails import f_sf


@dataclass(frozen=True)
class LackOfFit:
    """F test of lack of fit against pure error: does the model miss more than repeats scatter?

    Source: Draper and Smith, Applied Regression Analysis, 3rd ed. (1998), section 2.1; one test per axis, Bonferroni.

    Attributes:
        f: ratio of mean squares on x, y, z; None where repeats are too few.
        p_value: smallest of the three p-values, times three; None likewise.
        freedom: degrees of freedom of one axis: of lack of fit, of pure error.
    """

    f: tuple[float, float, float] | None
    p_value: float | None
    freedom: tuple[float, float]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        reason = None if self.f else f"repeats leave {self.freedom[1]:.0f} degrees of freedom, but {ENOUGH} are needed"
        return {
            "f": None if self.f is None else dict(zip(AXES, self.f, strict=True)),
            "p_value": self.p_value,
            "freedom": {"lack_of_fit": self.freedom[0], "pure_error": self.freedom[1]},
            "untested_because": reason,
        }


def lack_of_fit_of(
    problem: Problem, residual: np.ndarray, fitted: int = 0, *, from_any_side: bool = False
) -> LackOfFit:
    """Test a residual against the scatter of true repeats, with one reading of each visit.

    Readings within a visit share the machine's scatter between visits: as repeats they would understate pure error.

    Args:
        problem: the readings.
        residual: (n, 3) mm, NaN on rows to leave out.
        fitted: number of parameters fitted to the rows.
        from_any_side: also count visits from different sides as repeats. These scatter at least as much, so a
            significant lack of fit remains one, but its absence says little.

    Returns:
        The test; without a figure where repeats leave fewer than 30 degrees of freedom.
    """
    ways = problem.view.direction.numpy()
    group = repeat_groups(problem.table, np.zeros_like(ways) if from_any_side else ways)
    rows = np.isfinite(residual).all(axis=1) & first_of_copies(problem.table, group)
    rows &= first_rows(visit_groups(problem.table), rows)
    number, mean = group_means(residual[rows], group[rows])
    values, size = residual[rows], np.bincount(number)
    freedom = float(len(size) - fitted / 3.0), float(len(values) - len(size))
    if freedom[1] < ENOUGH or freedom[0] < 1.0:
        return LackOfFit(None, None, freedom)
    pure = np.square(values - mean[number]).sum(axis=0) / freedom[1]
    lack = (np.square(mean) * size[:, None]).sum(axis=0) / freedom[0]
    ratio = lack / np.maximum(pure, 1e-300)
    chance = min(1.0, 3.0 * float(f_sf(ratio, *freedom).min()))
    x, y, z = (float(value) for value in ratio)
    return LackOfFit((x, y, z), chance, freedom)
