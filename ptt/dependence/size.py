"""Size of a dependence: one signed value with its standard error, and the places that it refers to."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from ptt.dependence.bins import bins_of
from ptt.dependence.regressors import raised_cosine
from ptt.effects.phrases import SIGNIFICANT
from ptt.record import Record

ENDS = 0.05  # quantile at either end of the turning amount, whose rows are averaged
Kind = Literal["side", "step", "bump", "period", "law", "varying", "turn"]
# Weights (m, n) -> weighted sums of n values, (m,), and their covariance, (m, m).
Estimate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Size(Record):
    """Signed size of an error that depends on one variable.

    Attributes:
        of: what is off: 'slider 2', 'joint 2', 'rail 2 outward', 'rail 2 sideways', 'link 2', or 'x', 'y', 'z' of the
            tool, 'mount x' to 'mount z' along its own axes.
        kind: 'side': after an arrival forward less after one back; 'step': above the place less below it; 'bump': in
            the middle of the place less beside it; 'period': amplitude; 'law': at `high` less at `low`; 'varying': the
            same as 'side' at the end `high` of the second variable, where it is larger; 'turn': all that it turns over
            by, with the sign of 'side'.
        value: mm, or rad of a joint that turns.
        std: its standard error.
        low: of the variable: where the law begins, the step or the bump is, or the first crest of a period.
        high: where the law ends, or the second crest is.
        other: of 'varying', the value at `low`, its other end; else None.
        other_std: its standard error.
        on: the variable.
        along: the variable that `low` and `high` are of: the second one of 'varying', else the same.
        unit: of `low` and `high`; '' for none.
        noun: 'slider' or 'joint'.
        rms: of the whole shift of the readings by the unknown term, mm; None where that is not known.
    """

    keys: ClassVar[str] = (
        "of, kind, value_um: value [um], std_um: std [um], on, along, low, high, unit, at_low_um: other [um], "
        "at_low_std_um: other_std [um], rms_um: rms [um]"
    )

    of: str
    kind: Kind
    value: float
    std: float
    low: float
    high: float
    other: float | None = None
    other_std: float | None = None
    on: str = ""
    along: str = ""
    unit: str = ""
    noun: str = "slider"
    rms: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Its figures for JSON; those of a joint that turns are in urad."""
        told = super().to_dict()
        if self.of.startswith("joint"):
            for key in ("value_um", "std_um", "at_low_um", "at_low_std_um"):
                told[key] = None if told[key] is None else 1e3 * told[key]
        return told

    @property
    def known(self) -> bool:
        """Whether the readings tell which way it goes."""
        return abs(self.value) > SIGNIFICANT * self.std


def estimate_of(values: np.ndarray, sigma: float) -> Estimate:
    """Weighted sums of independent values of equal variance.

    Args:
        values: (n,).
        sigma: standard deviation of each.
    """
    return lambda weights: (weights @ values, sigma**2 * weights @ weights.T)


def size_of(
    of: str,
    estimate: Estimate,
    values: np.ndarray,
    *,
    period: float | None = None,
    place: tuple[float, float] | None = None,
    shape: str = "smooth",
) -> Size | None:
    """The size of what follows one variable.

    Args:
        of: what is off.
        estimate: of what is off in n rows.
        values: (n,) the variable.
        period: of a period.
        place: of a step or a bump.
        shape: 'step', 'bump', or any other for a law.

    Returns:
        The size; None where the rows do not show it.
    """
    if period is not None:
        return _period(of, estimate, values, period)
    if place is not None and shape in ("step", "bump"):
        return _local(of, estimate, values, place, shape)
    return _law(of, estimate, values)


def size_of_side(of: str, estimate: Estimate, side: np.ndarray, values: np.ndarray | None = None) -> Size | None:
    """The size of a dependence on the direction of arrival.

    Args:
        of: what is off.
        estimate: of what is off in n rows.
        side: (n,) +1 for an arrival forward, -1 for one back.
        values: a second variable that it may vary with, (n,); None for none.

    Returns:
        The size, of kind 'varying' where it clearly does; None where the rows do not show both ways.
    """
    varying = None if values is None else _varying(of, estimate, side, values)
    return varying or _single(of, "side", estimate, _mean(side > 0.0) - _mean(side < 0.0), -1.0, 1.0)


