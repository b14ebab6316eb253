"""The linearised problem: whitened columns of everything that may explain the readings, and their normal sums."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.effect_atoms import straight_sizes
from ptt.diagnosis.noise.memory import WHITE, HeldOutBlock, Memory, MemorySums
from ptt.diagnosis.noise.wander import Clock, innovations
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.places import FEATURE_SIZE
from ptt.fitting.autocorrelation import times_of
from ptt.fitting.evidence import profile_noise
from ptt.fitting.linear import Linear
from ptt.fitting.result import FitResult
from ptt.run.noise import Noise
from ptt.run.problem import Problem

ROUNDING_FACTOR = 2.0  # times the variance of rounding up to which errors of a pose may be rounding themselves


@dataclass
class System(ABC):
    """y = F phi + sum X_k beta_k + noise: the readings, columns of the frame and of all atoms, and their sums.

    `RowSystem` holds the rows; `SummedSystem` holds only sums, for long runs.

    Attributes:
        rows: numbers of the rows of the run that count, (m,) int.
        frame: indices of the columns of frames and mounts, which are in every set.
        atoms: by key.
        clock: when the rows were read.
        noise: the noise that whitened readings and columns.
        freedom: degrees of freedom, in coordinates, behind that noise; zero where it is only a guess.
        scale: (P,) size of a unit of each column.
        by_visit: whether errors "of a pose" are those of single visits: a scatter of the machine, then, and no fault.
        rounding_mm: root mean square position error by rounding of the commands.
    """

    rows: np.ndarray
    frame: np.ndarray
    atoms: dict[str, Atom]
    clock: Clock
    noise: Noise
    freedom: float
    scale: np.ndarray
    by_visit: bool = field(default=False, kw_only=True)
    rounding_mm: float = field(default=0.0, kw_only=True)

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of coordinates, base reflectors included."""

    @property
    def restricted_count(self) -> float:
        """Coordinates less those that the frame takes, as in restricted maximum likelihood (REML).

        Source: Patterson and Thompson, Biometrika 58 (1971), with a flat prior of the frame.
        """
        return float(max(self.count - len(self.frame), 1))

    @cached_property
    def least_phi(self) -> float:
        """Lower bound of the white variance, in units of the noise: the rounding error of the readings' last digit."""
        return self.noise.least * self._per_mm2

    @property
    def _per_mm2(self) -> float:
        """A variance of 1 mm^2 of one coordinate, in units of the noise: the mean over axes of its inverse variance."""
        return float(np.trace(np.linalg.inv(self.noise.covariance))) / 3.0

    def nats_of_noise(self, left: np.ndarray | float) -> np.ndarray:
        """Log evidence's term of the white noise, its variance profiled out, for penalised sums of squares, (..)."""
        return profile_noise(np.asarray(left), self.restricted_count, self.freedom, self.least_phi)[1]

    def shares_by_pose(self, memory: Memory) -> bool:
        """Whether a memory has errors that repeat with their pose and exceed the rounding of the readings.

        Rounding errors of the readings repeat as well where nothing else scatters.
        """
        return memory.pose > ROUNDING_FACTOR * self.least_phi and not self.by_visit

    def errs_by_pose(self, memory: Memory) -> bool:
        """Whether errors repeat with their pose beyond rounding of readings and commands: then an unknown is there."""
        return self.shares_by_pose(memory) and memory.pose > ROUNDING_FACTOR * self.rounding_mm**2 / 3.0 * self._per_mm2

    @property
    @abstractmethod
    def repeats(self) -> int:
        """Number of visits beyond the first of each pose."""

    @abstractmethod
    def sums(self, memory: Memory) -> MemorySums:
        """Normal sums of all columns under a memory of the noise."""

    @abstractmethod
    def residual(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Residual y - X b, (m, 3) whitened.

        Args:
            chosen: indices of the columns X, (p,).
            values: b, (p,).
        """

    @abstractmethod
    def held_out_blocks(self, chosen: np.ndarray) -> Iterator[HeldOutBlock]:
        """Sums of chosen columns over each block of travel that is held out in turn."""

    def base_squares(self, chosen: np.ndarray, values: np.ndarray) -> np.ndarray | None:
        """Squared residuals of base reflectors.

        Args:
            chosen: (p,) indices.
            values: (p,).

        Returns:
            Of each of their readings, (b,) in noise units squared; None where only sums are kept.
        """
        return None

    @property
    def memories(self) -> tuple[Memory, ...] | None:
        """The only memories under which sums are available; None where any is."""
        return None

    def sums_of(self, chosen: np.ndarray, memory: Memory) -> MemorySums:
        """Normal sums of chosen columns."""
        return self.sums(memory).of(chosen)

    def among(self, chosen: np.ndarray, basis: np.ndarray) -> Callable[[Memory], MemorySums]:
        """A function that gives normal sums of linear combinations of chosen columns under any memory.

        Args:
            chosen: (p,) indices.
            basis: (p, r) weights of the combinations.
        """

        def sums(memory: Memory) -> MemorySums:
            own = self.sums_of(chosen, memory)
            return MemorySums(basis.T @ own.gram @ basis, basis.T @ own.side, own.square, own.log_noise)

        return sums

    def gram_after(self, chosen: np.ndarray) -> np.ndarray:
        """Gram matrix of chosen columns for the machine as the run left it: sudden effects act on all rows.

        Args:
            chosen: (p,) indices.

        Returns:
            (p, p); where only sums are kept, the Gram matrix of the run itself.
        """
        return self.sums_of(chosen, WHITE).gram

    def forget(self) -> None:
        """Drop caches, since the next system takes as much memory as this one."""
        self.__dict__.pop("families", None)

    def innovation(self, chosen: np.ndarray, values: np.ndarray, memory: Memory) -> np.ndarray:
        """Innovations of a solution's residual under the wander, (m, 3) in noise units."""
        return innovations(self.residual(chosen, values), memory.wander, self.clock)[0]

    def in_mm(self, left: np.ndarray) -> np.ndarray:
        """Whitened vectors (m, 3) in mm."""
        return left @ np.linalg.inv(self.noise.whitener).T

    def everywhere(self, left: np.ndarray, rows: int) -> np.ndarray:
        """Whitened vectors (m, 3) in mm at their rows of the run, (rows, 3); NaN on rows that do not count."""
        whole = np.full((rows, 3), np.nan)
        whole[self.rows] = self.in_mm(left)
        return whole

    @cached_property
    def families(self) -> list[tuple[tuple[Atom, ...], np.ndarray]]:
        """Runs of atoms with equally many adjacent columns, to be screened in one batch, and their columns (a, w)."""
        families: list[list[Atom]] = []
        for atom in sorted(self.atoms.values(), key=lambda atom: int(atom.columns[0])):
            before = families[-1][-1].columns if families else atom.columns
            if not families or len(before) != len(atom.columns) or before[-1] + 1 != atom.columns[0]:
                families.append([])
            families[-1].append(atom)
        return [(tuple(some), np.array([atom.columns for atom in some])) for some in families]


def straightened(linear: Linear, fitted: FitResult, problem: Problem) -> Linear:
    """The linearised problem with the straight parts of curves in the size that they have over the visited travel."""
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
    """When rows were read: by the clock, else by their number; each run starts anew.

    Args:
        problem: n rows.
        rows: (n,) bool.

    Returns:
        The clock of those rows.
    """
    times, registered = times_of(problem, rows), problem.file.tracker.frame in ("trusted", "measured")
    return Clock(times.time, times.starts, registered)


def whitened(blocks: Sequence[Block], noise: Noise, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
    """Columns of blocks, whitened.

    Args:
        blocks: the blocks.
        noise: to whiten with.
        rows: which rows, m of them.

    Returns:
        (m, 3, sum of their widths), a transposed view: in memory each column is contiguous, as a system keeps them.
    """
    at_place, found = dict[int, np.ndarray](), list[np.ndarray]()
    for block in blocks:
        if id(block.place) not in at_place:  # many blocks share a place
            slopes = FEATURE_SIZE * (noise.whitener @ block.place.slopes[rows])
            at_place[id(block.place)] = np.ascontiguousarray(slopes.transpose(2, 1, 0))  # shape: (w, 3, m)
        shapes = np.ascontiguousarray(block.shapes[rows].T)
        own = at_place[id(block.place)][:, None] * shapes[None, :, None]
        found.append(own.reshape(-1, *own.shape[2:]))
    return np.concatenate(found).transpose(2, 1, 0)


def holds_unknown(system: System, keys: Iterable[str], memory: Memory) -> bool:
    """Whether a set has an unknown: a block, or errors that repeat with their pose."""
    return any(system.atoms[key].block is not None for key in keys) or system.errs_by_pose(memory)
