"""The curve behind a dependence: its shape, share of variance, place or period, and binned means with a band."""

from dataclasses import dataclass

import numpy as np

from ptt.dependence.periods import harmonics, refine_frequency
from ptt.dependence.regressors import TrialFunctions, build_trials, orthonormalise, raised_cosine
from ptt.dependence.strata import RepeatedPoses

ROUNDING = 1e-3  # of the range of a variable, within which values are one level
BINS = 12  # of a curve over a variable
PHASES = 10  # bins of a curve over one period
EDGE = 3.84  # chi-squared of one degree of freedom, 95 %
HALF = 1.96  # half-width of a 95 % confidence interval, in standard errors
MOST = 0.9  # share of what a cubic and a local shape explain that the cubic alone does, where that is a detail
LEAST_BESIDE = 4  # rows that a bump has on either side
LOCAL = ("step", "bump", "period")  # kinds with an unknown place or period


@dataclass(frozen=True)
class FittedCurve:
    """How a residual follows one variable.

    Attributes:
        share: of the variance, 0 to 1, adjusted for chance.
        shape: 'levels', 'smooth', 'step', 'bump', 'period' or 'varying'.
        period: in the variable's unit, or None.
        place: (low, high) of a step or bump, or None.
        curve: centres of bins, means, half-widths of their 95 % confidence band, (m, 3).
    """

    share: float
    shape: str
    period: float | None
    place: tuple[float, float] | None
    curve: np.ndarray


@dataclass(frozen=True)
class _Choice:
    """One trial function, and how well it fits one residual.

    Attributes:
        kind: index of its kind.
        index: among the trial functions of its kind.
        smooth: whether a cubic is fitted beside it.
        share: of the variance, both together, 0 to 1.
        cubic: share that this cubic has alone, 0 to 1.
        alone: largest share that a trial function of the kind has alone, 0 to 1.
        parameters: effective number of parameters, the search included.
    """

    kind: int
    index: int
    smooth: bool
    share: float
    cubic: float
    alone: float
    parameters: float

    @property
    def is_detail(self) -> bool:
        """Whether a local shape is no more than a detail of the cubic beside it."""
        return self.smooth and self.cubic > max(self.alone, MOST * self.share)


def describe(
    residual: np.ndarray,
    values: np.ndarray,
    second: np.ndarray | None,
    trials: tuple[TrialFunctions, ...],
    parameters: np.ndarray,
    poses: RepeatedPoses,
) -> list[FittedCurve]:
    """Describe how residuals follow one variable.

    Args:
        residual: (n, m) mm.
        values: the variable, (n,).
        second: variable that the effect of a direction varies with, (n,), or None.
        trials: trial functions of the variable, neither centred nor orthogonal.
        parameters: effective number of parameters of each kind, the search included.
        poses: repeated visits.

    Returns:
        One for each residual.
    """
    centred = residual - residual.mean(axis=0)
    total = np.maximum(np.square(centred).sum(axis=0), 1e-300)
    data = (centred / np.sqrt(total)).astype(np.float32)
    effective_rows = _effective_rows(values, poses)
    choices = _candidates(trials, parameters, data)
    chosen = [_choose(row, effective_rows) for row in choices]
    return [_finish(choice, centred[:, i], values, second, trials, effective_rows) for i, choice in enumerate(chosen)]


def _effective_rows(values: np.ndarray, poses: RepeatedPoses) -> float:
    """Effective number of independent rows for a variable (Kish's design effect)."""
    if len(poses.size) == len(values) or not poses.is_constant(values):
        return float(len(values))
    usual = float(np.square(poses.size).sum() / poses.size.sum())
    return len(values) / (1.0 + poses.alike * (usual - 1.0))


def _candidates(trials: tuple[TrialFunctions, ...], parameters: np.ndarray, data: np.ndarray) -> list[list[_Choice]]:
    """The best trial function of every kind for every residual, alone and beside a cubic."""
    choices: list[list[_Choice]] = [[] for _ in range(data.shape[1])]
    flat = np.full((len(data), 1), 1.0 / np.sqrt(len(data)), np.float32)
    ready = [orthonormalise(kind, flat) for kind in trials]
    smooth = next((i for i, kind in enumerate(trials) if kind.kind == "smooth"), None)
    for k, trial in enumerate(ready):
        alone = trial.shares(data)
        _add(choices, alone, k, np.zeros(data.shape[1]), alone.max(axis=0), parameters[k], smooth=False)
        if smooth is not None and trial.kind in LOCAL:
            base = ready[smooth].columns
            added, taken = orthonormalise(trial, base).shares(data), np.square(base.T @ data).sum(axis=0)
            _add(choices, added, k, taken, alone.max(axis=0), parameters[k] + 3.0, smooth=True)
    return choices


