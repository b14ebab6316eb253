"""Sums of candidates of a long run from a share of its rows, beside those of the model from all of them.

An effect that a sample does not show is named only if it takes so much that tens of thousands of rows show it, so its
columns are wanted of no more. On the share, candidates Z are regressed on the columns of the model and the readings X,
Z = X B + R: what hangs on X is known from all rows, and R of the share stands for that of all. With T the sums of
[X Z] over the share, k the rows of the run for each of these, and W the sums of X over all rows, those of [X Z] are

    k T + M^T (W - k T_XX) M,   M = [I B].

Source: double sampling with regression, Cochran, Sampling Techniques, 1977, ch. 12.
"""

from collections.abc import Mapping

import numpy as np

from ptt.fitting.factor import RANK_TOLERANCE

Held = tuple[np.ndarray, np.ndarray, int]  # joined sums of a block in noise units and in mm, and its rows

# Rows that candidates are summed over: twenty times those that show the least effect that is named
SHARED_ROWS = 200_000
# Ratio of what all rows show along a direction to what the scaled-up share shows, beyond which it is left out
MOST_SCALED_UP = 2.0


def share_of_rows(rows: int) -> int:
    """Of how many rows candidates are summed over one.

    Args:
        rows: of the run.

    Returns:
        At least one.
    """
    return max(rows // SHARED_ROWS, 1)


def spread(whole: Mapping[int, Held], share: Mapping[int, Held], own: np.ndarray) -> dict[int, Held]:
    """Sums over all rows of candidates that were summed over a share of them.

    Args:
        whole: held-out block -> sums over its rows, columns of the model and the readings alone, (x, x).
        share: the same of the share of rows, candidates among them, (p, p).
        own: places of the model's columns and the readings in these, (x,).

    Returns:
        Held-out block -> sums, (p, p).
    """
    times = sum(rows for _, _, rows in whole.values()) / sum(rows for _, _, rows in share.values())
    total = times * np.sum([white for white, _, _ in share.values()], axis=0)
    other = np.setdiff1d(np.arange(len(total)), own)
    ways = np.zeros((len(own), len(total)))
    ways[:, own] = np.eye(len(own))
    every = np.sum([white for white, _, _ in whole.values()], axis=0)
    ways[:, other] = _regressed(total[np.ix_(own, own)], total[np.ix_(own, other)], every)
    nothing, found = np.zeros_like(total), dict[int, Held]()
    for index, (white, in_mm, rows) in whole.items():
        few = share.get(index, (nothing, nothing, 0))
        joined = [
            times * part + ways.T @ (all_ - times * part[np.ix_(own, own)]) @ ways
            for all_, part in ((white, few[0]), (in_mm, few[1]))
        ]
        found[index] = joined[0], joined[1], rows
    return found


def _regressed(gram: np.ndarray, across: np.ndarray, every: np.ndarray) -> np.ndarray:
    """Coefficients of least squares along the ways of some columns that a share shows as all rows do, (x, z).

    Args:
        gram: sums of the columns over the share, scaled up, (x, x).
        across: with others, (x, z).
        every: sums of the columns over all rows, (x, x).
    """
    size = np.sqrt(np.maximum(every.diagonal(), np.finfo(float).tiny))
    strength, ways = np.linalg.eigh(gram / np.outer(size, size))
    there = strength > RANK_TOLERANCE * strength[-1]
    ways = ways[:, there] / np.sqrt(strength[there])
    shown, turned = np.linalg.eigh(ways.T @ (every / np.outer(size, size)) @ ways)
    ways = ways @ turned[:, shown < MOST_SCALED_UP]
    return np.asarray(ways @ (ways.T @ (across / size[:, None])) / size[:, None])
