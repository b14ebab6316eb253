"""Prior variances of a fit's unknowns, learned from the rows by empirical Bayes: one for each parameter."""

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
NEAR_VARIANCE = 1.0


@dataclass(frozen=True)
class Prior:
    """Normal prior of the unknowns, and how much more than stated the rows scatter.

    Attributes:
        variance: (u,) prior variance of each unknown, in usual sizes squared.
        group_variances: (g,) the same for each group of the layout.
        centre: (u,) prior mean of each unknown: of searched parameters where the search left them, of all others and of
            those that rest at zero it is zero.
        widening: variance of the rows over that of the noise that whitened them, at least one.
        design_effect: rows that count as one independent row (`design_effect_of`).
    """

    variance: np.ndarray
    group_variances: np.ndarray
    centre: np.ndarray
    widening: float = 1.0
    design_effect: float = 1.0

    @property
    def weight(self) -> np.ndarray:
        """Prior precision on the diagonal of the normal equations, in the weight of one row, (u,)."""
        return self.widening * self.design_effect / self.variance

    def pull(self, unknowns: np.ndarray) -> np.ndarray:
        """Half the gradient of `cost` at some unknowns, (u,)."""
        return self.weight * (unknowns - self.centre)

    def cost(self, unknowns: np.ndarray) -> float:
        """The prior's part of the sum of squares."""
        return float((unknowns - self.centre) @ self.pull(unknowns))

    def sizes(self, layout: Layout) -> np.ndarray:
        """How large each unknown may be, (u,) in usual sizes: the root of its prior variance, but at least one."""
        free = np.array([kind == "free" for kind in layout.kinds] + [False])[layout.group]
        return np.where(free, np.sqrt(np.maximum(self.variance, 1.0)), 1.0)


def usual_prior(layout: Layout) -> Prior:
    """The prior before any rows: one usual size for free parameters, wider for searched ones.

    Args:
        layout: the unknowns.

    Returns:
        The prior.
    """
    resting = np.array([kind == "resting" for kind in layout.kinds] + [False])[layout.group]
    centre = np.where(layout.searched & ~resting, layout.start(), 0.0)
    return _prior(layout, np.array([_before(layout, group, centre) for group in range(len(layout.kinds))]), centre)


def _before(layout: Layout, group: int, centre: np.ndarray) -> float:
    """Prior variance of a group before any rows; lengths of each joint's own differ by as much as they are."""
    if layout.kinds[group] == "near":
        return max(NEAR_VARIANCE, float(np.square(centre[layout.group == group]).max()))
    return SEARCHED_VARIANCE if layout.kinds[group] == "searched" else 1.0


def design_effect_of(residual: np.ndarray, kept: np.ndarray, block: np.ndarray) -> float:
    """Design effect: how many rows count as one, because what a model misses is the same at each repeat of a pose.

    Seven rounds of one path are seven readings of the same error. Taken as independent they would call for absurd
    values of whatever imitates it. The design effect is the variance of sums over groups of rows, over that of sums of
    as many independent rows.

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
    return design_effect_of_sums(sums, float((left**2).sum()), np.bincount(block[rows], minlength=count))


def design_effect_of_sums(sums: np.ndarray, square: float, rows: np.ndarray) -> float:
    """Design effect from sums over groups of rows.

    Args:
        sums: residual summed over each group, (g, 3).
        square: sum of squares of the residual of all rows.
        rows: in each group, (g,): sums over few large groups scatter more by chance.

    Returns:
        One for independent rows, up to the size of a group.
    """
    if square <= 0.0:
        return 1.0
    effect = float((sums**2).sum()) / square
    equal = float(rows.sum()) ** 2 / float(np.square(rows, dtype=float).sum())  # number of groups, were all of one size
    chance = 1.0 + SURE_ERRORS * np.sqrt(2.0 / (equal * sums.shape[1]))  # chi-squared of independent rows
    return effect if effect > chance else 1.0


def learn_prior(
    total: Total,
    layout: Layout,
    unknowns: np.ndarray,
    noise: Noise,
    start: Prior,
    design_effect: float = 1.0,
) -> Prior:
    """Learn the prior variance of each group of free unknowns at a fit, and how much the rows scatter beside it.

    Args:
        total: normal sums of the rows that count, linearised there: J^T J, J^T r, r^T r and the number of coordinates.
        layout: the unknowns.
        unknowns: (u,) in usual sizes.
        noise: that whitened the rows.
        start: prior to start from.
        design_effect: rows that count as one.

    Returns:
        The prior.
    """
    if "free" not in layout.kinds:
        return start
    gram, slope, left, count = total
    side = slope + gram @ unknowns  # J^T y of the readings, not of their residual
    square = left + float(unknowns @ (slope + side))
    fixed = np.array([kind != "free" for kind in layout.kinds])
    variances, wider = start.group_variances, start.widening
    for _ in range(LEARNING_TURNS):
        found = maximise(
            gram / (wider * design_effect), side / (wider * design_effect), square / (wider * design_effect),
            count / design_effect, layout.group,
            freedom=min(3.0 * noise.freedom, MOST_FREEDOM), start=variances, ungrouped_variance=FRAME_VARIANCE,
            floor=np.where(fixed, variances, LEAST_VARIANCE), ceiling=np.where(fixed, variances, MOST_VARIANCE),
        )  # fmt: skip
        before, wider = wider, max(wider * found.phi, 1.0)
        variances = np.where(fixed, variances, found.group_variances)
        if abs(np.log(wider / before)) < SETTLED_SCATTER:
            break
    return _prior(layout, variances, start.centre, wider, design_effect)


def _prior(
    layout: Layout, group_variances: np.ndarray, centre: np.ndarray, widening: float = 1.0, design_effect: float = 1.0
) -> Prior:
    return Prior(
        np.append(group_variances, FRAME_VARIANCE)[layout.group], group_variances, centre, widening, design_effect
    )
