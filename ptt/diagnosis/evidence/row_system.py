"""The linearised problem with its rows: contiguous columns of everything that may explain the readings."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_sudden
from ptt.diagnosis.evidence.row_sums import (
    FewSums,
    SumsOfPoses,
    SumsOfRows,
    flattened,
    held_out_rows,
    sums_of_poses,
    sums_of_rows,
)
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import WHITE, HeldOutBlock, Memory, MemorySums, as_joined, base_sums
from ptt.diagnosis.noise.poses import Poses
from ptt.diagnosis.noise.wander import Wander, filtered
from ptt.effects.sudden import ALWAYS
from ptt.fitting.linear import LinearPoint

KEPT_MEMORIES = 3  # memories of the noise whose sums are kept


@dataclass
class RowSystem(System):
    """A system that holds its m rows.

    Attributes:
        columns: (m, 3, P) whitened.
        values: readings, (m, 3) whitened.
        poses: groups of rows with a common random error: those of one pose, or of one visit.
        block: held-out block of travel of each row, (m,) int, -1 for none.
        levers: joint -> shift of each reading per `FEATURE_SIZE` of the joint, (m, 3) whitened.
        at: the linearisation, which gives columns of further shapes.
        base_columns: of the base reflectors, (b, 3, P) in units of their own noise.
        base_values: readings of the base reflectors, (b, 3).
        asked_little: whether so few sets are scored that sums of all columns do not pay.
        one_memory: whether a wander and errors of poses are never combined, as sums of chunks have only one of them.
    """

    columns: np.ndarray
    values: np.ndarray
    poses: Poses
    block: np.ndarray
    levers: dict[int, np.ndarray]
    at: LinearPoint
    base_columns: np.ndarray
    base_values: np.ndarray
    asked_little: bool = False
    one_memory: bool = False
    _sums: dict[Memory, MemorySums] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return self.values.size + self.base_values.size

    @property
    def repeats(self) -> int:
        """Visits beyond the first of each pose."""
        return len(self.poses.order) - len(self.poses.visits)

    @cached_property
    def flat(self) -> np.ndarray:
        """The columns, each contiguous in memory, (P, 3, m)."""
        return np.ascontiguousarray(self.columns.transpose(2, 1, 0))

    def sums(self, memory: Memory) -> MemorySums:
        """Normal sums of all columns; those of the last few memories are cached."""
        if memory not in self._sums:
            if len(self._sums) > KEPT_MEMORIES:
                self._sums.pop(next(key for key in self._sums if key != WHITE))
            self._sums[memory] = self._sums_of_all(memory)
        return self._sums[memory]

    def forget(self) -> None:
        """Drop the sums of all columns, which fill gigabytes for thousands of readings of an arm."""
        super().forget()
        self._sums.clear()
        self.__dict__.pop("_means", None)

    def _sums_of_all(self, memory: Memory) -> MemorySums:
        if memory.pose:
            means = self._means if memory.wander is None else self._means_of(self.flat, memory.wander)
            return self._beside_poses(self.sums(Memory(memory.wander)), means, memory)
        return sums_of_rows(*self._white(None, memory.wander), all_of_them=not self.asked_little)

    def _beside_poses(self, plain: MemorySums, means: np.ndarray, memory: Memory) -> MemorySums:
        """Sums with random errors of poses, from those without and the pose means of the columns."""
        values = self._means_of(self.values.T[None], memory.wander)[0]
        return sums_of_poses(plain, means, values, self.poses.beside(memory.wander, self.clock), memory.pose)

    def _means_of(self, rows: np.ndarray, wander: Wander | None) -> np.ndarray:
        """Pose means of columns (p, 3, m), or their counterpart under a wander (`PosesBeside.means`), (p, 3 poses)."""
        return flattened(self.poses.beside(wander, self.clock).means(filtered(rows, wander, self.clock)[0]))

    @cached_property
    def _means(self) -> np.ndarray:
        return self._means_of(self.flat, None)

    def sums_of(self, chosen: np.ndarray, memory: Memory) -> MemorySums:
        """Normal sums of chosen columns, from those of all columns where these are cached."""
        if memory in self._sums:
            return super().sums_of(chosen, memory)
        white, values, log_noise = self._white(chosen, memory.wander)
        sums = MemorySums(white @ white.T, white @ values, float(values @ values), log_noise)
        if not memory.pose:
            return sums
        means = self._means_of(self.flat[chosen], memory.wander)
        return self._beside_poses(sums, means, memory).of(np.arange(len(chosen)))

    def gram_after(self, chosen: np.ndarray) -> np.ndarray:
        """As `System.gram_after`, with sudden effects acting on all rows."""
        gram, place = super().gram_after(chosen), {column: number for number, column in enumerate(chosen)}
        slips = [atom for atom in self.atoms.values() if is_sudden(atom) and set(atom.columns) <= set(place)]
        during = self.columns[:, :, chosen]
        after = during.copy()
        for atom in slips:
            assert atom.effect is not None
            after[:, :, [place[column] for column in atom.columns]] = self.at.columns(atom.effect, ALWAYS)[self.rows]
        return gram + (_gram(after) - _gram(during) if slips else 0.0)

    def among(self, chosen: np.ndarray, basis: np.ndarray) -> Callable[[Memory], MemorySums]:
        """As `System.among`, using cached sums."""

        def joined() -> np.ndarray:
            rows = self.flat[chosen]
            columns = (basis.T @ flattened(rows)).reshape(basis.shape[1], *rows.shape[1:])
            return np.concatenate([columns, self.values.T[None]])

        base = self.base_columns[:, :, chosen] @ basis
        more = base_sums(base, self.base_values) if len(self.base_values) else np.zeros((1, 1))
        white = means = None
        if WHITE in self._sums:
            white = as_joined(super().among(chosen, basis)(WHITE))
        if "_means" in self.__dict__:
            own = self.poses.means(self.values.T)[None]  # shape: (1, 3, poses)
            means = np.concatenate([(basis.T @ self._means[chosen]).reshape(basis.shape[1], *own.shape[1:]), own])
        return FewSums(joined, more, self.clock, self.poses, white, means).of

    def residual(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Residual of a solution of chosen columns, (m, 3) whitened."""
        rows = self.flat[chosen]
        return self.values - (values @ flattened(rows)).reshape(rows.shape[1:]).T

    def base_squares(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Squared residual of each reading of base reflectors, (b,) in noise units squared."""
        return np.asarray(np.square(self.base_values - self.base_columns[:, :, chosen] @ values).sum(axis=1))

    def held_out_blocks(self, chosen: np.ndarray) -> Iterator[HeldOutBlock]:
        """Rows and sums of chosen columns over each held-out block of travel."""
        columns, unit = self.flat[chosen], np.linalg.inv(self.noise.whitener)
        for index in np.unique(self.block[self.block >= 0]):
            own = np.flatnonzero(self.block == index)
            yield held_out_rows(columns[:, :, own], self.values.T[:, own], unit)

    def widened(
        self, atoms: dict[str, Atom], columns: np.ndarray, scale: np.ndarray, on_base: np.ndarray | None = None
    ) -> "RowSystem":
        """A system with further atoms; cached sums are extended.

        Args:
            atoms: by key, in the order of their columns, which are numbered anew, on from the present ones.
            columns: of these atoms, (m, 3, w) whitened.
            scale: (w,) size of a unit of each.
            on_base: the same columns at the base reflectors, (b, 3, w); None where they do not act on these.
        """
        more, first, further = np.ascontiguousarray(columns.transpose(2, 1, 0)), len(self.scale), dict(atoms)
        for key, atom in atoms.items():
            further[key] = replace(atom, columns=np.arange(first, first + len(atom.columns)))
            first += len(atom.columns)
        assert first == len(self.scale) + len(more), "each column is of one atom"
        flat = np.concatenate([self.flat, more])
        still = np.zeros((*self.base_values.shape, len(more)))
        base = np.concatenate([self.base_columns, still if on_base is None else on_base], axis=2)
        wider = replace(
            self, atoms=self.atoms | further, columns=flat.transpose(2, 1, 0),
            scale=np.concatenate([self.scale, scale]), base_columns=base, _sums={},
        )  # fmt: skip
        if "_means" in self.__dict__:
            wider.__dict__["_means"] = np.concatenate([self._means, flattened(self.poses.means(more))])
        for memory, sums in sorted(self._sums.items(), key=lambda item: item[0].pose > 0.0):  # these use the others
            if isinstance(sums, SumsOfRows):
                white, values, _ = wider._white(np.arange(len(self.flat), len(flat)), memory.wander)
                wider._sums[memory] = sums.widened(white, values)
            elif isinstance(sums, SumsOfPoses):
                means = np.concatenate([sums.means, wider._means_of(more, memory.wander)])
                values = self._means_of(self.values.T[None], memory.wander)[0]
                wider._sums[memory] = sums.widened(wider.sums(Memory(memory.wander)), means, values)
        return wider

    def only(self, keys: Sequence[str]) -> "RowSystem":
        """A system of the frame and a few atoms alone, for few sets."""
        atoms = [self.atoms[key] for key in keys]
        chosen = np.concatenate([self.frame, *(atom.columns for atom in atoms)]).astype(int)
        place = np.zeros(len(self.flat), dtype=int)
        place[chosen] = np.arange(len(chosen))
        few = {atom.key: replace(atom, columns=place[atom.columns]) for atom in atoms}
        return replace(
            self, frame=place[self.frame], atoms=few, columns=self.flat[chosen].transpose(2, 1, 0),
            scale=self.scale[chosen], base_columns=self.base_columns[:, :, chosen], asked_little=True, _sums={},
        )  # fmt: skip

    def _white(self, chosen: np.ndarray | None, wander: Wander | None) -> tuple[np.ndarray, np.ndarray, float]:
        """Columns and readings filtered by a wander, base reflectors appended.

        Args:
            chosen: (p,) indices; None for all.
            wander: of the tracker; None for white noise.

        Returns:
            Columns (p, r), readings (r,), and half the log-determinant of the noise's covariance.
        """
        index = slice(None) if chosen is None else chosen
        white, log_noise = filtered(self.flat[index], wander, self.clock)
        values, _ = filtered(self.values.T, wander, self.clock)
        flat = flattened(white)
        if not len(self.base_values):
            return flat, values.ravel(), log_noise
        base = self.base_columns[:, :, index].reshape(self.base_values.size, len(white)).T
        return np.concatenate([flat, base], axis=1), np.append(values.ravel(), self.base_values), log_noise


def rows_of(system: System) -> RowSystem:
    """The system, where it holds its rows.

    Raises:
        TypeError: it keeps only sums, as of a long run.
    """
    if not isinstance(system, RowSystem):
        raise TypeError("this looks at readings one by one, and of a long run only their sums are kept")
    return system


def _gram(columns: np.ndarray) -> np.ndarray:
    """Gram matrix of columns (m, 3, p), (p, p)."""
    return np.asarray(np.tensordot(columns, columns, axes=((0, 1), (0, 1))))
