"""Whether base reflectors are arranged as drawn; where not, which, or which two were exchanged."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from ptt.run.frames import kabsch

LEAST_MM = 1.5  # mm: a knock within a round, or a drawing in whole millimetres, misfits by less
FAR = 20.0  # stated standard deviations of one coordinate; the larger of both is the limit
SHOWN_REFLECTORS = 4  # named in a message
STRETCH = 2e-3  # relative scale error that is allowed for: ten times that of a wrong weather station


def misplaced(
    visits: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray], place: Mapping[str, np.ndarray], sigma: float
) -> str:
    """What is wrong with the arrangement of base reflectors as read, round by round.

    Args:
        visits: name -> (v, 3) mm as read, sound visits only.
        rows: name -> (v,) rows of the run, the order in time.
        place: name -> (3,) mm as drawn.
        sigma: standard deviation of one coordinate, mm.

    Returns:
        A sentence without its full stop; '' where they are arranged as drawn.
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
    """Rounds (r, k, 3) mm: each visit of the most visited reflector with those of the others nearest in time."""
    most = rows[max(visits, key=lambda name: len(rows[name]))]
    nearest = {name: np.abs(most[:, None] - rows[name]).argmin(axis=1) for name in visits}
    return np.stack([visits[name][nearest[name]] for name in visits], axis=1)


def _off(read: np.ndarray, spots: np.ndarray) -> np.ndarray:
    """Misfit of each reflector after a rigid motion with bounded scale, (k,) mm, median over rounds."""
    arm = spots - spots.mean(axis=0)
    off = []
    for beside in read:
        turn, _ = kabsch(spots, beside)
        seen = (beside - beside.mean(axis=0)) @ turn
        stretch = np.clip((seen * arm).sum() / np.square(arm).sum(), 1.0 - STRETCH, 1.0 + STRETCH)
        off.append(np.linalg.norm(seen - stretch * arm, axis=1))
    return np.asarray(np.median(off, axis=0))
