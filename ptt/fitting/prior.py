"""How large the unknowns of a fit may be before the rows speak: learned from the rows, one size for each parameter."""

from dataclasses import dataclass

import numpy as np

from ptt.fitting.evidence import LEAST_VARIANCE, MOST_VARIANCE, maximise
from ptt.fitting.layout import Layout
from ptt.fitting.whitened import Total
from ptt.run.noise import Noise

FRAME_VARIANCE = 1.0  # prior variance in usual sizes of frames and mounts, whose usual sizes are wide
LEARNING_TURNS = 4  # turns of learning variances beside the scatter of the rows
SETTLED_SCATTER = 0.05  # change of the log variance of the rows below which it counts as settled
MOST_FREEDOM = 100.0  # degrees of freedom that a stated noise counts for at most: a model may miss more than noise
SURE_ERRORS = 3.0  # standard deviations of the design effect from which rows are no longer taken for independent
# of searched parameters: ten usual sizes, which holds them where the rows see nothing of them
SEARCHED_VARIANCE = 100.0
# of parameters of each joint that a search found as one: a joint that shows nothing stays by the others
APART_VARIANCE = 1.0


@dataclass(frozen=True)
class Prior:
    """Variances before the rows, and how much wider than stated the rows scatter.

    Attributes:
        variance: (u,) of each unknown, in usual sizes squared.
        scales: (g,) the same for each group of the layout.
        widening: variance of the rows over that of the noise that whitened them, at least one.
        crowding: rows that say the same as one row, as `crowding_of` tells.
        centre: (u,) where each unknown is before the rows: what is searched where the search left it, all else zero.
    """

    variance: np.ndarray
    scales: np.ndarray
    centre: np.ndarray
    widening: float = 1.0
    crowding: float = 1.0

    @property
    def weight(self) -> np.ndarray:
        """What the prior adds to the diagonal of the normal equations, (u,)."""
        return self.widening * self.crowding / self.variance

    def pull(self, unknowns: np.ndarray) -> np.ndarray:
        """What the prior holds against unknowns, (u,): half the gradient of `cost`."""
        return self.weight * (unknowns - self.centre)

    def cost(self, unknowns: np.ndarray) -> float:
        """The prior's part of the sum of squares."""
        return float((unknowns - self.centre) @ self.pull(unknowns))

    def sizes(self, layout: Layout) -> np.ndarray:
        """How large each unknown may be, (u,) in usual sizes: the usual size, more where the rows ask for it."""
        free = np.array([kind == "free" for kind in layout.kinds] + [False])[layout.group]
        return np.where(free, np.sqrt(np.maximum(self.variance, 1.0)), 1.0)


def usual_prior(layout: Layout) -> Prior:
    """The prior of a machine that nobody has measured.

    Args:
        layout: the unknowns.

    Returns:
        The prior.
    """
    centre = np.where(layout.searched, layout.start(), 0.0)
    return _prior(layout, np.array([_before(layout, group, centre) for group in range(len(layout.kinds))]), centre)


def _before(layout: Layout, group: int, centre: np.ndarray) -> float:
    """Variance of a group before the rows: lengths that joints have each of their own differ by as much as they are."""
    if layout.kinds[group] == "apart":
        return max(APART_VARIANCE, float(np.square(centre[layout.group == group]).max()))
    return SEARCHED_VARIANCE if layout.kinds[group] == "searched" else 1.0


def crowding_of(residual: np.ndarray, kept: np.ndarray, block: np.ndarray) -> float:
    """How many rows say the same as one row, because what a model misses is alike at each repeat of a pose.

    Seven rounds of one path are seven readings of the same miss. Taken as so many witnesses they would call for absurd
    sizes of whatever imitates it. The variance of sums over groups of rows against that of as many independent rows.
    Source: design effect of clusters, Kish, Survey Sampling, 1965, ch. 5.

    Args:
        residual: (n, 3) in units of noise.
        kept: rows that count, (n,) bool.
        block: (n,) group of each row, all repeats of a pose together; -1 for none.

    Returns:
        One for independent rows, up to the size of a group.
    """
    rows = kept & (block >= 0) & np.isfinite(residual).all(axis=1)
    left, count = residual[rows], int(block[rows].max(initial=0)) + 1
    sums = np.stack([np.bincount(block[rows], column, count) for column in left.T], axis=1)
    return design_effect(sums, float((left**2).sum()), np.bincount(block[rows], minlength=count))


def design_effect(sums: np.ndarray, square: float, rows: np.ndarray) -> float:
    """How much wider sums over groups of rows scatter than sums of as many independent rows.

    Args:
        sums: residual summed over each group, (g, 3).
        square: of the residual of all rows, summed.
        rows: in each group, (g,): few large ones scatter by chance as that few do, and empty ones not at all.

    Returns:
        One for independent rows, up to the size of a group.
    """
    if square <= 0.0:
        return 1.0
    effect = float((sums**2).sum()) / square
    alike = float(rows.sum()) ** 2 / float(np.square(rows, dtype=float).sum())  # groups of one size, Kish
    chance = 1.0 + SURE_ERRORS * np.sqrt(2.0 / (alike * sums.shape[1]))  # chi-squared of independent rows
    return effect if effect > chance else 1.0


def learn_prior(
    total: Total,
    layout: Layout,
    unknowns: np.ndarray,
    noise: Noise,
    start: Prior,
    crowding: float = 1.0,
) -> Prior:
    """Learn how large each group of unknowns is, where a fit stands.

    Args:
        total: of the rows that count, linearised there.
        layout: the unknowns.
        unknowns: (u,) in usual sizes.
        noise: that whitened the rows.
        start: to start from.
        crowding: rows that count as one.

    Returns:
        The prior.
    """
    if "free" not in layout.kinds:
        return start
    gram, slope, left, count = total
    side = slope + gram @ unknowns  # of the readings, not of what is left of them
    square = left + float(unknowns @ (slope + side))
    fixed = np.array([kind != "free" for kind in layout.kinds])
    scales, wider = start.scales, start.widening
    for _ in range(LEARNING_TURNS):
        found = maximise(
            gram / (wider * crowding), side / (wider * crowding), square / (wider * crowding), count / crowding,
            layout.group,
            freedom=min(3.0 * noise.freedom, MOST_FREEDOM), start=scales, wide=FRAME_VARIANCE,
            floor=np.where(fixed, scales, LEAST_VARIANCE), ceiling=np.where(fixed, scales, MOST_VARIANCE),
        )  # fmt: skip
        before, wider, scales = wider, max(wider * found.phi, 1.0), np.where(fixed, scales, found.scales)
        if abs(np.log(wider / before)) < SETTLED_SCATTER:
            break
    return _prior(layout, scales, start.centre, wider, crowding)


def _prior(
    layout: Layout, scales: np.ndarray, centre: np.ndarray, widening: float = 1.0, crowding: float = 1.0
) -> Prior:
    return Prior(np.append(scales, FRAME_VARIANCE)[layout.group], scales, centre, widening, crowding)
