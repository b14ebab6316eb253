"""The moment of what happens at once: every row is tried, the same effect all along taken off."""

import numpy as np
import torch

from ptt.effects.sudden import ALWAYS, Sudden
from ptt.fitting.linear import Place, Shape
from ptt.fitting.moment import EDGE

SEGMENTS = 40  # what a jump does to the readings changes little within one


def best_moment(at: Place, left: np.ndarray, used: np.ndarray, effect: Sudden) -> Shape:
    """Where a sudden effect would take most of what is left.

    Args:
        at: where the problem was linearised.
        left: (n, 3) whitened.
        used: rows that count, (n,) bool.
        effect: the effect.

    Returns:
        Its shape.
    """
    clock = effect.clock(at.problem.view).numpy()
    order = np.argsort(clock, kind="stable")
    side, lengths, gram = along(at, left, used, effect)
    if (np.diff(clock) < 0.0).any():
        return {"after": torch.tensor([np.median(clock)], dtype=torch.float64)}
    return {"after": torch.tensor([clock[order][best_row(side, lengths, gram)]], dtype=torch.float64)}


def along(at: Place, left: np.ndarray, used: np.ndarray, effect: Sudden) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What each row of a chunk says for an effect, (m, p); of segments of rows their number and columns' gram."""
    columns = at.columns(effect, ALWAYS)
    columns = np.where(used[:, None, None], columns, 0.0)
    segments = np.array_split(columns, min(SEGMENTS, len(columns)))
    gram = np.array([np.tensordot(segment, segment, axes=((0, 1), (0, 1))) for segment in segments])
    return np.einsum("ncp,nc->np", columns, left), np.array([len(segment) for segment in segments]), gram


def best_row(along: np.ndarray, lengths: np.ndarray, gram: np.ndarray) -> int:
    """The last row before the moment from which on an effect takes most, the same effect all along taken off."""
    whole, whole_side = gram.sum(axis=0), along.sum(axis=0)
    spread = np.linalg.pinv(whole, hermitian=True)
    after_side = whole_side - np.cumsum(along, axis=0)
    before = np.cumsum(gram, axis=0) - 0.5 * gram  # at the middle of each segment
    taken, first = np.zeros(len(along)), 0
    for length, passed in zip(lengths, before, strict=True):
        after = whole - passed
        rows = slice(first, first + length)
        side = after_side[rows] - after @ spread @ whole_side
        taken[rows] = np.einsum("np,pq,nq->n", side, _inverse(after - after @ spread @ after), side)
        first += length
    return EDGE + int(np.argmax(taken[EDGE : len(taken) - EDGE]))


def _inverse(gram: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.inv(gram + np.eye(len(gram))))  # one usual size: what is not seen is not blown up
