"""The way of the tool: from where it came to each reading, and how it turns there to the next."""

import numpy as np

from ptt.run.fading import kept_shares, trailing

REACHES = (0.03, 0.2)  # of the run's extent: stretches over which a hose or a cable forgets the way it was dragged


def ways_of(p: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From where the tool came and how it turns, as unit vectors and their difference.

    Args:
        p: tool positions in travel order, (n, 3) mm.
        starts: (n,) bool, the first row of each run, which is taken to arrive as the second moves.

    Returns:
        The way of arrival, of the last move alone and remembered over stretches of the path, (1 + s, n, 3); and the
        way on less the way of arrival, (n, 3), zero at the end of a run.
    """
    step = np.diff(p, axis=0, prepend=p[:1])
    step[starts] = 0.0
    far = np.linalg.norm(step, axis=1)
    came = step / np.maximum(far, 1e-12)[:, None]
    moved = far > 1e-9
    first = np.flatnonzero(starts)
    last = np.append(first[1:], len(p))
    for begin, end in zip(first, last, strict=True):
        rows = np.flatnonzero(moved[begin:end]) + begin
        if len(rows):  # standstill keeps the way; what comes before the first move arrives as it goes
            came[begin:end] = came[rows[np.maximum(np.searchsorted(rows, np.arange(begin, end), "right") - 1, 0)]]
    on = np.append(came[1:], came[-1:], axis=0)
    on[last - 1] = came[last - 1]
    extent = float(np.linalg.norm(np.ptp(p, axis=0)))
    reaches = [trailing(came, kept_shares(far, starts, max(share * extent, 1e-9))) for share in REACHES]
    return np.stack([came, *reaches]), on - came


def since_reversal(q: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """How far a joint has moved since it last turned back.

    Args:
        q: of the joint in travel order, (n,) mm or rad.
        starts: (n,) bool, the first row of each run.

    Returns:
        (n,) mm or rad, not negative; since its first row where a run has not turned back yet.
    """
    move, row = np.where(starts, 0.0, np.diff(q, prepend=q[:1])), np.arange(len(q))
    last = np.maximum.accumulate(np.where((move != 0.0) | starts, row, 0))  # the row that a standstill goes on from
    way = np.sign(move[last])
    back = np.append(False, (way[1:] != way[:-1]) & (way[:-1] != 0.0) & ~starts[1:])
    turned = np.maximum.accumulate(np.where(starts, row, np.where(back, row - 1, 0)))
    return np.asarray(np.abs(q - q[turned]))


def last_moves(p: np.ndarray, time: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far the tool came with its last move, and for how long since the row before it.

    Args:
        p: tool positions in travel order, (n, 3) mm.
        time: of each row, (n,) s.
        starts: (n,) bool, the first row of each run.

    Returns:
        (n,) mm and (n,) s; NaN before the first move of a run.
    """
    far = np.linalg.norm(np.diff(p, axis=0, prepend=p[:1]), axis=1)
    came = (far > 1e-9) & ~starts
    last = np.maximum.accumulate(np.where(came | starts, np.arange(len(p)), 0))
    known = came[last]
    return np.where(known, far[last], np.nan), np.where(known, time - time[np.maximum(last - 1, 0)], np.nan)
