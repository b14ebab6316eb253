"""By how much more than their rows say runs scatter, and how sure a movement is beside that."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ptt.fitting.stated import SEEN_INFORMATION

MEDIAN = 0.37  # degrees of freedom that a squared median is worth beside a mean of squares, normal rows
RIDGE = 1e-9  # of the strongest direction: below it a value is not told by any run
STATED = 0.5  # chance, before any run, that runs scatter by what their rows say and no more
WIDER = np.geomspace(1.0, 100.0, 200)  # times more by which they may, each factor as likely as the other


@dataclass(frozen=True)
class Scatter:
    """How runs scatter about what they are said to follow.

    Attributes:
        ratio: to what their rows say, root mean square.
        freedom: degrees of freedom that tell it; infinite where nothing does.
    """

    ratio: float
    freedom: float

    @property
    def wider(self) -> float:
        """Times their stated errors, at least one: Birge's ratio."""
        return max(self.ratio, 1.0)

    def chance(self, score: float) -> float:
        """Chance of a movement at least as sure, were there none.

        Few runs cannot tell a drift from a value that is set anew for each, and a ratio that comes out near one by luck
        must not decide: what the factor may be is weighed by what the runs say of it.

        Args:
            score: size of the movement in stated standard errors.

        Returns:
            The chance.
        """
        if not np.isfinite(self.freedom):
            return float(2.0 * stats.norm.sf(score))
        prior = np.full(len(WIDER), (1.0 - STATED) / len(WIDER))
        prior[0] += STATED
        fit = -self.freedom * (np.log(WIDER) + 0.5 * (self.ratio / WIDER) ** 2)
        weight = prior * np.exp(fit - fit.max())
        return float(weight @ (2.0 * stats.norm.sf(score / WIDER)) / weight.sum())


def scatter_of_all(information: np.ndarray, rest: np.ndarray, moves: int) -> Scatter:
    """How all values of a machine scatter, by the median: what moves and is not found yet must not hide itself.

    Args:
        information: (n, p, p) of each run.
        rest: (n, p) scores about what is known.
        moves: how many movements were taken out.

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
    return Scatter(float(np.sqrt(ratio)), MEDIAN * freedom)


def scatter_of_one(information: np.ndarray, rest: np.ndarray, place: int, course: np.ndarray) -> Scatter:
    """The same of one value beside its movement: a slider that homes anew for each run scatters more than others.

    Args:
        information: (n, p, p) of each run.
        rest: (n, p) scores about what is known.
        place: number of the value.
        course: (n,) its movement.

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
    """Directions that rows know better than their usual size."""
    strength = np.linalg.eigvalsh(information)
    return int((strength > max(SEEN_INFORMATION, RIDGE * strength[-1])).sum())
