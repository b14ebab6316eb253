"""Backlash of each slider from a linear-scale log.

Equations 19 and 20: Chen et al., Trans. CSAM 54(2), 2023. The log's columns are described in `ptt.run.backlash.scale`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ptt.errors import TableError, TooFewError
from ptt.record import Record
from ptt.run.backlash.dead_travel import ReversalPass, measure_reversal, turning_row
from ptt.run.backlash.scale import ScaleLog

Array = NDArray[np.float64]

AGREE_SIGMAS = 3.0  # the two ways of counting agree within so many of their joint standard deviations


@dataclass(frozen=True)
class SliderBacklash:
    """Backlash of one slider under one payload.

    Attributes:
        slider: its number or name.
        payload: kg, NaN where the log gives none.
        reversals: the passes.
        by_length: e_j, the mean of e_j1 and e_j2 over all passes, and its standard deviation, mm. The deviation holds
            what sampling, the scale's resolution, its jitter and the passes' scatter leave open.
        by_counts: the mean of |S1 - S3| x resolution over all passes, and its standard deviation, mm.
        gap: both ways together, weighted by their certainty, and its standard deviation, mm; by counts alone where the
            speed was not constant.
        positions: (cycles,) scale readings at the stroke's end, mm.
        stroke: K, the motor's travel to that end, mm.
        resolution: one count of the scale, mm.
    """

    slider: str
    payload: float
    reversals: tuple[ReversalPass, ...]
    by_length: tuple[float, float]
    by_counts: tuple[float, float]
    gap: tuple[float, float]
    positions: tuple[float, ...]
    stroke: float
    resolution: float

    @property
    def agree(self) -> bool:
        """Whether both ways of counting agree within three of their joint standard deviations."""
        joint = np.hypot(self.by_length[1], self.by_counts[1])
        return bool(abs(self.by_length[0] - self.by_counts[0]) <= AGREE_SIGMAS * joint)

    @property
    def repeatability(self) -> tuple[float, float]:
        """Repeatability per unit stroke (eq. 20): range and standard deviation of the positions over K, mm/mm."""
        if len(self.positions) < 2:
            return float("nan"), float("nan")
        spread = float(np.ptp(self.positions)), float(np.std(self.positions, ddof=1))
        return spread[0] / self.stroke, spread[1] / self.stroke

    def mean(self, figure: str) -> list[float]:
        """The mean over the passes of one attribute of `ReversalPass`, element by element."""
        return [float(v) for v in np.mean([np.atleast_1d(getattr(r, figure)) for r in self.reversals], axis=0)]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, None where the log does not tell."""
        return {
            "slider": self.slider,
            "payload_kg": None if np.isnan(self.payload) else self.payload,
            "passes": len(self.reversals),
            "travel_mm": self.mean("travel")[0],
            "gap_mm": self.gap[0],
            "gap_std_mm": self.gap[1],
            "by_length": self._length_dict(),
            "by_counts": self._counts_dict(),
            "agree": self.agree,
            "repeatability": self._repeatability_dict(),
        }

    def _length_dict(self) -> dict[str, Any]:
        return {
            "samples": dict(zip(("S1", "S2", "S3"), self.mean("samples"), strict=True)),
            "step_um": 1e3 * self.mean("step")[0],
            "e_j1_mm": self.mean("by_forward")[0],
            "e_j2_mm": self.mean("by_back")[0],
            "e_j_mm": self.by_length[0],
            "std_mm": self.by_length[1],
            "constant_speed": all(r.constant_speed for r in self.reversals),
        }

    def _counts_dict(self) -> dict[str, Any]:
        return {
            "counts": dict(zip(("S1", "S3"), self.mean("counts"), strict=True)),
            "resolution_um": 1e3 * self.resolution,
            "e_j_mm": self.by_counts[0],
            "std_mm": self.by_counts[1],
        }

    def _repeatability_dict(self) -> dict[str, Any] | None:
        if len(self.positions) < 2:
            return None
        spread, deviation = self.repeatability
        return {
            "positions": len(self.positions),
            "stroke_mm": self.stroke,
            "range_per_stroke": spread,
            "std_per_stroke": deviation,
        }


