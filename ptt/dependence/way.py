"""Moves of the tool: its direction of arrival at each reading, its change of direction there, travel since reversal."""

import numpy as np

from ptt.run.fading import kept_shares, trailing

REACHES = (0.03, 0.2)  # decay lengths of the memory of direction (of a hose, a cable), as shares of the run's extent


def ways_of(p: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of arrival, and changes of direction.

    Args:
        p: tool positions in travel order, (n, 3) mm.
        starts: (n,) bool, the first row of each run, which is taken to arrive as the second moves.

    Returns:
        Unit directions of arrival of the last move, then exponential means of them along the path with each decay
        length, (1 + s, n, 3); and unit directions of departure less those of arrival, (n, 3), zero at the end of a run.
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
        if len(rows):  # standstill keeps the direction; rows before the first move have its direction
            came[begin:end] = came[rows[np.maximum(np.searchsorted(rows, np.arange(begin, end), "right") - 1, 0)]]
    on = np.append(came[1:], came[-1:], axis=0)
    on[last - 1] = came[last - 1]
    extent = float(np.linalg.norm(np.ptp(p, axis=0)))
    reaches = [trailing(came, kept_shares(far, starts, max(share * extent, 1e-9))) for share in REACHES]
    return np.stack([came, *reaches]), on - came


def since_reversal(q: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Travel of a joint since its last reversal.

    Args:
        q: joint values in travel order, (n,) mm or rad.
        starts: (n,) bool, the first row of each run.

    Returns:
        (n,) mm or rad, not negative; before the first reversal of a run, since its first row.
    """
    move, row = np.where(starts, 0.0, np.diff(q, prepend=q[:1])), np.arange(len(q))
    last = np.maximum.accumulate(np.where((move != 0.0) | starts, row, 0))  # last row that was moved to
    way = np.sign(move[last])
    back = np.append(False, (way[1:] != way[:-1]) & (way[:-1] != 0.0) & ~starts[1:])
    turned = np.maximum.accumulate(np.where(starts, row, np.where(back, row - 1, 0)))
    return np.asarray(np.abs(q - q[turned]))


def last_moves(p: np.ndarray, time: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length of the tool's last move, and its duration from the row before.

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
