"""Joints that show nothing of an effect: of seven one may have play, and the others are no evidence against it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, log

import numpy as np

from ptt.fitting.posterior import savage_dickey_nats


@dataclass(frozen=True)
class Idle:
    """Joints of an effect that are best said to be sound.

    Attributes:
        columns: theirs, (m,) bool.
        nats: by which readings are likelier where these are zero, less the odds.
        odds: nats against just the others, less what is given back.
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
    """The joints that are best said to be sound, found one after the other.

    Each is the one whose zero is likeliest beside the zeros of those before: where the columns of two joints are alike
    either may be sound, but not both.

    Args:
        joint: whose value each column is, (m,) int.
        values: posterior means, (m,).
        inverse: their covariance in units of `phi`, (m, m).
        prior: variance of each before the data, in units of `phi`, (m,).
        phi: white variance.
        back: nats that are given back with each column of a sound joint, (m,); None for none.

    Returns:
        The joints; None where all of them are better left in.

    Source: Dickey, The weighted likelihood ratio, Annals of Mathematical Statistics 42 (1971), at held widths.
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
        ways = _solved(inverse[np.ix_(own, own)], inverse[own])
        values, inverse = values - values[own] @ ways, inverse - inverse[:, own] @ ways
    return best


def _nats_of_zeros(
    owned: Sequence[np.ndarray], values: np.ndarray, inverse: np.ndarray, prior: np.ndarray, phi: float
) -> np.ndarray:
    """Log of what each joint's values are believed to be at zero after the data over what they were before."""
    if all(len(own) == 1 for own in owned):  # as most effects have them: all at once takes a tenth of the time
        own = np.concatenate(owned)
        variance = inverse[own, own]
        return np.asarray(0.5 * (np.log(prior[own] / variance) - values[own] ** 2 / (variance * phi)))
    return np.array([savage_dickey_nats(values[own], inverse[np.ix_(own, own)], prior[own], phi) for own in owned])


def _solved(matrix: np.ndarray, side: np.ndarray) -> np.ndarray:
    return side / matrix if len(matrix) == 1 else np.linalg.solve(matrix, side)