@dataclass(frozen=True)
class BacklashResult(Record):
    """Backlash of every slider and payload in a log.

    Attributes:
        sliders: one figure per slider and payload, in the log's order.
        resolution: one count of the scale, mm.
        resolution_source: 'given' or 'smallest step in the log'.
        source: the log's name.
    """

    keys: ClassVar[str] = "source, resolution_um: resolution [um], resolution_source, sliders"

    sliders: tuple[SliderBacklash, ...]
    resolution: float
    resolution_source: str
    source: str


def measure_backlash(log: ScaleLog) -> BacklashResult:
    """Backlash per slider and per payload, by data length and by counts (eq. 19).

    Args:
        log: scale readings beside motor commands.

    Returns:
        The figures, sliders in the log's order.

    Raises:
        TableError: a slider never reverses, or reverses more than once in a cycle.
    """
    payload = np.nan_to_num(log.payload, nan=-1.0)
    groups = dict.fromkeys(zip(log.slider.tolist(), payload.tolist(), strict=True))
    sliders = (np.flatnonzero((log.slider == slider) & (payload == load)) for slider, load in groups)
    figures = tuple(_measure_slider(log, rows) for rows in sliders)
    return BacklashResult(figures, log.resolution_mm, log.resolution_source, log.source)


def _measure_slider(log: ScaleLog, rows: NDArray[np.intp]) -> SliderBacklash:
    """One slider under one payload; `rows` (m,) of the log."""
    where = f"{log.source}, slider {log.slider[rows[0]]}"
    passes = [rows[log.cycle[rows] == cycle] for cycle in dict.fromkeys(log.cycle[rows].tolist())]
    full = [one for one in passes if len(one) > 1]
    if not full:
        raise TooFewError("single readings only", where=where, fix="log at least one pass forward and back")
    reversals = tuple(_measure_pass(log, one, where) for one in full)
    ends = [one[turning_row(log.command[one])] if len(one) > 1 else one[0] for one in passes]
    step = float(np.mean([r.step for r in reversals]))
    reach = log.command[ends]
    if np.ptp(reach) > 1.5 * step:
        what = f"the strokes of its cycles end {np.ptp(reach):.4g} mm apart"
        raise TableError(what, where=where, fix="turn every cycle at the same command")
    length, counts = _pooled(reversals, log.resolution_mm)
    return SliderBacklash(
        slider=str(log.slider[rows[0]]),
        payload=float(log.payload[rows[0]]),
        reversals=reversals,
        by_length=length,
        by_counts=counts,
        gap=_weighted(length, counts) if all(r.constant_speed for r in reversals) else counts,
        positions=tuple(log.scale[ends].tolist()),
        stroke=float(np.mean([r.travel for r in reversals])),
        resolution=log.resolution_mm,
    )


def _pooled(reversals: tuple[ReversalPass, ...], resolution: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Means over the passes and standard deviations, mm, by data length and by counts.

    A position known to one step or count only is uniform over it, variance step^2 / 12. The turn and the end of the
    dead travel each lie between two samples; the reading at the turn lies within a count; the count of |S1 - S3|
    compares two readings. Every pass may share these errors, so averaging does not lessen them.
    """
    step = float(np.mean([r.step for r in reversals]))
    noise = float(np.mean([r.noise for r in reversals]))
    length = [0.5 * (r.by_forward + r.by_back) for r in reversals]
    counts = [r.by_counts for r in reversals]
    floor_length = step**2 / 6.0 + resolution**2 / 12.0 + 2.0 * noise**2
    floor_counts = resolution**2 / 6.0 + 2.0 * noise**2
    return _mean_and_std(length, floor_length), _mean_and_std(counts, floor_counts)


def _mean_and_std(values: list[float], variance: float) -> tuple[float, float]:
    """Mean of the passes and its standard deviation: `variance` of the instrument plus the scatter's share."""
    scatter = float(np.var(values, ddof=1)) / len(values) if len(values) > 1 else 0.0
    return float(np.mean(values)), float(np.sqrt(variance + scatter))


def _weighted(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Mean weighted by inverse variance, and its standard deviation."""
    weight = np.array([a[1] ** -2, b[1] ** -2])
    return float(weight @ [a[0], b[0]] / weight.sum()), float(weight.sum() ** -0.5)


def _measure_pass(log: ScaleLog, rows: NDArray[np.intp], where: str) -> ReversalPass:
    """One pass; `rows` (m,) of the log."""
    phase = None if log.phase is None else log.phase[rows]
    return measure_reversal(log.command[rows], log.scale[rows], log.resolution_mm, phase, where)
