"""Selection of the noise's memory for a set of atoms: a wander of the tracker, random errors of poses, or both.

Wanders are compared on a grid of variances (shares) and time constants: a coarse look at the residual first, then
coordinate steps by the evidence with the set's columns marginalised.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from ptt.diagnosis.evidence.atoms import BLOCK_ODDS, MEMORY_ODDS
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import WHITE, Memory, MemorySums
from ptt.diagnosis.noise.wander import AS_NOISE, SHARES, Axes, Wander, kinds_of_wander, likelihoods
from ptt.fitting.factor import factor_of

# Tried variances of the error that a pose has to itself, over the white variance
POSE_RATIOS = np.geomspace(0.1, 1000.0, 9)
LEAST_REPEATS = 30  # visits beyond the first of each pose from which errors of a pose can be told from white noise
# Signal variance over noise of all directions left out while memories are compared: a tenth of a nat
NEGLIGIBLE_VARIANCE = 0.2
# Signal to noise at which a column is capped: more changes no evidence, and rounding would drown weak ones
MOST_SIGNAL = 1e5
# Index of the largest share below one: a wander that small may be there without a run showing it
BELOW_NOISE = int(np.searchsorted(SHARES, 1.0)) - 1
MOST_POSES = 300  # poses up to which a wander and errors of poses are tried together; more of them take minutes
FAST_STEPS = (0.7, 1.4, 2.8)  # rows of the decay of a wander that otherwise is white noise by another name
# Factor between errors of poses alone and beside a wander: the next grid value up or down at most
POSE_RATIO_STEP = 4.0
# Nats behind the best kind of wander on every other grid point, which the finer steps cannot make up
FAR_BEHIND_ON_GRID = 20.0
FAR_BEHIND = 200.0  # nats by which a memory may lie behind another before its grid is searched no further
Value = Callable[[Memory], float]  # log evidence and log prior of a memory, nats


@dataclass(frozen=True)
class Spot:
    """A point of the grid of wanders.

    Attributes:
        share: index of its share in `SHARES`.
        slow: index of its time constant.
        axes: how the share differs between axes, as of `Wander`.
        constants: time constants of the grid.
        most: index of the largest share that the run allows.
    """

    share: int
    slow: int
    axes: Axes
    constants: np.ndarray
    most: int

    @property
    def memory(self) -> Memory:
        """The wander as a memory of the noise."""
        return Memory(Wander(float(SHARES[self.share]), float(self.constants[self.slow]), self.axes))

    def beside(self, share: int, slow: int) -> "Spot | None":
        """The grid point so many steps away; None beyond the grid."""
        there = replace(self, share=self.share + share, slow=self.slow + slow)
        inside = 0 <= there.share <= self.most and 0 <= there.slow < len(self.constants)
        return there if inside else None


def best_memory(system: System, state: State, *, poses: bool = True) -> tuple[Memory, float]:
    """The best memory of the noise for a set at its learned variances, and the nats that it adds to the total.

    Args:
        system: the linearised problem.
        state: the set.
        poses: whether poses may have random errors.
    """
    among = system.among(state.columns, _signal_basis(system, state))
    seen: dict[Memory, float] = {}

    def value(memory: Memory) -> float:
        if memory not in seen:
            sums = among(memory)
            seen[memory] = _evidence(sums, system) - sums.log_noise + prior_of(memory, system)
        return seen[memory]

    poses = poses or system.by_visit
    tried = _neighbours(system, state, value, poses=poses) if system.memories is None else system.memories
    best = max([WHITE, state.memory, *(one for one in tried if poses or not one.pose)], key=value)
    return best, value(best) - value(state.memory)


def prior_of(memory: Memory, system: System) -> float:
    """Log prior odds of a memory of the noise; errors that repeat with their pose cost as much as an unknown block."""
    wander = 0.0 if memory.wander is None else memory.wander.log_prior - MEMORY_ODDS
    poses = BLOCK_ODDS if system.errs_by_pose(memory) else MEMORY_ODDS
    return wander - (poses if memory.pose else 0.0)


def _signal_basis(system: System, state: State) -> np.ndarray:
    """Combinations of a set's columns, of unit prior variance, with all but a tenth of a nat of signal, (p, r)."""
    gram = system.sums_of(state.columns, state.memory).gram
    size = np.minimum(
        np.sqrt(state.posterior.prior_variance), MOST_SIGNAL / np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    )
    eigenvalues, vectors = np.linalg.eigh(gram * size[:, None] * size)
    kept = np.cumsum(np.maximum(eigenvalues, 0.0)) > NEGLIGIBLE_VARIANCE
    return np.asarray(size[:, None] * vectors[:, kept])


def _evidence(sums: MemorySums, system: System) -> float:
    """Log evidence of columns with unit prior variance."""
    factor = factor_of(sums.gram, 1.0)
    along = lapack.dtrtrs(factor, sums.side, lower=1)[0] if len(factor) else sums.side
    left = max(sums.square - float(along @ along), 1e-12)
    return float(system.nats_of_noise(left) - np.log(factor.diagonal()).sum())


