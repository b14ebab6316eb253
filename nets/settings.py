"""What may be chosen when a Gaussian RBF network is trained."""

from dataclasses import dataclass
from typing import Literal

from nets.errors import TrainingDataError


@dataclass(frozen=True)
class RbfSettings:
    """Candidates and rules of one training; the held-out error chooses among the candidates.

    Attributes:
        centre_counts: numbers of hidden nodes to try, each at least 1; more than there are distinct inputs is cut back.
        spreads: widths to try. For `widths="shared"` the spread Sp in standard deviations of the inputs, the distance
            at which a node has fallen to one half (`nets.widths`); for `"nearest"` a factor on the distance to the
            nearest centres.
        ridges: penalties to try, > 0, on the mean squared weight: minimise mean|error|^2 + ridge |w|^2.
        affine: whether to try without, with, or both without and with a straight-line part beside the nodes.
        widths: one spread for all nodes, or one width per node from its nearest neighbours.
        neighbours: how many nearest centres set a node's width with `widths="nearest"`.
        method: closed-form ridge, or gradient descent (eq. 16 of the 3-PTT paper).
        rate: learning rate eta of the gradient descent, in (0, 1].
        epochs: passes over the data of the gradient descent.
        folds: the groups are dealt into at most so many parts, held out one after the other.
        null_candidate: an output that is not predicted significantly better than by zero stays zero.
        significance: level of that test, one-sided.
        restarts: k-means starts; the one with the least inertia is kept.
        seed: seed of the k-means starts and of dealing groups into folds.
    """

    centre_counts: tuple[int, ...] = (8, 16, 32, 64, 128)
    spreads: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0, 8.0)
    ridges: tuple[float, ...] = tuple(10.0**power for power in range(-13, 0))
    affine: tuple[bool, ...] = (False, True)
    widths: Literal["shared", "nearest"] = "shared"
    neighbours: int = 2
    method: Literal["ridge", "gradient"] = "ridge"
    rate: float = 1.0
    epochs: int = 2000
    folds: int = 10
    null_candidate: bool = True
    significance: float = 0.01
    restarts: int = 4
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse settings that cannot work.

        Raises:
            TrainingDataError: naming the setting, its value and the range.
        """
        self._require("centre_counts", bool(self.centre_counts) and min(self.centre_counts) >= 1, "at least 1 each")
        self._require("spreads", bool(self.spreads) and min(self.spreads) > 0, "positive numbers")
        self._require("ridges", bool(self.ridges) and min(self.ridges) > 0, "positive numbers")
        self._require("affine", bool(self.affine), "False, True or both")
        self._require("widths", self.widths in ("shared", "nearest"), "'shared' or 'nearest'")
        self._require("neighbours", self.neighbours >= 1, "at least 1")
        self._require("method", self.method in ("ridge", "gradient"), "'ridge' or 'gradient'")
        self._require("rate", 0 < self.rate <= 1, "in (0, 1]")
        self._require("epochs", self.epochs >= 1, "at least 1")
        self._require("folds", self.folds >= 2, "at least 2")
        self._require("significance", 0 < self.significance < 1, "between 0 and 1")
        self._require("restarts", self.restarts >= 1, "at least 1")

    def _require(self, name: str, holds: bool, expected: str) -> None:
        if not holds:
            raise TrainingDataError(f"RbfSettings.{name} is {getattr(self, name)!r}; give {expected}")

    @property
    def steps(self) -> int | None:
        """Gradient steps, or None where the weights are solved in closed form."""
        return self.epochs if self.method == "gradient" else None
