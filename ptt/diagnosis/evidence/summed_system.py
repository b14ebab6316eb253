"""The linearised problem of a long run, of which only normal sums are kept."""

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
        total: memory of the noise -> sums; no other memories are available.
        held_out_sums: held-out block -> products of columns and readings in noise units and in mm, and its rows.
        extra: number of coordinates of base reflectors.
        visits: number of visits beyond the first of each pose.
        residual_by_pass: (columns, values) -> residual of all rows, by another pass over them.
    """

    total: dict[Memory, MemorySums]
    held_out_sums: dict[int, Held]
    extra: int
    visits: int
    residual_by_pass: Callable[[np.ndarray, np.ndarray], np.ndarray]
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
        """Those with sums."""
        return tuple(self.total)

    def sums(self, memory: Memory) -> MemorySums:
        """Normal sums of all columns."""
        return self.total[memory]

    def residual(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Residual of a solution, (m, 3) whitened; the last few are cached."""
        key = chosen.tobytes() + values.tobytes()
        if key not in self._left:
            if len(self._left) > 3:
                self._left.pop(next(iter(self._left)))
            self._left[key] = self.residual_by_pass(chosen, values)
        return self._left[key]

    def held_out_blocks(self, chosen: np.ndarray) -> Iterator[HeldOutBlock]:
        """Sums of chosen columns over each held-out block of travel."""
        both = np.ix_(*(np.append(chosen, len(self.scale)),) * 2)
        for index, (white, in_mm, rows) in self.held_out_sums.items():
            if index >= 0:
                kept = white[both]
                yield HeldOutSums(kept[:-1, :-1], kept[:-1, -1], float(kept[-1, -1]), rows, in_mm[both])
