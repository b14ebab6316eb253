"""Where a network was trained, and whether a point lies there."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from nets.scaling import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


CELL = 1e-3  # of the box diagonal: training points closer than this count as one place
SPACING_QUANTILE = 0.9  # of the distances to the nearest neighbour: the typical spacing
REACH_SPACINGS = 2.0  # typical spacings to the nearest training point, at most
BOX_SPACINGS = 0.5  # typical spacings outside the bounding box, at most


@dataclass(frozen=True, eq=False)
class Domain:
    """The training domain of a network.

    A point is inside when both hold:

    1. the nearest training point is no farther than `reach`, two typical spacings, where the typical spacing is the
       90 % quantile of the distances from one training point to the next nearest (so a hole in the middle of a ring or
       between two windings of a helix is outside, which a convex hull would call inside);
    2. it leaves the box around the training points by no more than half a typical spacing, a quarter of `reach`, per
       input (past the ends nothing holds the network, so less room is given there than between points).

    Training points that share a cell of 1/1000 of the box diagonal are kept once, so repeats of a pose and measured
    jitter do not shrink the spacing.

    Attributes:
        points: (d, m) kept training points, scaled inputs.
        reach: largest distance to a training point, scaled.
        low: (m,) lower corner of the box around all training points, scaled.
        high: (m,) upper corner.
    """

    points: FloatArray
    reach: float
    low: FloatArray
    high: FloatArray

    @cached_property
    def _tree(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @property
    def room(self) -> float:
        """By how much a point inside may leave the box, scaled."""
        return self.reach * BOX_SPACINGS / REACH_SPACINGS

    def contains(self, queries: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether each point lies in the training domain.

        Args:
            queries: (k, m) scaled inputs; a row with NaN is outside.

        Returns:
            (k,) True inside.
        """
        inside = np.all((queries >= self.low - self.room) & (queries <= self.high + self.room), axis=1)
        # query() calls a distance equal to the bound a miss, so the bound is set just above the reach.
        distance, _ = self._tree.query(queries[inside], distance_upper_bound=np.nextafter(self.reach, np.inf))
        inside[inside] = np.isfinite(distance)
        return inside

    def distance(self, queries: FloatArray) -> FloatArray:
        """Distance to the nearest kept training point, as a multiple of the reach.

        Args:
            queries: (k, m) scaled inputs, finite.

        Returns:
            (k,), dimensionless; above 1 is outside.
        """
        distance, _ = self._tree.query(queries)
        return np.asarray(distance / self.reach)


def measure_domain(points: FloatArray) -> Domain:
    """The domain spanned by training points, by the rule of `Domain`.

    Args:
        points: (n, m) scaled inputs, n >= 1.

    Returns:
        The domain; every training point lies in it.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    cell = CELL * diagonal if diagonal > 0 else 1.0
    _, first = np.unique(np.floor((points - low) / cell), axis=0, return_index=True)
    kept = points[np.sort(first)]
    # A dropped point may lie a cell's diagonal from the kept one, and must stay inside.
    least = 2.0 * CELL * diagonal * np.sqrt(points.shape[1])
    reach = max(REACH_SPACINGS * _typical_spacing(kept), least, 1e-9)
    return Domain(points=kept, reach=float(reach), low=low, high=high)


def _typical_spacing(points: FloatArray) -> float:
    if len(points) < 2:
        return 0.0
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=[2])
    return float(np.quantile(distance[:, 0], SPACING_QUANTILE))
