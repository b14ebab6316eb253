"""Widths of the hidden nodes: one spread for all, or each from its nearest neighbours.

A node is phi = exp(-d^2 / (2 eps^2)) (eq. 14 of the 3-PTT paper). The spread Sp of MATLAB's newrb writes the same node
as phi = exp(-(0.8326 d / Sp)^2), 0.8326 = sqrt(ln 2): it has fallen to one half at d = Sp. Hence
eps = Sp / sqrt(2 ln 2) = 0.8493 Sp.
"""

import math

import numpy as np

from nets.scaling import FloatArray

EPSILON_PER_SPREAD = 1.0 / math.sqrt(2.0 * math.log(2.0))


def width_of_spread(spread: float) -> float:
    """Width eps of eq. 14 for a spread Sp as MATLAB's newrb counts it.

    Args:
        spread: Sp, the distance at which a node has fallen to one half.

    Returns:
        eps, in the unit of the spread.
    """
    return spread * EPSILON_PER_SPREAD


def shared_widths(centres: FloatArray, spread: float) -> FloatArray:
    """One width for all nodes.

    Args:
        centres: (q, m).
        spread: Sp, in the unit of the centres.

    Returns:
        (q,) widths eps.
    """
    return np.full(len(centres), width_of_spread(spread))


def nearest_widths(centres: FloatArray, factor: float, neighbours: int = 2) -> FloatArray:
    """Widths that follow the local density of the centres.

    Args:
        centres: (q, m), distinct.
        factor: eps as a multiple of the root mean square distance to the nearest other centres.
        neighbours: how many of those; fewer where there are fewer.

    Returns:
        (q,) widths eps, in the unit of the centres; a lone centre gets the factor itself.

    Source: Moody and Darken, Neural Computation 1(2), 1989.
    """
    if len(centres) < 2:
        return np.full(len(centres), factor)
    from scipy.spatial import cKDTree

    ranks = range(2, min(neighbours, len(centres) - 1) + 2)  # rank 1 is the centre itself
    distance, _ = cKDTree(centres).query(centres, k=list(ranks))
    return factor * np.sqrt(np.mean(np.square(distance), axis=1))
