"""Centres of the hidden nodes, found without supervision by k-means."""

import numpy as np

from nets.scaling import FloatArray

ITERATIONS = 20
LARGEST_SAMPLE = 4000  # k-means on more distinct points costs time and moves the centres little


def kmeans_centres(points: FloatArray, count: int, *, seed: int = 0, restarts: int = 4) -> FloatArray:
    """Cluster centres of the distinct points: the best of several k-means++ starts.

    A pose that was visited seven times counts once: centres follow where the inputs lie, not how often. With no more
    distinct points than `count`, the points themselves are the centres.

    Args:
        points: (n, m), scaled inputs.
        count: number of centres wanted, at least 1.
        seed: makes the starts reproducible.
        restarts: starts; the least inertia wins, the first at a tie.

    Returns:
        (min(count, distinct), m) centres, in lexical order; the unit of the points.

    Source: k-means++ start: Arthur and Vassilvitskii, SODA 2007.
    """
    distinct = np.unique(points, axis=0)
    if len(distinct) <= count:
        return distinct
    rng = np.random.default_rng(seed)
    if len(distinct) > max(LARGEST_SAMPLE, 8 * count):
        distinct = rng.choice(distinct, size=max(LARGEST_SAMPLE, 8 * count), replace=False, axis=0)
    starts = [_one_start(distinct, count, rng) for _ in range(restarts)]
    best = min(starts, key=lambda centres: inertia(distinct, centres))
    return best[np.lexsort(best.T[::-1])]


def inertia(points: FloatArray, centres: FloatArray) -> float:
    """Sum of squared distances from each point to its nearest centre.

    Args:
        points: (n, m).
        centres: (q, m), same unit.

    Returns:
        The sum, in squared units of the points.
    """
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(centres).query(points)
    return float(np.sum(np.square(distance)))


def farthest_points(points: FloatArray, count: int) -> FloatArray:
    """Points far from each other: each next one is the farthest from those taken, the first is nearest the mean.

    Args:
        points: (n, m), distinct.
        count: how many, at most n.

    Returns:
        (count, m), a subset of the points.

    Source: Gonzalez, Theoretical Computer Science 38, 1985.
    """
    squared = np.square(points - points.mean(axis=0)).sum(axis=1)
    taken = [int(np.argmin(squared))]
    nearest = np.full(len(points), np.inf)
    for _ in range(count - 1):
        nearest = np.minimum(nearest, np.square(points - points[taken[-1]]).sum(axis=1))
        taken.append(int(np.argmax(nearest)))
    return points[taken]


def _one_start(points: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    from scipy.cluster.vq import ClusterError, kmeans2

    # An empty cluster would leave a centre that stands for no point; spread-out points have none to lose.
    try:
        centres, _ = kmeans2(points, count, iter=ITERATIONS, minit="++", missing="raise", seed=rng)
    except ClusterError:
        return farthest_points(points, count)
    return np.asarray(centres, dtype=np.float64)
