"""Visits to base reflectors: which are sound, and how far the tracker moved between them."""

from collections.abc import Mapping, Sequence

import numpy as np

FAR = 8.0  # standard deviations of one coordinate by which a visit's distances may be off
WORSE = 5.0  # and times the misfit of the best visit: a wrong drawing puts all visits off alike


def sound_visits(
    visits: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray], place: Mapping[str, np.ndarray], sigma: float
) -> dict[str, np.ndarray]:
    """Leave out the visits to base reflectors that do not fit where the others were read beside them.

    Distances between reflectors know nothing of where the tracker stands, so a knock between two rounds of visits is
    none of it.

    Args:
        visits: name -> (v, 3) mm as read.
        rows: name -> (v,) when each visit was, as rows of the run.
        place: name -> (3,) mm as drawn.
        sigma: of one coordinate of a visit, mm.

    Returns:
        name -> (v,) bool, at least one visit of each.
    """
    kept = {}
    for name, read in visits.items():
        off = np.empty((len(visits) - 1, len(read)))
        for index, other in enumerate(other for other in visits if other != name):
            near = np.abs(rows[name][:, None] - rows[other]).argmin(axis=1)
            drawn = np.linalg.norm(place[name] - place[other])
            off[index] = np.abs(np.linalg.norm(read - visits[other][near], axis=1) - drawn)
        misfit = np.sort(off, axis=0)[(len(off) - 1) // 2]  # of two, where one may be the other's fault, the lesser
        kept[name] = misfit <= max(FAR * sigma, WORSE * float(misfit.min()))
    return kept


def visits_apart(visits: Sequence[np.ndarray]) -> float:
    """How far one visit lies from another, all reflectors alike: a tracker that drifts between them, or is knocked.

    Averaging over reflectors takes nothing of it away, and the poses lie in between, nobody knows where.

    Args:
        visits: (v, 3) mm of each reflector.

    Returns:
        Standard deviation of one coordinate, mm, that all reflectors have in common beyond their own scatter; zero
        where each was visited once.
    """
    moved = [read - read.mean(axis=0) for read in visits if len(read) == max(map(len, visits))]
    count, rounds = len(moved), len(moved[0])
    if rounds < 2 or count < 2:
        return 0.0
    together, freedom = np.mean(moved, axis=0), 3.0 * (rounds - 1)  # shape: (rounds, 3)
    own = float(np.square(np.array(moved) - together).sum()) / (freedom * (count - 1))
    return float(np.sqrt(max(np.square(together).sum() / freedom - own / count, 0.0)))
