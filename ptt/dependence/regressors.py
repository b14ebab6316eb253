"""Trial functions of one variable: levels, smooth curves, bins, steps, local bumps, periods."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ptt.dependence.periods import harmonics, trial_frequencies

LEVELS = 8  # values of a variable up to which it is categorical
CUTS = 40  # places at which a step is tried
WIDTHS = (1 / 30, 1 / 20, 1 / 12, 1 / 8, 1 / 5)  # of bumps, from end to end, as shares of the range
END_CUTS = 24  # cuts among the lowest and among the highest twenty-fifth of the levels
LEAST_ROWS = 4  # rows that a bump must hold
BINS = 16  # with about equally many rows
DEAD = 1e-3  # share of a column's length left beside the nuisances, below which it is collinear with them


@dataclass(frozen=True)
class TrialFunctions:
    """Trial functions of one kind.

    Attributes:
        kind: 'levels', 'smooth', 'wavy', 'bins', 'step', 'bump', 'period' or 'varying'.
        dims: number of columns of one trial function.
        columns: of t trial functions one after the other, (n, t * dims).
        low: where a step or bump begins, or the frequency of a period, (t,); else NaN.
        high: where a step or bump ends, (t,); else NaN.
    """

    kind: str
    dims: int
    columns: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def pick(self, index: int) -> np.ndarray:
        """Columns of one trial function, (n, dims)."""
        return self.columns[:, index * self.dims : (index + 1) * self.dims]

    def shares(self, residual: np.ndarray) -> np.ndarray:
        """Sums of squares that each trial function explains; columns orthonormal.

        Args:
            residual: (n, m).

        Returns:
            (t, m), in the residual's unit squared.
        """
        taken = self.columns.T @ residual
        return np.square(taken, out=taken).reshape(-1, self.dims, residual.shape[1]).sum(axis=1)


def build_trials(values: np.ndarray, *, periodic: bool) -> tuple[TrialFunctions, ...]:
    """Trial functions of one variable.

    Args:
        values: (n,), not constant.
        periodic: whether periods are tried.

    Returns:
        Each kind once, columns neither centred nor orthogonal.
    """
    levels = np.unique(values)
    if len(levels) <= LEVELS:
        return (_trial("levels", (values[:, None] == levels[1:]).astype(np.float32)),)
    scaled = 2.0 * (values - levels[0]) / (levels[-1] - levels[0]) - 1.0
    kinds = [
        _trial("smooth", np.polynomial.legendre.legvander(scaled, 3)[:, 1:]),
        _trial("wavy", np.polynomial.legendre.legvander(scaled, 7)[:, 1:]),
        _steps(values, levels),
    ]
    if len(levels) >= 48:
        kinds.append(_trial("bins", _bins(values)))
    kinds += _bumps(values, levels)
    frequency = trial_frequencies(values) if periodic else np.zeros(0)
    if len(frequency):
        kinds.append(
            TrialFunctions("period", 2, harmonics(values, frequency), frequency, np.full(len(frequency), np.nan))
        )
    return tuple(kinds)


def build_varying(direction: np.ndarray, second: np.ndarray) -> tuple[TrialFunctions, ...]:
    """Interaction of a direction with a second variable: direction x (1, s, s^2), s standardised.

    Args:
        direction: (n,), +1 or -1.
        second: (n,), not constant.

    Returns:
        One kind with one trial function.
    """
    scaled = (second - second.mean()) / second.std()
    return (_trial("varying", direction[:, None] * np.column_stack([np.ones_like(scaled), scaled, scaled**2])),)


def orthonormalise(
    trials: TrialFunctions, nuisance: np.ndarray, whiten: Callable[[np.ndarray], np.ndarray] | None = None
) -> TrialFunctions:
    """Whiten trial functions, project nuisances off, orthonormalise the columns of each; collinear ones become zero.

    Args:
        trials: columns (n, m).
        nuisance: (n, j) orthonormal, whitened.
        whiten: (n, m) -> (n, m); None for independent rows.

    Returns:
        The same kind with orthonormal columns.
    """
    columns = trials.columns if whiten is None else whiten(trials.columns)
    before = np.sqrt(np.square(columns).sum(axis=0))
    columns = columns - nuisance @ (nuisance.T @ columns)
    if trials.dims == 2:
        first = _unit(columns[:, 0::2], before[0::2])
        second = columns[:, 1::2] - first * (first * columns[:, 1::2]).sum(axis=0)
        columns = np.stack([first, _unit(second, before[1::2])], axis=2).reshape(len(columns), -1)
    elif trials.dims > 2:
        basis, triangle = np.linalg.qr(columns)
        alive = np.abs(np.diag(triangle)) > DEAD * np.maximum(before, 1e-30)
        columns = basis * alive
    else:
        columns = _unit(columns, before)
    return replace(trials, columns=columns)


def _unit(columns: np.ndarray, before: np.ndarray) -> np.ndarray:
    length = np.sqrt(np.square(columns).sum(axis=0))
    return columns * np.where(length > DEAD * np.maximum(before, 1e-30), 1.0 / np.maximum(length, 1e-30), 0.0)


def _trial(kind: str, columns: np.ndarray) -> TrialFunctions:
    unknown = np.full(1, np.nan)
    return TrialFunctions(kind, columns.shape[1], columns.astype(np.float32), unknown, unknown)


def _bins(values: np.ndarray) -> np.ndarray:
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)[1:-1]))
    number = np.searchsorted(edges, values, side="right")
    return (number[:, None] == np.unique(number)[1:]).astype(np.float32)


def _steps(values: np.ndarray, levels: np.ndarray) -> TrialFunctions:
    rare = max(0.04 * len(levels), LEAST_ROWS)
    ends = np.unique(np.geomspace(LEAST_ROWS, rare, END_CUTS).astype(int))  # before a few readings far out
    inner = np.linspace(0.04 * len(levels), 0.96 * len(levels) - 1, CUTS).astype(int)
    last = np.unique(np.concatenate([ends - 1, inner, len(levels) - 1 - ends]))
    last = last[last < len(levels) - 1]
    low, high = levels[last], levels[last + 1]
    return TrialFunctions("step", 1, (values[:, None] > (low + high) / 2).astype(np.float32), low, high)


def _bumps(values: np.ndarray, levels: np.ndarray) -> list[TrialFunctions]:
    """Raised cosines of several widths, each overlapping the next by half."""
    span = levels[-1] - levels[0]
    centre = [np.arange(levels[0] + w * span / 4, levels[-1], w * span / 2) for w in WIDTHS]
    width = np.repeat([w * span for w in WIDTHS], [len(c) for c in centre])
    middle = np.concatenate(centre)
    column = raised_cosine(values, middle, width)
    inside = column > 0.25
    # At least three levels inside: a single pose, however often visited, is no bump.
    poses = (np.searchsorted(levels, middle + width / 3) - np.searchsorted(levels, middle - width / 3)) >= 3
    kept = (inside.sum(axis=0) >= LEAST_ROWS) & poses
    if not kept.any():
        return []
    return [TrialFunctions("bump", 1, column[:, kept], (middle - width / 2)[kept], (middle + width / 2)[kept])]


def raised_cosine(values: np.ndarray, middle: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Bumps (1 + cos) / 2.

    Args:
        values: (n,).
        middle: (m,) their centres.
        width: (m,) from end to end.

    Returns:
        (n, m).
    """
    part = np.clip((values[:, None] - middle) / width, -0.5, 0.5).astype(np.float32)
    return 0.5 * (1.0 + np.cos(np.float32(2.0 * np.pi) * part))
