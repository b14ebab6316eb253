"""Joints that an effect does without: if one of seven joints has play, the other six are no evidence against it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, log

import numpy as np

from ptt.fitting.posterior import savage_dickey_nats


@dataclass(frozen=True)
class Idle:
    """Joints of an effect that are better left out.

    Attributes:
        columns: whether each column is of such a joint, (m,) bool.
        nats: log evidence gained by setting these columns to zero, less `odds`.
        odds: prior odds in nats against this choice of joints, less what is given back.
    """

    columns: np.ndarray
    nats: float
    odds: float


def idle_joints(
    joint: np.ndarray,
    values: np.ndarray,
    inverse: np.ndarray,
    prior: np.ndarray,
    phi: float,
    back: np.ndarray | None = None,
) -> Idle | None:
    """The joints whose values are better set to zero, found greedily by Savage-Dickey ratios, prior variances held.

    Each step conditions on the zeros of the joints before it: where the columns of two joints are alike, either may be
    left out but not both.

    Args:
        joint: joint of each column, (m,) int.
        values: posterior means, (m,).
        inverse: posterior covariance in units of `phi`, (m, m).
        prior: prior variance of each, in units of `phi`, (m,).
        phi: white variance.
        back: nats given back with each column of a joint that is left out, (m,); None for none.

    Returns:
        The joints; None where all of them are better kept.

    Source: Dickey, The weighted likelihood ratio, Annals of Mathematical Statistics 42 (1971).
    """
    busy = [np.flatnonzero(joint == each) for each in np.unique(joint)]
    joints, columns, gained, best = len(busy), np.zeros(len(joint), dtype=bool), 0.0, None
    while len(busy) > 1:
        nats = _nats_of_zeros(busy, values, inverse, prior, phi)
        first = int(np.argmax(nats))
        if not nats[first] > 0.0:
            break
        own, gained = busy.pop(first), gained + float(nats[first])
        columns[own] = True
        odds = log(comb(joints, len(busy)) * joints) - (0.0 if back is None else float(back[columns].sum()))
        if gained - odds > (0.0 if best is None else best.nats):
            best = Idle(columns.copy(), gained - odds, odds)
        regression = _solved(inverse[np.ix_(own, own)], inverse[own])
        values, inverse = values - values[own] @ regression, inverse - inverse[:, own] @ regression
    return best


def _nats_of_zeros(
    owned: Sequence[np.ndarray], values: np.ndarray, inverse: np.ndarray, prior: np.ndarray, phi: float
) -> np.ndarray:
    """Savage-Dickey ratio of each joint's values at zero, nats."""
    if all(len(own) == 1 for own in owned):  # as in most effects; all at once takes a tenth of the time
        own = np.concatenate(owned)
        variance = inverse[own, own]
        return np.asarray(0.5 * (np.log(prior[own] / variance) - values[own] ** 2 / (variance * phi)))
    return np.array([savage_dickey_nats(values[own], inverse[np.ix_(own, own)], prior[own], phi) for own in owned])


def _solved(matrix: np.ndarray, side: np.ndarray) -> np.ndarray:
    return side / matrix if len(matrix) == 1 else np.linalg.solve(matrix, side)
