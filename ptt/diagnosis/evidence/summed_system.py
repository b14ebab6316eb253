"""A system whose rows are gone: normal sums of a long run."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ptt.diagnosis.evidence.sampled import Held
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import HeldOutBlock, HeldOutSums, Memory, MemorySums


@dataclass
class SummedSystem(System):
    """A system that keeps sums only.

    Attributes:
        total: by memory of the noise; there are no others.
        held_out_sums: held-out block -> joined sums in noise units and in mm, and its rows.
        extra: coordinates of base reflectors.
        visits: beyond the first of each pose.
        look: what a solution leaves of all rows, by another pass over them.
    """

    total: dict[Memory, MemorySums]
    held_out_sums: dict[int, Held]
    extra: int
    visits: int
    look: Callable[[np.ndarray, np.ndarray], np.ndarray]
    _left: dict[bytes, np.ndarray] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return 3 * len(self.rows) + self.extra

    @property
    def repeats(self) -> int:
        """Visits beyond the first of each pose."""
        return self.visits

    @property
    def memories(self) -> tuple[Memory, ...]:
        """Those that there are sums of."""
        return tuple(self.total)

    def sums(self, memory: Memory) -> MemorySums:
        """Normal sums of all columns."""
        return self.total[memory]

    def residual(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        """What a solution leaves, (m, 3) whitened; the last few are kept."""
        key = chosen.tobytes() + values.tobytes()
        if key not in self._left:
            if len(self._left) > 3:
                self._left.pop(next(iter(self._left)))
            self._left[key] = self.look(chosen, values)
        return self._left[key]

    def held_out_blocks(self, chosen: np.ndarray) -> Iterator[HeldOutBlock]:
        """Sums of chosen columns over each held-out block of travel."""
        both = np.ix_(*(np.append(chosen, len(self.scale)),) * 2)
        for index, (white, in_mm, rows) in self.held_out_sums.items():
            if index >= 0:
                kept = white[both]
                yield HeldOutSums(kept[:-1, :-1], kept[:-1, -1], float(kept[-1, -1]), rows, in_mm[both])
