"""The linearised problem: whitened columns of everything that may explain the readings, and their normal sums."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.effect_atoms import straight_sizes
from ptt.diagnosis.noise.memory import WHITE, Hidden, Memory, MemorySums
from ptt.diagnosis.noise.wander import Clock, innovations
from ptt.diagnosis.unknown.blocks import Block
from ptt.diagnosis.unknown.places import FEATURE_SIZE
from ptt.fitting.alike import times_of
from ptt.fitting.evidence import profile_noise
from ptt.fitting.linear import Linear
from ptt.fitting.result import FitResult
from ptt.run.noise import Noise
from ptt.run.problem import Problem

ROUNDING_FACTOR = 2.0  # times the variance of rounding up to which errors of a pose may be rounding themselves


@dataclass
class System(ABC):
    """Columns of the frame and of all atoms, and the readings, as far as a search asks for them.

    Attributes:
        rows: which rows of the run count, (m,) int.
        frame: columns of frames and mounts.
        atoms: by key.
        clock: when the rows were read.
        noise: that whitened it.
        freedom: degrees of freedom of coordinates behind the noise, zero where it is only a guess.
        scale: (P,) size of a unit of each column.
        by_visit: whether what a memory calls a pose is one visit, so that it is a machine's scatter and no fault.
        aside: root mean square by which rounding of commands may put poses aside, mm.
    """

    rows: np.ndarray
    frame: np.ndarray
    atoms: dict[str, Atom]
    clock: Clock
    noise: Noise
    freedom: float
    scale: np.ndarray
    by_visit: bool = field(default=False, kw_only=True)
    aside: float = field(default=0.0, kw_only=True)

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of coordinates."""

    @property
    def spare(self) -> float:
        """Coordinates that tell of the scatter: where a frame stands is no news of it, however little it scatters.

        Source: restricted likelihood, Patterson and Thompson, Biometrika 58 (1971), with a flat prior of the frame.
        """
        return float(max(self.count - len(self.frame), 1))

    @cached_property
    def least_phi(self) -> float:
        """White variance that no set leaves less of, in units of the noise: that of the last digit of a reading."""
        return self.noise.least * self._noises

    @property
    def _noises(self) -> float:
        """Variance of one coordinate in units of the noise, of 1 mm^2."""
        return float(np.trace(np.linalg.inv(self.noise.covariance))) / 3.0

    def nats_of_noise(self, left: np.ndarray | float) -> np.ndarray:
        """Log evidence of white noise, its variance learned, where sets leave sums of squares, (..) in noise units."""
        return profile_noise(np.asarray(left), self.spare, self.freedom, self.least_phi)[1]

    def shares_by_pose(self, memory: Memory) -> bool:
        """Whether a memory holds errors that come back with their pose, which no machine's scatter does.

        Where nothing else scatters, what rounding leaves of readings comes back as well.
        """
        return memory.pose > ROUNDING_FACTOR * self.least_phi and not self.by_visit

    def errs_by_pose(self, memory: Memory) -> bool:
        """The same, and by more than rounding of commands leaves: something is there that no effect describes."""
        return self.shares_by_pose(memory) and memory.pose > ROUNDING_FACTOR * self.aside**2 / 3.0 * self._noises

    @property
    @abstractmethod
    def repeats(self) -> int:
        """Visits beyond the first of each pose."""

    @abstractmethod
    def sums(self, memory: Memory) -> MemorySums:
        """Normal sums of all columns."""

    @abstractmethod
    def left(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        """What solutions of chosen columns leave, (m, 3) whitened.

        Args:
            chosen: (p,) indices.
            values: (p,).
        """

    @abstractmethod
    def hidden(self, chosen: np.ndarray) -> Iterator[Hidden]:
        """Sums of chosen columns over each held-out block of travel."""

    def base_squares(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray | None:
        """Sums of squares that a solution of chosen columns leaves of base reflectors.

        Args:
            chosen: (p,) indices.
            values: (p,).

        Returns:
            Of each reading, (b,) in noise units; None where readings are no longer known one by one.
        """
        return None

    @property
    def memories(self) -> tuple[Memory, ...] | None:
        """The only memories whose sums there are; None for any."""
        return None

    def sums_of(self, chosen: np.ndarray, memory: Memory) -> MemorySums:
        """Normal sums of chosen columns."""
        return self.sums(memory).of(chosen)

    def among(self, chosen: np.ndarray, ways: np.ndarray) -> Callable[[Memory], MemorySums]:
        """Normal sums of combinations of chosen columns, under any memory.

        Args:
            chosen: (p,) indices.
            ways: (p, r) the combinations.
        """

        def sums(memory: Memory) -> MemorySums:
            own = self.sums_of(chosen, memory)
            return MemorySums(ways.T @ own.gram @ ways, ways.T @ own.side, own.square, own.log_noise)

        return sums

    def gram_after(self, chosen: np.ndarray) -> np.ndarray:
        """Products of chosen columns as they would be once the run is over: what slipped on the way stays so.

        Args:
            chosen: (p,) indices.

        Returns:
            (p, p); of a long run whose rows are gone those of the run itself.
        """
        return self.sums_of(chosen, WHITE).gram

    def forget(self) -> None:
        """Let go of what can be worked out again: the next system takes as much memory as this one."""
        self.__dict__.pop("families", None)

    def innovation(self, chosen: np.ndarray, values: np.ndarray, memory: Memory) -> np.ndarray:
        """What a solution leaves beyond what the wander predicts, (m, 3) in noise units."""
        return innovations(self.left(chosen, values), memory.wander, self.clock)[0]

    def in_mm(self, left: np.ndarray) -> np.ndarray:
        """Whitened readings (m, 3) in mm."""
        return left @ np.linalg.inv(self.noise.whitener).T

    def everywhere(self, left: np.ndarray, rows: int) -> np.ndarray:
        """Whitened readings (m, 3) in mm, NaN on the rows of the run that do not count, (rows, 3)."""
        whole = np.full((rows, 3), np.nan)
        whole[self.rows] = self.in_mm(left)
        return whole

    @cached_property
    def families(self) -> list[tuple[tuple[Atom, ...], np.ndarray]]:
        """Atoms of one width side by side, so that alike ones are screened together, and their columns (a, w)."""
        families: list[list[Atom]] = []
        for atom in sorted(self.atoms.values(), key=lambda atom: int(atom.columns[0])):
            before = families[-1][-1].columns if families else atom.columns
            if not families or len(before) != len(atom.columns) or before[-1] + 1 != atom.columns[0]:
                families.append([])
            families[-1].append(atom)
        return [(tuple(some), np.array([atom.columns for atom in some])) for some in families]


def straightened(linear: Linear, fitted: FitResult, problem: Problem) -> Linear:
    """The same with the straight parts of curves in sizes that they have over the visited travel."""
    more = np.ones(linear.columns.shape[2])
    for term, free in zip(fitted.layout.terms, fitted.layout.free, strict=True):
        more[linear.present[term.effect.key]] = straight_sizes(term.effect, problem)[free]
    sizes = {trial.effect.key: trial.effect for trial in linear.trials if any(p.lent for p in trial.effect.parameters)}
    known = {key: straight_sizes(effect, problem) for key, effect in sizes.items()}
    for trial in linear.trials:
        if trial.effect.key in known:
            more[trial.columns] = known[trial.effect.key][: len(trial.columns)]
    other = np.flatnonzero(more != 1.0)
    if not len(other):
        return linear
    columns, base = linear.columns.copy(), linear.base_columns * more
    columns[:, :, other] *= more[other]
    return replace(linear, columns=columns, scale=linear.scale * more, base_columns=base)


def clock_of(problem: Problem, rows: np.ndarray) -> Clock:
    """When rows were read: by the clock, else by their number; each run starts anew, a gap is as long as it took.

    Args:
        problem: n rows.
        rows: (n,) bool.

    Returns:
        The clock of those rows.
    """
    times, registered = times_of(problem, rows), problem.file.tracker.frame in ("trusted", "measured")
    return Clock(times.time, times.starts, registered)


def whitened(blocks: Sequence[Block], noise: Noise, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
    """Columns of blocks side by side in units of noise.

    Args:
        blocks: the blocks.
        noise: to whiten with.
        rows: which rows, m of them.

    Returns:
        (m, 3, sum of their widths); in memory they lie one behind the other, as a system keeps them.
    """
    ways, found = dict[int, np.ndarray](), list[np.ndarray]()
    for block in blocks:
        if id(block.place) not in ways:  # many act at one place
            slopes = FEATURE_SIZE * (noise.whitener @ block.place.slopes[rows])
            ways[id(block.place)] = np.ascontiguousarray(slopes.transpose(2, 1, 0))  # shape: (w, 3, m)
        shapes = np.ascontiguousarray(block.shapes[rows].T)
        own = ways[id(block.place)][:, None] * shapes[None, :, None]
        found.append(own.reshape(-1, *own.shape[2:]))
    return np.concatenate(found).transpose(2, 1, 0)


def holds_unknown(system: System, keys: Iterable[str], memory: Memory) -> bool:
    """Whether a set says what no effect describes: a block, or errors that come back with their pose."""
    return any(system.atoms[key].block is not None for key in keys) or system.errs_by_pose(memory)
