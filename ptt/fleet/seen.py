"""The part of parameter space that one run determines, from its information matrix."""

from dataclasses import dataclass

import numpy as np

from ptt.fitting.result import UNMEASURED
from ptt.fitting.stated import unseen_directions


@dataclass(frozen=True)
class Seen:
    """What one run determines of p values, all in units of their usual sizes.

    Attributes:
        inverse: inverse of the information in the directions that the run determines, zero in the others, (p, p).
        unseen: share of each value in the other directions, where only its usual size limits it, (p,), 0 to 1.
    """

    inverse: np.ndarray
    unseen: np.ndarray

    @property
    def told(self) -> np.ndarray:
        """Which values are measured, by themselves or in combinations, as `ptt.fitting.report` says, (p,) bool."""
        return np.asarray(self.unseen <= UNMEASURED)

    @property
    def std(self) -> np.ndarray:
        """Standard errors of what the run determines of each value, (p,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.inverse), 0.0)))

    @property
    def marginal_std(self) -> np.ndarray:
        """Standard errors of the values themselves, (p,): in unseen directions, each may be as large as is usual."""
        return np.asarray(np.hypot(self.std, np.sqrt(self.unseen)))


def seen_by(information: np.ndarray) -> Seen:
    """What a run determines.

    Args:
        information: of the run, values in units of their usual sizes, (p, p).

    Returns:
        The inverse, and how much of each value is not determined.
    """
    unseen = unseen_directions(information)
    seen = np.eye(len(information)) - unseen @ unseen.T
    inverse = seen @ np.linalg.pinv(information, hermitian=True) @ seen
    return Seen(inverse, np.clip(1.0 - np.diag(seen), 0.0, 1.0))