def _add(
    choices: list[list[_Choice]],
    share: np.ndarray,
    k: int,
    taken: np.ndarray,
    alone: np.ndarray,
    parameters: float,
    *,
    smooth: bool,
) -> None:
    best = share.argmax(axis=0)
    for i, row in enumerate(choices):
        both = float(taken[i] + share[best[i], i])
        row.append(_Choice(k, int(best[i]), smooth, both, float(taken[i]), float(alone[i]), float(parameters)))


def _choose(row: list[_Choice], effective_rows: float) -> _Choice:
    """The choice of least Bayesian information criterion, with effective numbers of parameters."""
    return min(
        row, key=lambda c: effective_rows * np.log(max(1.0 - c.share, 1e-9)) + c.parameters * np.log(effective_rows)
    )


def choose_columns(values: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, float]:
    """The best trial function of a joint, as columns to be fitted beside others.

    Args:
        values: of the joint, (n,) mm or rad.
        residual: (n,) mm or rad.

    Returns:
        Columns (n, d), and their effective number of parameters: a searched place or period adds 2 ln(trial functions).
    """
    trials = build_trials(values, periodic=True)
    centred = residual - residual.mean()
    data = (centred / max(float(np.linalg.norm(centred)), 1e-300)).astype(np.float32)[:, None]
    parameters = np.array([kind.dims + (kind.kind in LOCAL) * 2.0 * np.log(kind.columns.shape[1]) for kind in trials])
    choice = _choose(_candidates(trials, parameters, data)[0], float(len(values)))
    columns = trials[choice.kind].pick(choice.index).astype(float)
    if choice.smooth:
        columns = np.column_stack([columns, np.polynomial.legendre.legvander(_scaled(values), 3)[:, 1:]])
    return columns, choice.parameters


def corrected(share: float, parameters: float, effective_rows: float) -> float:
    """Adjusted R^2.

    Args:
        share: R^2, 0 to 1.
        parameters: effective number of parameters.
        effective_rows: effective number of independent rows.

    Returns:
        0 to 1.
    """
    left = max(effective_rows - 1.0 - parameters, 0.25 * effective_rows, 1.0)
    return float(np.clip(1.0 - (1.0 - share) * (effective_rows - 1.0) / left, 0.0, 1.0))


def _finish(
    choice: _Choice,
    residual: np.ndarray,
    values: np.ndarray,
    second: np.ndarray | None,
    trials: tuple[TrialFunctions, ...],
    effective_rows: float,
) -> FittedCurve:
    kind, share = trials[choice.kind], choice.share
    period, place, parameters = None, None, choice.parameters
    base = np.polynomial.legendre.legvander(_scaled(values), 3 if choice.smooth else 0)
    detail = choice.is_detail and kind.kind in ("step", "bump")
    shape = "smooth" if detail or kind.kind in ("wavy", "bins") else kind.kind
    if shape == "period":
        period, share, more = _period(base, residual, values, float(kind.low[choice.index]), effective_rows)
        parameters += more
    elif shape == "step":
        place, share = _step(base, residual, values, float(kind.low[choice.index]))
    elif shape == "bump":
        place, share = _bump(base, residual, values, float(kind.low[choice.index]), float(kind.high[choice.index]))
        shape, place, share = _with_both_sides(base, residual, values, place, share)
    if second is not None:
        curve = binned_curve(second, np.sign(values - 1e-9) * residual)
    elif period is not None:
        curve = binned_curve(np.mod(values, period), residual, PHASES)
    else:
        curve = binned_curve(values, residual)
    return FittedCurve(corrected(max(share, choice.share), parameters, effective_rows), shape, period, place, curve)


def _scaled(values: np.ndarray) -> np.ndarray:
    return 2.0 * (values - values.min()) / np.ptp(values) - 1.0


def _share(columns: np.ndarray, residual: np.ndarray) -> float:
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1.0 - float(left @ left) / max(float(residual @ residual), 1e-300)


def _period(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, frequency: float, effective_rows: float
) -> tuple[float, float, float]:
    """Period, share, and extra parameters: two for a second harmonic where the information criterion prefers it."""
    rest = residual - base @ np.linalg.lstsq(base, residual, rcond=None)[0]
    frequency = refine_frequency(values, rest, frequency)
    one = _share(np.column_stack([base, harmonics(values, np.array([frequency]))]), residual)
    two = _share(np.column_stack([base, harmonics(values, np.array([frequency, 2.0 * frequency]))]), residual)
    better = effective_rows * np.log(max(1.0 - two, 1e-9) / max(1.0 - one, 1e-9)) + 2.0 * np.log(effective_rows) < 0
    return (1.0 / frequency, two, 2.0) if better else (1.0 / frequency, one, 0.0)


