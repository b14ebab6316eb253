"""Sums of candidates of a very long run from a subsample of its rows, beside sums of the model from all rows.

An effect that the sample does not show is named only if it explains so much that tens of thousands of rows show it, so
the columns of candidates are needed on no more. On the subsample, candidates Z are regressed on the columns of the
model and the readings X, Z = X B + R: the part X B is known from all rows, and R of the subsample stands for that of
all. With T the products of [X Z] over the subsample, k the rows of the run per row of it, and W the products of X over
all rows, the products of [X Z] over all rows are

    k T + M^T (W - k T_XX) M,   M = [I B].

Source: double sampling with regression, Cochran, Sampling Techniques, 1977, ch. 12.
"""

from collections.abc import Mapping

import numpy as np

from ptt.fitting.factor import RANK_TOLERANCE

# Of a held-out block: products of columns and readings in noise units and in mm, (p, p) each, and number of rows.
Held = tuple[np.ndarray, np.ndarray, int]

# Rows that candidates are summed over: twenty times those that show the least effect that is named
SHARED_ROWS = 200_000
# Ratio of what all rows show along a direction to what the scaled-up share shows, beyond which it is left out
MOST_SCALED_UP = 2.0


def share_of_rows(rows: int) -> int:
    """Candidates are summed over one row in how many.

    Args:
        rows: of the run.

    Returns:
        At least one.
    """
    return max(rows // SHARED_ROWS, 1)


def spread(whole: Mapping[int, Held], share: Mapping[int, Held], own: np.ndarray) -> dict[int, Held]:
    """Estimate sums over all rows of candidates that were summed over a subsample.

    Args:
        whole: held-out block -> sums over all its rows, of the model's columns and the readings alone, (x, x).
        share: held-out block -> sums over the subsample, candidates included, (p, p).
        own: indices of the model's columns and the readings among these, (x,).

    Returns:
        Held-out block -> sums, (p, p).
    """
    times = sum(rows for _, _, rows in whole.values()) / sum(rows for _, _, rows in share.values())
    total = times * np.sum([white for white, _, _ in share.values()], axis=0)
    other = np.setdiff1d(np.arange(len(total)), own)
    regression = np.zeros((len(own), len(total)))  # M = [I B]
    regression[:, own] = np.eye(len(own))
    every = np.sum([white for white, _, _ in whole.values()], axis=0)
    regression[:, other] = _regressed(total[np.ix_(own, own)], total[np.ix_(own, other)], every)
    nothing, found = np.zeros_like(total), dict[int, Held]()
    for index, (white, in_mm, rows) in whole.items():
        few = share.get(index, (nothing, nothing, 0))
        joined = [
            times * part + regression.T @ (all_ - times * part[np.ix_(own, own)]) @ regression
            for all_, part in ((white, few[0]), (in_mm, few[1]))
        ]
        found[index] = joined[0], joined[1], rows
    return found


def _regressed(gram: np.ndarray, across: np.ndarray, every: np.ndarray) -> np.ndarray:
    """Least-squares coefficients B, (x, z), along directions that the subsample represents.

    Directions are left out that are rounding in the subsample, or that all rows show `MOST_SCALED_UP` times as much as
    the scaled-up subsample does.

    Args:
        gram: X^T X over the subsample, scaled up, (x, x).
        across: X^T Z over the subsample, scaled up, (x, z).
        every: X^T X over all rows, (x, x).
    """
    size = np.sqrt(np.maximum(every.diagonal(), np.finfo(float).tiny))
    eigenvalues, vectors = np.linalg.eigh(gram / np.outer(size, size))
    seen = eigenvalues > RANK_TOLERANCE * eigenvalues[-1]
    whitened = vectors[:, seen] / np.sqrt(eigenvalues[seen])
    ratios, rotation = np.linalg.eigh(whitened.T @ (every / np.outer(size, size)) @ whitened)
    basis = whitened @ rotation[:, ratios < MOST_SCALED_UP]
    return np.asarray(basis @ (basis.T @ (across / size[:, None])) / size[:, None])
