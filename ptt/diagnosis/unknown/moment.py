"""The moment of a sudden effect: every row is tried, beside frames and the same effect acting throughout."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.effects.sudden import ALWAYS, Sudden, dated
from ptt.fitting.factor import RANK_TOLERANCE
from ptt.fitting.linear import LinearPoint, Shape
from ptt.fitting.moment import rows_read

SEGMENTS = 40  # segments of rows within which the Gram matrix is taken to grow linearly


@dataclass(frozen=True)
class MomentSums:
    """Sums over rows and segments of rows, of f frame columns and p columns of an effect that acts throughout.

    Attributes:
        side: products of each row's columns with its residual, the frames' first, (m, f + p).
        lengths: rows of each segment.
        gram: products of all columns with the effect's own over each segment, (segments, f + p, p).
        whole: products of all columns over all rows, (f + p, f + p).
        read: rows that have a reading, (m,) bool.
    """

    side: np.ndarray
    lengths: np.ndarray
    gram: np.ndarray
    whole: np.ndarray
    read: np.ndarray


def best_moment(at: LinearPoint, frame: np.ndarray, left: np.ndarray, used: np.ndarray, effect: Sudden) -> Shape:
    """The moment at which a sudden effect would explain most of a residual.

    Args:
        at: where the problem was linearised.
        frame: columns of the tracker's frames, (n, 3, f) whitened.
        left: residual, (n, 3) whitened.
        used: rows that count, (n,) bool.
        effect: the effect.

    Returns:
        Its shape.
    """
    clock, row = at.problem.view.clock, best_row(along(at, frame, left, used, effect))
    return {"after": clock[row : row + 1].clone()}


def along(at: LinearPoint, frame: np.ndarray, left: np.ndarray, used: np.ndarray, effect: Sudden) -> MomentSums:
    """Sums of a chunk's rows for an effect that acts throughout; arguments as of `best_moment`."""
    own = at.columns(effect, ALWAYS)
    both = np.where(used[:, None, None], np.concatenate([frame, own], axis=2), 0.0)
    segments = np.array_split(both, min(SEGMENTS, len(both)))
    gram = np.array([np.tensordot(segment, segment, axes=((0, 1), (0, 1))) for segment in segments])
    lengths = np.array([len(segment) for segment in segments])
    side, read = np.einsum("ncp,nc->np", both, left), rows_read(at.problem)
    return MomentSums(side, lengths, gram[:, :, frame.shape[2] :], gram.sum(axis=0), read)


def joined(parts: Sequence[MomentSums]) -> MomentSums:
    """Sums of several chunks, concatenated."""
    return MomentSums(
        np.concatenate([part.side for part in parts]),
        np.concatenate([part.lengths for part in parts]),
        np.concatenate([part.gram for part in parts]),
        np.sum([part.whole for part in parts], axis=0),
        np.concatenate([part.read for part in parts]),
    )


def best_row(seen: MomentSums) -> int:
    """The last row before the moment from which on an effect explains most, beside the frames and itself throughout.

    Without the frames fitted beside, a moment at the start of a run with a frame of its own would seem as good as the
    true one in another run.
    """
    own = seen.gram.shape[2]
    inverse = np.linalg.pinv(seen.whole, rcond=RANK_TOLERANCE, hermitian=True)
    total, whole = seen.side.sum(axis=0), seen.whole[:, -own:]
    after_side = (total - np.cumsum(seen.side, axis=0))[:, -own:]
    explained, first, passed = np.zeros(len(seen.side)), 0, np.zeros_like(whole)
    for length, gram in zip(seen.lengths, seen.gram, strict=True):
        part = np.arange(1, length + 1)[:, None, None] / length
        after = whole - passed - part * gram
        rows, known = slice(first, first + length), after.transpose(0, 2, 1) @ inverse
        side = after_side[rows] - known @ total
        explained[rows] = np.einsum("np,npq,nq->n", side, _inverse(after[:, -own:] - known @ after), side)
        first, passed = first + length, passed + gram
    read = np.flatnonzero(seen.read)
    inner = read[dated(len(read))]
    return int(inner[np.argmax(explained[inner])])


def _inverse(gram: np.ndarray) -> np.ndarray:
    """Inverse with a prior of one usual size, so that unseen values stay small."""
    return np.asarray(np.linalg.inv(gram + np.eye(gram.shape[-1])))