def _step(base: np.ndarray, residual: np.ndarray, values: np.ndarray, near: float) -> tuple[tuple[float, float], float]:
    """95 % confidence interval of a step's place, and its share; places near the best trial are tried."""
    levels = np.unique(values)
    at = int(np.searchsorted(levels, near))
    reach = max(len(levels) // 20, 3)
    last = np.arange(max(at - reach, 0), min(at + reach + 1, len(levels) - 1))
    column = (values[:, None] > (levels[last] + levels[last + 1]) / 2).astype(float)
    share = _added_shares(base, residual, column)
    best = int(np.argmax(share))
    spread = (1.0 - share[best]) / max(len(values) - base.shape[1] - 1, 1)
    inside = last[share >= share[best] - EDGE * spread]
    return (float(levels[inside.min()]), float(levels[inside.max() + 1])), float(share[best])


def _bump(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, low: float, high: float
) -> tuple[tuple[float, float], float]:
    """Ends of a bump, and its share; places and widths around the best trial are tried."""
    middle, width = (low + high) / 2, high - low
    shift, stretch = np.meshgrid(np.linspace(-0.4, 0.4, 9), (0.7, 0.85, 1.0, 1.2, 1.4))
    middles, widths = middle + shift.ravel() * width, stretch.ravel() * width
    share = _added_shares(base, residual, raised_cosine(values, middles, widths).astype(float))
    best = int(np.argmax(share))
    feet = (float(middles[best] - widths[best] / 2), float(middles[best] + widths[best] / 2))
    return feet, float(share[best])


def _with_both_sides(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, feet: tuple[float, float], share: float
) -> tuple[str, tuple[float, float] | None, float]:
    """Shape, place and share; of a bump with most rows in it and hardly one on a side, a step or a smooth curve.

    A few readings after long rests would otherwise be told as a bump of all the others.
    """
    beside = int((values < feet[0]).sum()), int((values > feet[1]).sum())
    if min(beside) >= LEAST_BESIDE or 2 * sum(beside) > len(values):
        return "bump", feet, share
    towards = feet[1] if beside[0] < beside[1] else feet[0]
    place, taken = _step(base, residual, values, 0.25 * (feet[0] + feet[1]) + 0.5 * towards)
    return ("step", place, taken) if taken >= share else ("smooth", None, share)


def _added_shares(base: np.ndarray, residual: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Share of variance of base and one further column, for every column, (m,)."""
    basis = np.linalg.qr(base)[0]
    left = residual - basis @ (basis.T @ residual)
    clean = columns - basis @ (basis.T @ columns)
    length = np.square(clean).sum(axis=0)
    taken = np.square(clean.T @ left) / np.where(length > 1e-9 * len(residual), length, np.inf)
    return 1.0 - (float(left @ left) - taken) / max(float(residual @ residual), 1e-300)


def binned_curve(values: np.ndarray, residual: np.ndarray, count: int = BINS) -> np.ndarray:
    """Binned means with their confidence band.

    Args:
        values: the variable, (n,).
        residual: (n,) mm.
        count: number of bins, see `bins_of`.

    Returns:
        (m, 3) centres, means, half-widths of the 95 % confidence band of each mean.
    """
    number, centre = bins_of(values, count)
    size = np.bincount(number).astype(float)
    mean = np.bincount(number, residual) / size
    spread = np.bincount(number, np.square(residual - mean[number])) / np.maximum(size - 1.0, 1.0)
    pooled = np.square(residual - mean[number]).sum() / max(len(residual) - len(size), 1)
    # The variance of few rows is shrunk towards the pooled one, with the weight of four rows.
    spread = (spread * (size - 1.0) + 4.0 * pooled) / (size + 3.0)
    return np.column_stack([centre, mean, HALF * np.sqrt(spread / size)])


def bins_of(values: np.ndarray, count: int = BINS) -> tuple[np.ndarray, np.ndarray]:
    """Sort values into bins with equal numbers of rows, or one for each level where there are no more levels than bins.

    Levels within `ROUNDING` of each other are one.

    Args:
        values: (n,).
        count: number of bins, at most.

    Returns:
        Bin of each value, (n,) int, and mean of the values in each bin, (m,).
    """
    levels = np.unique(values)
    cuts = levels[1:] if len(levels) <= count else np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    apart = np.diff(cuts, prepend=levels[0]) > ROUNDING * (levels[-1] - levels[0])
    cuts = cuts[apart]  # differences by the rounding of a table are none
    number = np.unique(np.searchsorted(cuts, values, side="right"), return_inverse=True)[1].reshape(-1)
    return number, np.bincount(number, values) / np.bincount(number)
