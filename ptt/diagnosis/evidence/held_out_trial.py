"""Leave-one-block-out trial of an atom: what held-out blocks of travel say for it, and a memo of such trials."""

from dataclasses import dataclass, field

import numpy as np

from ptt.diagnosis.noise.memory import HeldOutBlock
from ptt.fitting.posterior import Posterior

# Times the variance that a set claims for held-out rows, up to which its predictions count as calibrated.
MOST_VARIANCE_RATIO = 2.0
# Share of what all rows show of an atom that the rows outside a block have to predict of it.
LEAST_PREDICTED_SHARE = 0.25
BASE_NATS = 5.0  # nats up to which the readings along the travel ask for nothing, and from which base reflectors do


@dataclass(frozen=True)
class HeldOutTrial:
    """How a set of atoms predicts held-out blocks of travel, with one of its atoms and without it.

    Each block is held out in turn and predicted by the posterior of all other rows. `with_it` and `without` are squared
    Mahalanobis distances of the readings from that prediction: along directions that the other rows do not determine,
    the predictive covariance is wide, and the block counts for little. All sums of squares are over the white variance.

    Attributes:
        with_it: squared distance of each block from the prediction of the whole set, (k,).
        without: the same of the set without the atom, (k,).
        fitted_gain: by how much less the whole set leaves of all blocks than the set without the atom, both fitted to
            all rows.
        base_gain: the same of each reading of base reflectors, (b,); of all of them together, (1,), in a long run.
        count: coordinates of all blocks.
        plain_gain: by how much less of each held-out block is left with the atom, in plain squares, (k,).
        needed: whether the set without the atom would have values that physics excludes.
        predicted_gain: by how much closer the values fitted to all rows are with the atom than without it, in the
            distances above, summed over all blocks.
        spread_gain: what is left of `fitted_gain` without the block that contributes most.
    """

    with_it: np.ndarray
    without: np.ndarray
    fitted_gain: float
    base_gain: np.ndarray
    count: int
    plain_gain: np.ndarray
    needed: bool = False
    predicted_gain: float = np.inf
    spread_gain: float = np.inf

    @property
    def faithful(self) -> bool:
        """Whether the whole set predicts held-out rows about as well as its posterior claims."""
        return bool(self.with_it.sum() <= MOST_VARIANCE_RATIO * max(self.count, 1))

    def supports(self, nats: float = 0.0, share: float = 0.0) -> bool:
        """Whether held-out rows support the atom, and still do so without the block that supports it most.

        What a single part of the run shows may be that part's own. Two cases need no support: an atom that base
        reflectors ask for (more than one of their readings) and the readings along the travel do not, and one without
        which others would take values that physics excludes.

        Args:
            nats: that have to be gained, in Mahalanobis distance or, where no share is asked for, in plain squares.
            share: of the squared distance without the atom that has to be gained.
        """
        least = 2.0 * BASE_NATS
        if self.needed or (self.fitted_gain < least and _is_shown_by_base(self.base_gain, least)):
            return True
        gain = self.without - self.with_it
        if share:
            return _is_gained(gain, max(2.0 * nats, share * float(self.without.sum())))
        return _is_gained(gain, 2.0 * nats) or _is_gained(self.plain_gain, 2.0 * nats)

    @property
    def is_silent(self) -> bool:
        """Whether the other rows predict so little of what the blocks show of the atom that these cannot support it.

        Not where a single block shows it: that may be that block's own.
        """
        hardly_predicted = self.predicted_gain < LEAST_PREDICTED_SHARE * self.fitted_gain
        return hardly_predicted and self.spread_gain > 2.0 * BASE_NATS


def _is_shown_by_base(gained: np.ndarray, least: float) -> bool:
    """Whether base reflectors ask for an atom, and not one of their readings alone."""
    return bool(gained.sum() > least) if len(gained) < 2 else _is_gained(gained, least)


def _is_gained(gained: np.ndarray, least: float) -> bool:
    """Whether the sum over blocks exceeds a limit, and is positive without the largest of them."""
    others = gained.sum() - gained.max(initial=0.0)
    return bool(others > 0.0 and gained.sum() > least)


@dataclass
class HeldOutMemo:
    """Results on held-out blocks of sets under white noise, so that none is worked out twice.

    Attributes:
        trials: (keys of a set, key of one of its atoms) -> the trial.
        predicted: keys of the last set -> each held-out block, and the set's posterior from all other rows.
        squares: keys of a set -> sums of squares of the blocks' errors, (k,) mm^2, and numbers of their rows, (k,).
    """

    trials: dict[tuple[tuple[str, ...], str], HeldOutTrial] = field(default_factory=dict)
    predicted: dict[tuple[str, ...], list[tuple[HeldOutBlock, Posterior]]] = field(default_factory=dict)
    squares: dict[tuple[str, ...], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
