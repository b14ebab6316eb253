"""The curve behind a dependence: its shape, share of variance, place or period, and binned means with a band."""

from dataclasses import dataclass

import numpy as np

from ptt.dependence.bins import binned_curve
from ptt.dependence.local import locate_bump, locate_period, locate_step, scaled
from ptt.dependence.regressors import TrialFunctions, build_trials, orthonormalise
from ptt.dependence.strata import RepeatedPoses

PHASES = 10  # bins of a curve over one period
MOST = 0.9  # share of what a cubic and a local shape explain that the cubic alone does, where that is a detail
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
        columns = np.column_stack([columns, np.polynomial.legendre.legvander(scaled(values), 3)[:, 1:]])
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
    base = np.polynomial.legendre.legvander(scaled(values), 3 if choice.smooth else 0)
    detail = choice.is_detail and kind.kind in ("step", "bump")
    shape = "smooth" if detail or kind.kind in ("wavy", "bins") else kind.kind
    if shape == "period":
        period, share, more = locate_period(base, residual, values, float(kind.low[choice.index]), effective_rows)
        parameters += more
    elif shape == "step":
        place, share = locate_step(base, residual, values, float(kind.low[choice.index]))
    elif shape == "bump":
        low, high = float(kind.low[choice.index]), float(kind.high[choice.index])
        shape, place, share = locate_bump(base, residual, values, low, high)
    if second is not None:
        curve = binned_curve(second, np.sign(values - 1e-9) * residual)
    elif period is not None:
        curve = binned_curve(np.mod(values, period), residual, PHASES)
    else:
        curve = binned_curve(values, residual)
    return FittedCurve(corrected(max(share, choice.share), parameters, effective_rows), shape, period, place, curve)
