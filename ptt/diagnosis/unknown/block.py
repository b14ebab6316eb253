"""One kind of unknown physics: where it acts, what it depends on, and its shapes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ptt.dependence.contexts import is_joint
from ptt.diagnosis.unknown.places import Place

Period = tuple[int | None, float]  # joint and length in its unit; None and seconds for a cycle over time


@dataclass(frozen=True)
class Block:
    """One kind of unknown physics.

    Attributes:
        name: where it acts and what it depends on, as in 'slider 2 on b2'.
        place: where it acts.
        on: the variables it depends on, the leading one first.
        shapes: basis functions of these at each row, (n, s), of about unit size.
        period: of a wave along a joint's travel or over time, in its unit, as the name has it; None for others.
        is_law: whether it is a law of one variable (`ptt.diagnosis.search.laws`).
        jumps: of a law with jumps, the values of its variable at which it jumps.
        gradual: whether it changes gradually after each reversal.
    """

    name: str
    place: Place
    on: tuple[str, ...]
    shapes: np.ndarray
    period: float | None = None
    is_law: bool = False
    jumps: tuple[float, ...] = ()
    gradual: bool = False

    @property
    def key(self) -> str:
        """Unique among all blocks: laws that jump at different values share a name."""
        return f"{self.name}#{' '.join(map(repr, self.jumps))}" if self.jumps else self.name

    @property
    def features(self) -> np.ndarray:
        """Shifts of the readings by each of its m features, (n, 3, m) mm; they share one learned variance."""
        return self.place.times(self.shapes)

    @property
    def is_curve(self) -> bool:
        """Whether it is a free curve over the travel of its own joint."""
        return self.period is None and len(self.on) == 1 and self._has_own_travel

    @property
    def varies_curve(self) -> bool:
        """Whether it is a curve over the travel of its own joint that changes with another variable."""
        return len(self.on) > 1 and not self.reverses and self._has_own_travel

    @property
    def _has_own_travel(self) -> bool:
        joint = self.place.joint
        return joint is not None and any(is_joint(name) and name[1:] == str(joint + 1) for name in self.on)

    def is_like(self, other: "Block") -> bool:
        """Whether another block acts at the same place and has the same leading variable."""
        return self.place.residual == other.place.residual and self.on[0] == other.on[0]

    @property
    def is_spell(self) -> bool:
        """Whether it is a law of something that changes at moments: comes and goes, switches, or jumps once."""
        return bool(self.jumps) and self.on == ("time",)

    @property
    def is_change(self) -> bool:
        """Whether it is a law of what changed once, by amounts that vary over the workspace: a field after a moment."""
        return self.is_spell and len(self.jumps) == 1 and self.shapes.shape[1] > len(self.jumps) + 1

    @property
    def reverses(self) -> bool:
        """Whether it depends on the direction of arrival, as play does."""
        return self.on[0].rstrip("0123456789") == "direction"

    @property
    def width(self) -> int:
        """Number m of its features."""
        return int(self.place.slopes.shape[2] * self.shapes.shape[1])


@dataclass(frozen=True)
class Recipe:
    """A block whose shapes are made only if it is wanted; attributes as of `Block`."""

    name: str
    place: Place
    on: tuple[str, ...]
    make: Callable[[], np.ndarray]
    period: float | None = None
    gradual: bool = False
