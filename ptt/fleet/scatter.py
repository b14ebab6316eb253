"""By how much more than their stated errors the runs of a machine scatter, and how significant a movement then is."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ptt.fitting.stated import SEEN_INFORMATION

MEDIAN_EFFICIENCY = 0.37  # of a median of squares as an estimate of a normal variance, against their mean
RIDGE = 1e-9  # eigenvalues below this share of the largest count as zero
PRIOR_AS_STATED = 0.5  # prior probability that runs scatter by their stated errors and no more
FACTORS = np.geomspace(1.0, 100.0, 200)  # by which stated errors may be too small; log-uniform prior


@dataclass(frozen=True)
class Scatter:
    """How runs scatter about the level, drifts and jumps that were fitted to them.

    Attributes:
        ratio: rms of their deviations in units of the stated standard errors.
        freedom: degrees of freedom of that estimate; infinite, with a ratio of one, where there are none to tell it by.
    """

    ratio: float
    freedom: float

    @property
    def birge_ratio(self) -> float:
        """By how much stated errors have to be widened, at least one (Birge)."""
        return max(self.ratio, 1.0)

    def chance(self, score: float) -> float:
        """Two-sided p-value of a movement, averaged over the posterior of the factor on the stated errors.

        Few runs cannot tell a drift from a value that is set anew for each run, and a ratio that is near one by luck
        must not decide: so the factor is not estimated but integrated out.

        Args:
            score: size of the movement in stated standard errors.

        Returns:
            The p-value, 0 to 1.
        """
        if not np.isfinite(self.freedom):
            return float(2.0 * stats.norm.sf(score))
        prior = np.full(len(FACTORS), (1.0 - PRIOR_AS_STATED) / len(FACTORS))
        prior[0] += PRIOR_AS_STATED
        fit = -self.freedom * (np.log(FACTORS) + 0.5 * (self.ratio / FACTORS) ** 2)
        weight = prior * np.exp(fit - fit.max())
        return float(weight @ (2.0 * stats.norm.sf(score / FACTORS)) / weight.sum())


def scatter_of_all(information: np.ndarray, rest: np.ndarray, moves: int) -> Scatter:
    """Scatter over all p values of n runs, by a median, which movements that are not found yet hardly inflate.

    Args:
        information: information matrix of each run, (n, p, p).
        rest: score of each run about the fitted level and movements, (n, p).
        moves: how many movements were fitted.

    Returns:
        The scatter.
    """
    own = np.einsum("npp->np", information)
    told = own > 0.0
    rank = sum(_rank(each) for each in information)
    freedom = rank - _rank(information.sum(axis=0)) - moves
    if freedom < 1:
        return Scatter(1.0, np.inf)
    ratio = float(np.median(rest[told] ** 2 / own[told])) / float(stats.chi2.median(1)) * rank / freedom
    return Scatter(float(np.sqrt(ratio)), MEDIAN_EFFICIENCY * freedom)


def scatter_of_one(information: np.ndarray, rest: np.ndarray, place: int, course: np.ndarray) -> Scatter:
    """Scatter of a single value: that of a slider which homes anew for each run is larger than that of others.

    Args:
        information: information matrix of each run, (n, p, p).
        rest: score of each run about the fitted level and movements, (n, p).
        place: index of the value.
        course: regressor of its movement, (n,); it and a constant are fitted once more, over this value alone.

    Returns:
        The scatter.
    """
    own = information[:, place, place]
    told = own > 0.0
    freedom = int(told.sum()) - 2
    if freedom < 1:
        return Scatter(1.0, np.inf)
    ways = np.stack([np.ones(int(told.sum())), course[told]], axis=1) * np.sqrt(own[told])[:, None]
    left = rest[told, place] / np.sqrt(own[told])
    left = left - ways @ np.linalg.lstsq(ways, left, rcond=None)[0]
    return Scatter(float(np.sqrt((left**2).sum() / freedom)), float(freedom))


def _rank(information: np.ndarray) -> int:
    """Number of directions in which the information exceeds that of the usual sizes."""
    strength = np.linalg.eigvalsh(information)
    return int((strength > max(SEEN_INFORMATION, RIDGE * strength[-1])).sum())
