"""A trial on hidden blocks of travel: what they say for an atom, and what is remembered of such trials."""

from dataclasses import dataclass, field

import numpy as np

from ptt.diagnosis.noise.memory import Hidden
from ptt.fitting.posterior import Posterior

# Times the variance that a set claims for held-out rows, up to which its predictions count as calibrated
MOST_VARIANCE_RATIO = 2.0
# Share of what all rows show of an atom that the rows outside a block have to predict of it
LEAST_PREDICTED_SHARE = 0.25
BASE_NATS = 5.0  # nats up to which the readings along the travel ask for nothing, and from which base reflectors do


@dataclass(frozen=True)
class HiddenTrial:
    """How atoms do on hidden blocks of travel with one of them and without it.

    Each way that the readings may go is counted as far as the shown rows tell it.

    Attributes:
        with_it: sum of squares of each block, over the variance that the atoms claim, (k,).
        without: of the same, the atom gone.
        shown: what is left of all blocks without it less what is left with it, when nothing is hidden.
        elsewhere: the same of each reading of base reflectors, (b,); of all together where rows are summed up.
        count: coordinates of all blocks.
        plainly: what the atom takes off each block where every way counts alike, (k,).
        needed: whether the others alone would have values that physics does not let them have.
        told: by how much the values of all rows fit all blocks better than without it, each way counted as far as the
            other rows tell it.
        spread: what is left of `shown` without the block that shows most.
    """

    with_it: np.ndarray
    without: np.ndarray
    shown: float
    elsewhere: np.ndarray
    count: int
    plainly: np.ndarray
    needed: bool = False
    told: float = np.inf
    spread: float = np.inf

    @property
    def faithful(self) -> bool:
        """Whether the atoms predict hidden rows about as well as they claim to."""
        return bool(self.with_it.sum() <= MOST_VARIANCE_RATIO * max(self.count, 1))

    def speaks(self, nats: float = 0.0, share: float = 0.0) -> bool:
        """Whether hidden rows speak for the atom, and go on to do so without the block that does most.

        What only one part of the run bears out may be that part's own. Of what base reflectors show, more than one of
        their readings, and no reading along the travel asks for, these have nothing to say; nor of what only keeps
        others from what cannot be.

        Args:
            nats: that they have to gain; plain squares may tell as well, where no share is asked for.
            share: of what they leave without it that has to go.
        """
        least = 2.0 * BASE_NATS
        if self.needed or (self.shown < least and _at_base(self.elsewhere, least)):
            return True
        as_known = self.without - self.with_it
        if share:
            return _gains(as_known, max(2.0 * nats, share * float(self.without.sum())))
        return _gains(as_known, 2.0 * nats) or _gains(self.plainly, 2.0 * nats)

    @property
    def is_silent(self) -> bool:
        """Whether the others say little of what hidden rows show of the atom, so that these can hardly speak for it.

        What one block alone shows is that one's own.
        """
        return self.told < LEAST_PREDICTED_SHARE * self.shown and self.spread > 2.0 * BASE_NATS


def _at_base(gained: np.ndarray, least: float) -> bool:
    """Whether base reflectors ask for an atom, and not one of their readings alone."""
    return bool(gained.sum() > least) if len(gained) < 2 else _gains(gained, least)


def _gains(gained: np.ndarray, least: float) -> bool:
    others = gained.sum() - gained.max(initial=0.0)
    return bool(others > 0.0 and gained.sum() > least)


@dataclass
class HiddenMemo:
    """What hidden rows said of sets under white noise.

    Attributes:
        trials: of each set and one of its atoms.
        predicted: of the last set: each block of travel, and what the set would be without it.
        squares: of each set: sums of squares of the blocks, (k,) mm^2, and numbers of their rows, (k,).
    """

    trials: dict[tuple[tuple[str, ...], str], HiddenTrial] = field(default_factory=dict)
    predicted: dict[tuple[str, ...], list[tuple[Hidden, Posterior]]] = field(default_factory=dict)
    squares: dict[tuple[str, ...], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
