"""What a residual or an unknown depends on, as a value: the variable, the share that it explains, its curve."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ptt.dependence.contexts import unit_of
from ptt.dependence.said import between, changed_at, say_size, switched_at
from ptt.dependence.size import Size
from ptt.record import Record
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Dependence(Record):
    """One residual depends on one variable.

    Attributes:
        residual: 'x', 'y', 'z', 'slider 2' or 'joint 2'.
        on: 'b2', 'q2', 'direction2', 'speed2', 'payload', 'temperature', 'time', 'x', 'y', 'z', 'run';
            of an unknown also 'way x', 'turn x', 'gravity x', 'feed'.
        share: of the residual's variance, 0 to 1, that a free function of this variable alone explains (adjusted R^2).
        p_value: permutation test, after multiplicity over all residuals, variables and shapes.
        period_mm: period where the dependence is periodic (rad for a joint angle), else None.
        shape: 'levels', 'smooth', 'step', 'bump', 'period' or 'varying'; of an unknown also 'gradual'.
        curve: (m, 3) centres, means and half-widths of their 95 % confidence band, mm; the centres of a period lie
            within one period, those of a varying direction on the second variable, with the mean of direction x
            residual.
        place: where a step or a local bump sits, (low, high); of 'gradual' the ends of the joint's travel; else None.
        with_: the second variable that the effect of a direction varies with; of 'gradual' it is 'reversal', the travel
            since the last one; else None.
        rivals: variables that explain about as much but are the less likely cause.
        acts_on: where an unknown that follows it acts: 'slider 2', 'joint 2', 'rail 2 outward', 'rail 2 sideways',
            'link 2', 'x', 'y', 'z' of the tool, 'set-up', 'mount' (an arm's tool in its holder) or 'load' (its load's
            centre); None where open.
        unit: of the variable; '' where it has none, or it is not known.
        size: of an unknown, its size and sign; None where not estimated.
        reference_c: temperature at which the drawing holds, C, where the variable or the second one is a temperature;
            else None.
        points: of an unknown, (m, 2) the readings that its curve stands for: the curve's variable, and mm or rad.
        together: variables that it takes all of to describe an unknown: a field of which this one alone explains less
            than half, or a change at one moment that varies over the workspace; the share is of all of them then.
        ranges: of each variable of `together`, its lowest and highest value at the readings, in its unit; empty where
            one of them is no column and no coordinate.
        moments: of shape 'levels' over time, the moments at which it switches, s; else empty.
        alone_share: share of the variance that this one alone explains then; None where one variable is enough.
        by_rows: whether it is of the time of a run without a clock, which is the number of the row.
    """

    keys: ClassVar[str] = (
        "residual, on, unit, share, p_value, together, ranges, alone_share, period_mm, shape, place, moments, "
        "with: with_, by_rows, reference_c, rivals, acts_on, size, words, "
        "curve.at: curve.T.0, curve.mean_um: curve.T.1 [um], curve.half_width_um: curve.T.2 [um]"
    )

    residual: str
    on: str
    share: float
    p_value: float
    period_mm: float | None
    shape: str
    curve: np.ndarray
    place: tuple[float, float] | None = None
    with_: str | None = None
    rivals: tuple[str, ...] = ()
    acts_on: str | None = None
    unit: str = ""
    size: Size | None = None
    reference_c: float | None = None
    points: np.ndarray | None = None
    together: tuple[str, ...] = ()
    ranges: tuple[tuple[float, float], ...] = ()
    alone_share: float | None = None
    moments: tuple[float, ...] = ()
    by_rows: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Its figures for JSON; the error of a joint that turns is in urad."""
        told = super().to_dict()
        if self.points is not None and len(self.points):
            told["curve"]["between"] = [float(self.points[:, 0].min()), float(self.points[:, 0].max())]
        if self.residual.startswith("joint"):
            for key in ("mean_um", "half_width_um"):
                told["curve"][key] = [1e3 * value for value in told["curve"][key]]
        return told

    @property
    def words(self) -> str:
        """Sentence on its size and sign; '' without a size."""
        return "" if self.size is None else say_size(self.size)

    def how(self, second: str | None = None) -> str:
        """The shape in a word or two, for example 'period 5 mm' or 'step at 12.1 to 13.9 mm'.

        Args:
            second: a name for the second variable; None for its own.
        """
        if self.period_mm is not None:
            return f"period {self.period_mm:.4g} {self.unit}".rstrip()
        if self.shape == "gradual":
            return "gradual after each reversal"
        if self.with_ is not None:
            return f"varies with {second or self.with_}"
        if self.moments:
            return f"levels that change {switched_at(self.moments, self.unit)}"
        if self.place is not None:
            timed = self.on == "time"
            where = changed_at(*self.place, self.unit) if timed else f"at {between(*self.place, self.unit)}"
            return f"{self.shape} {where}"
        return self.shape


def of_run(item: Dependence, problem: Problem) -> Dependence:
    """A dependence with the unit of its variable, the reference temperature of one of warmth, and what its time is.

    Args:
        item: a dependence.
        problem: the run that it was found on.
    """
    seconds = (item.with_, None if item.size is None else item.size.along)
    warm = "temperature" in (item.on, *seconds)
    reference = problem.file.machine.reference_temp_c if warm else None
    timed = "time" in (item.on, *seconds, *item.together) and not unit_of(problem, "time")
    return replace(item, unit=unit_of(problem, item.on), reference_c=reference, by_rows=timed)