def size_of_turn(of: str, estimate: Estimate, side: np.ndarray, amount: np.ndarray) -> Size | None:
    """The size of a gradual reversal, from the rows where it is least to those where it is most.

    Args:
        of: what is off.
        estimate: of what is off in n rows.
        side: (n,) +1 for an arrival forward, -1 for one back.
        amount: estimate of the reversal error at each row, (n,).

    Returns:
        The size; None where the rows do not show both ways.
    """
    across = size_of_side(of, estimate, side)
    if across is None:
        return None
    low, high = np.quantile(amount, (ENDS, 1.0 - ENDS))  # single rows would pick the noise
    ends = _mean(amount >= high) - _mean(amount <= low)
    up = estimate(ends[None])[0][0] * across.value > 0.0
    return _single(of, "turn", estimate, ends if up else -ends, -1.0, 1.0)


def _mean(rows: np.ndarray) -> np.ndarray:
    """Weights that take the mean over some rows, (n,); NaN where there are none."""
    return np.asarray(rows / rows.sum()) if rows.any() else np.full(len(rows), np.nan)


def _single(of: str, kind: Kind, estimate: Estimate, weights: np.ndarray, low: float, high: float) -> Size | None:
    if not np.isfinite(weights).all():
        return None
    value, spread = estimate(weights[None])
    return Size(of, kind, float(value[0]), float(np.sqrt(max(spread[0, 0], 0.0))), low, high)


def _law(of: str, estimate: Estimate, values: np.ndarray) -> Size | None:
    """Difference of the least and the largest binned mean, the later one along the variable less the earlier."""
    number, centre = bins_of(values)
    if len(centre) < 2:
        return None
    weights = np.stack([_mean(number == i) for i in range(len(centre))])
    mean, _ = estimate(weights)
    first, last = sorted((int(np.argmin(mean)), int(np.argmax(mean))))
    return _single(of, "law", estimate, weights[last] - weights[first], float(centre[first]), float(centre[last]))


def _varying(of: str, estimate: Estimate, side: np.ndarray, values: np.ndarray) -> Size | None:
    """Reversal error where it is least and largest along a variable; None where both do not differ significantly."""
    number, centre = bins_of(values)
    bins = [number == i for i in range(len(centre))]
    weights = np.stack([_mean(own & (side > 0.0)) - _mean(own & (side < 0.0)) for own in bins])
    both = np.isfinite(weights).all(axis=1)
    weights, centre = weights[both], centre[both]
    if len(centre) < 2:
        return None
    gap, _ = estimate(weights)
    first, last = sorted((int(np.argmin(gap)), int(np.argmax(gap))))
    value, spread = estimate(weights[[first, last]])
    across = np.array([-1.0, 1.0])
    if abs(across @ value) <= SIGNIFICANT * np.sqrt(max(float(across @ spread @ across), 0.0)):
        return None
    std = np.sqrt(np.maximum(np.diag(spread), 0.0))
    ends = [(float(value[i]), float(std[i]), float(centre[(first, last)[i]])) for i in np.argsort(np.abs(value))]
    (less, less_std, low), (more, more_std, high) = ends
    return Size(of, "varying", more, more_std, low, high, less, less_std)


def _local(of: str, estimate: Estimate, values: np.ndarray, place: tuple[float, float], shape: str) -> Size | None:
    """Height of a step or bump fitted beside a straight line."""
    middle, width = 0.5 * (place[0] + place[1]), place[1] - place[0]
    own = values > middle if shape == "step" else raised_cosine(values, np.array([middle]), np.array([width]))[:, 0]
    weights = _least_squares(values, own.astype(float)[:, None])
    kind: Kind = "step" if shape == "step" else "bump"
    return None if weights is None else _single(of, kind, estimate, weights[0], *place)


def _period(of: str, estimate: Estimate, values: np.ndarray, period: float) -> Size | None:
    """Amplitude of the first harmonic fitted beside a straight line, and its first crest."""
    turn = 2.0 * np.pi / period
    weights = _least_squares(values, np.stack([np.cos(turn * values), np.sin(turn * values)], axis=1))
    if weights is None:
        return None
    both, spread = estimate(weights)
    size = float(np.hypot(*both))
    way = both / max(size, 1e-300)
    crest = float(np.arctan2(both[1], both[0])) / turn
    crest += period * np.ceil((values.min() - crest) / period)
    return Size(
        of, "period", size, float(np.sqrt(max(float(way @ spread @ way), 0.0))), float(crest), float(crest + period)
    )


def _least_squares(values: np.ndarray, columns: np.ndarray) -> np.ndarray | None:
    """Least squares weights for the coefficients of columns beside a straight line, (m, n); None where collinear."""
    whole = np.column_stack([np.ones(len(values)), (values - values.mean()) / max(np.ptp(values), 1e-300), columns])
    weights = np.linalg.pinv(whole)
    seen = np.allclose(weights @ whole, np.eye(whole.shape[1]), atol=1e-6)
    return weights[2:] if seen else None
