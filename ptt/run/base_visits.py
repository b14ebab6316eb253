"""Visits to base reflectors: one whose beam was broken is told by its distances to the other reflectors."""

from collections.abc import Mapping

import numpy as np

FAR = 8.0  # standard deviations of one coordinate by which a visit's distances may be off
WORSE = 5.0  # and times the misfit of the best visit: a wrong drawing puts all visits off alike


def sound_visits(
    visits: Mapping[str, np.ndarray], place: Mapping[str, np.ndarray], sigma: float
) -> dict[str, np.ndarray]:
    """Leave out the visits to base reflectors that do not fit where the other reflectors were read.

    Distances between reflectors know nothing of where the tracker stands, so a knock between two visits is none of it.

    Args:
        visits: name -> (v, 3) mm as read.
        place: name -> (3,) mm as drawn.
        sigma: of one coordinate of a visit, mm.

    Returns:
        The same with at least one visit of each.
    """
    centre = {name: np.median(read, axis=0) for name, read in visits.items()}
    kept = {}
    for name, read in visits.items():
        others = [other for other in visits if other != name]
        drawn = np.array([np.linalg.norm(place[name] - place[other]) for other in others])
        here = np.array([np.linalg.norm(read - centre[other], axis=1) for other in others])  # shape: (others, v)
        misfit = np.median(np.abs(here - drawn[:, None]), axis=0)
        kept[name] = read[misfit <= max(FAR * sigma, WORSE * float(misfit.min()))]
    return kept
