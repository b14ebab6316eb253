"""What the residual of a long run depends on: analysis of variance over bins of all rows."""

import numpy as np

from ptt.dependence.contexts import context_views
from ptt.run.axes import AXES
from ptt.run.noise import Noise
from ptt.run.problem import Problem
from ptt.run.tails import chi2_sf

BINS = 32  # bins of about equal numbers of rows for each variable
BIN_CHANCE = 1e-3  # p-value over all variables together
LEAST_SHARE = 0.01  # share of the residual variance from which a dependence is worth naming
CELLS = 6  # cells along each coordinate, for a dependence on position as a whole


def follow_in_all_rows(
    problem: Problem, residual: np.ndarray, noise: Noise, rows: np.ndarray
) -> list[tuple[str, float]]:
    """Variables on which the residual depends, by the means of bins.

    Args:
        problem: n rows.
        residual: (n, 3) mm.
        noise: the noise floor.
        rows: rows that count, (n,) bool.

    Returns:
        (variable, share of the residual variance beyond chance), largest first.
    """
    rest = residual[rows] @ noise.whitener.T
    rest = rest / np.sqrt(np.square(rest).mean())
    views = {name: values[rows] for name, values in context_views(problem).items()}
    codes = {name: _bin(values, BINS) for name, values in views.items()}
    if all(name in views for name in AXES):
        x, y, z = (_bin(views[name], CELLS) for name in AXES)
        codes["position"] = (x * CELLS + y) * CELLS + z
    found = []
    for name, code in codes.items():
        square, freedom = _between(code, rest)
        share = (square - freedom) / np.square(rest).sum()
        if share > LEAST_SHARE and chi2_sf(square, freedom) * len(codes) < BIN_CHANCE:
            found.append((name, float(share)))
    return sorted(found, key=lambda item: -item[1])


def _bin(values: np.ndarray, bins: int) -> np.ndarray:
    """Bin number of each row, (n,) int, for bins of about equal numbers of rows; few distinct levels have one each."""
    known = np.nan_to_num(values)
    edges = np.unique(np.quantile(known[:: max(1, len(known) // 10_000)], np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    return np.searchsorted(edges, known, side="right")


def _between(code: np.ndarray, rest: np.ndarray) -> tuple[float, int]:
    """Sum of squares between bins of a residual (m, 3), and its degrees of freedom."""
    count = np.bincount(code)
    sums = np.column_stack([np.bincount(code, column) for column in rest.T])
    full = count > 0
    return float((np.square(sums[full]) / count[full, None]).sum()), 3 * int(full.sum())
