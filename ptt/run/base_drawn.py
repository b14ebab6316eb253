"""Whether base reflectors lie to each other as they are drawn: those that do not hold no frame."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from ptt.run.frames import kabsch

LEAST_MM = 1.5  # a knock amid a round, and a drawing in whole millimetres, are less
FAR = 20.0  # standard deviations of one coordinate as stated
SHOWN_REFLECTORS = 4
STRETCH = 2e-3  # share by which a tracker may read all lengths too long or too short: ten times a wrong station


def misplaced(
    visits: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray], place: Mapping[str, np.ndarray], sigma: float
) -> str:
    """What is wrong with base reflectors as they were read, beside each other: a knock between rounds is none of it.

    Args:
        visits: name -> (v, 3) mm as read, those that are left out for others aside.
        rows: name -> (v,) when each visit was, as rows of the run.
        place: name -> (3,) mm as drawn.
        sigma: of one coordinate, mm.

    Returns:
        A sentence without its end; '' where they lie as drawn.
    """
    names = [*visits]
    read, spots = _rounds(visits, rows), np.array([place[name] for name in names])
    limit, off = max(LEAST_MM, FAR * sigma), _off(read, spots)
    if off.max() <= limit:
        return ""
    exchanged = []
    for one, other in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[one, other]] = other, one
        if _off(read, spots[order]).max() <= limit:
            exchanged.append((names[one], names[other]))
    if len(exchanged) == 1:
        return (
            f"base reflectors '{exchanged[0][0]}' and '{exchanged[0][1]}' were read under each other's name: as "
            f"named, the base is off by {off.max():.1f} mm"
        )
    each = ", ".join(f"'{names[index]}' by {off[index]:.1f} mm" for index in np.argsort(-off)[:SHOWN_REFLECTORS])
    return f"base reflectors are not arranged as in the machine file; after the best fit they are off: {each}"


def _rounds(visits: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray]) -> np.ndarray:
    """Each visit to the reflector with most of them, and beside it those of the others that lie nearest, (r, k, 3)."""
    most = rows[max(visits, key=lambda name: len(rows[name]))]
    nearest = {name: np.abs(most[:, None] - rows[name]).argmin(axis=1) for name in visits}
    return np.stack([visits[name][nearest[name]] for name in visits], axis=1)


def _off(read: np.ndarray, spots: np.ndarray) -> np.ndarray:
    """How far each reflector is off its place, moved and stretched with the others, (k,) mm, the median of rounds."""
    arm = spots - spots.mean(axis=0)
    off = []
    for beside in read:
        turn, _ = kabsch(spots, beside)
        seen = (beside - beside.mean(axis=0)) @ turn
        stretch = np.clip((seen * arm).sum() / np.square(arm).sum(), 1.0 - STRETCH, 1.0 + STRETCH)
        off.append(np.linalg.norm(seen - stretch * arm, axis=1))
    return np.asarray(np.median(off, axis=0))