def _neighbours(system: System, state: State, value: Value, *, poses: bool) -> list[Memory]:
    """Memories to compare: errors of poses of all sizes, and the best wander of each kind, alone and beside these.

    Both together are tried up to `MOST_POSES` poses. With more, a wander is looked for only by itself, and only where
    its first grid point is not far behind the best errors of poses.
    """
    found = [state.memory]
    if poses and system.repeats >= LEAST_REPEATS:  # first, as they cost little and may leave nothing to a wander
        found += [Memory(None, float(size)) for size in POSE_RATIOS]
    if not len(system.clock.constants):
        return found
    left, alone = system.residual(state.columns, state.posterior.values), max([WHITE, *found[1:]], key=value)
    found += _fast_wander(system, alone, value) if alone.pose else []
    if (
        alone.pose
        and isinstance(system, RowSystem)
        and not system.one_memory
        and len(system.poses.visits) <= MOST_POSES
    ):
        return found + _beside_poses(system, left, alone, value)
    for spot in _rough_spots(system, left):
        if value(spot.memory) >= max(map(value, found)) - FAR_BEHIND:
            found.append(_best_beside(spot, value).memory)
    return found


def _fast_wander(system: System, poses: Memory, value: Value) -> list[Memory]:
    """The best wander that decays within a few rows: where a pose is read twice in a row, it looks like its error.

    None where its first grid point lies far behind errors of poses.
    """
    spot = Spot(BELOW_NOISE, 1, AS_NOISE, system.clock.step * np.array(FAST_STEPS), len(SHARES) - 1)
    near = value(spot.memory) >= value(poses) - FAR_BEHIND
    return [_best_beside(spot, value).memory] if near else []


def _beside_poses(system: RowSystem, left: np.ndarray, poses: Memory, value: Value) -> list[Memory]:
    """The best wander of each kind alone, and beside errors of poses of the same or a neighbouring size."""

    def beside(memory: Memory) -> float:
        return value(replace(memory, pose=poses.pose))

    sizes = [float(size) for size in POSE_RATIOS if 1.0 / POSE_RATIO_STEP < size / poses.pose < POSE_RATIO_STEP]
    spots = _rough_spots(system, left - system.poses.shrunk(left.T, poses.pose).T)
    both = [_best_beside(spot, beside) for spot in spots]
    near = [spot for spot in both if value(spot.memory) >= beside(spot.memory) - FAR_BEHIND]
    alone = [_best_beside(spot, value).memory for spot in near]
    return alone + [replace(spot.memory, pose=size) for spot in both for size in sizes]


def _rough_spots(system: System, left: np.ndarray) -> list[Spot]:
    """The likeliest coarse grid point of each kind of wander, likeliest kind first, without those far behind."""
    spots = sorted(
        (_rough_spot(system, left, axes) for axes in kinds_of_wander(system.noise)), key=lambda item: -item[1]
    )
    return [spot for spot, likely in spots if likely > spots[0][1] - FAR_BEHIND_ON_GRID]


def _best_beside(spot: Spot, value: Value) -> Spot:
    """The best wander of a kind, by coordinate ascent over the grid."""
    for _ in range(3):
        before, spot = spot, _uphill(_uphill(spot, 1, 0, value), 0, 1, value)
        if spot is before:
            break
    return spot


def _rough_spot(system: System, left: np.ndarray, axes: Axes) -> tuple[Spot, float]:
    """The likeliest coarse grid point for a residual, the set's values held, and its log likelihood.

    Where the frame was registered at the start of a run, the share is limited to one grid step above what the residual
    about its run means shows, or to below one: a wander that outlasts the run could else shift all of it at no cost.
    """
    clock, most = system.clock, len(SHARES) - 1
    if clock.registered:
        shown, _ = _likeliest(system, clock.about_means(left), axes, most)
        most = max(BELOW_NOISE, shown.share + 1)
    return _likeliest(system, left, axes, most)


def _likeliest(system: System, left: np.ndarray, axes: Axes, most: int) -> tuple[Spot, float]:
    constants = system.clock.constants
    spots = [Spot(i, j, axes, constants, most) for i in range(0, most + 1, 2) for j in range(0, len(constants), 2)]
    wanders = [spot.memory.wander for spot in spots]
    likely = likelihoods(left, [one for one in wanders if one is not None], system.clock)
    best = int(np.argmax(likely))
    return spots[best], float(likely[best])


def _uphill(spot: Spot, share: int, slow: int, value: Value) -> Spot:
    """The local maximum reached by single steps along one axis of the grid."""
    for sign in (1, -1):
        while (there := spot.beside(sign * share, sign * slow)) and value(there.memory) > value(spot.memory):
            spot = there
    return spot
