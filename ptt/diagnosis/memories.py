"""Which memory of the noise suits a set of atoms: a wander of the tracker, errors that belong to a pose, or none."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from ptt.diagnosis.atoms import MEMORY_ODDS
from ptt.diagnosis.memory import WHITE, Memory, Sums
from ptt.diagnosis.state import State
from ptt.diagnosis.system import System
from ptt.diagnosis.wander import SHARES, Axes, Wander, kinds_of_wander, likelihoods
from ptt.fitting.factor import factor_of

POSES = np.geomspace(0.1, 1000.0, 9)  # variance that each pose has to itself, over that of the white noise
REPEATED = 30  # visits beyond the first from which errors of a pose can be told from scatter
UNSEEN = 0.2  # variance over noise of all that is left out where memories of the noise are compared: a tenth of a nat
STRONG = 1e5  # deviations that a column may well make: more widens no evidence, and rounding would drown weak ones
AT_REST = int(np.searchsorted(SHARES, 1.0)) - 1  # number of the share that a wander may have without a run showing it
FAR_BEHIND = 200.0  # nats that steps over the grid hardly bring, where another memory is ahead by them
Value = Callable[[Memory], float]


@dataclass(frozen=True)
class Spot:
    """A wander on the grid of those that are tried.

    Attributes:
        share: number of its share.
        slow: number of its time constant.
        axes: of the wander.
        constants: time constants of the grid.
        most: number of the largest share that the run allows.
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
        """So many steps on; None beyond the grid."""
        there = replace(self, share=self.share + share, slow=self.slow + slow)
        inside = 0 <= there.share <= self.most and 0 <= there.slow < len(self.constants)
        return there if inside else None


def best_memory(system: System, state: State) -> tuple[Memory, float]:
    """The memory of the noise that suits a state's atoms at their variances, and what it adds to the total.

    Args:
        system: the linearised problem.
        state: the set.
    """
    among = system.among(state.columns, _ways(system, state))
    seen: dict[Memory, float] = {}

    def value(memory: Memory) -> float:
        if memory not in seen:
            sums = among(memory)
            seen[memory] = _evidence(sums, system) - sums.log_noise + prior_of(memory)
        return seen[memory]

    tried = _neighbours(system, state, value) if system.memories is None else system.memories
    best = max([WHITE, state.memory, *tried], key=value)
    return best, value(best) - value(state.memory)


def prior_of(memory: Memory) -> float:
    """Log prior odds of a memory of the noise."""
    wander = 0.0 if memory.wander is None else memory.wander.log_prior - MEMORY_ODDS
    return wander - (MEMORY_ODDS if memory.pose else 0.0)


def _ways(system: System, state: State) -> np.ndarray:
    """Combinations of a state's columns of unit variance that say all but a tenth of a nat, (p, r)."""
    gram = system.sums_of(state.columns, state.memory).gram
    size = np.minimum(np.sqrt(state.posterior.prior), STRONG / np.sqrt(np.maximum(gram.diagonal(), 1e-300)))
    strength, ways = np.linalg.eigh(gram * size[:, None] * size)
    kept = np.cumsum(np.maximum(strength, 0.0)) > UNSEEN
    return np.asarray(size[:, None] * ways[:, kept])


def _evidence(sums: Sums, system: System) -> float:
    """Log evidence of columns of unit variance."""
    factor, known = factor_of(sums.gram, 1.0), system.freedom + system.spare
    along = lapack.dtrtrs(factor, sums.side, lower=1)[0] if len(factor) else sums.side
    left = max(sums.square - float(along @ along), 1e-12)
    return -float(np.log(factor.diagonal()).sum()) - 0.5 * known * float(np.log((system.freedom + left) / known))


def _neighbours(system: System, state: State, value: Value) -> list[Memory]:
    """All errors of poses without a wander, and the best wander of each kind that is not far behind what there is."""
    found = [state.memory]
    if system.repeats >= REPEATED:  # first: they cost little, and may leave nothing to a wander
        found += [Memory(None, float(size)) for size in POSES]
    if len(system.clock.constants):
        left = system.left(state.columns, state.posterior.values)
        spots = [_rough_spot(system, left, axes) for axes in kinds_of_wander(system.noise)]
        for spot, _ in sorted(spots, key=lambda item: -item[1]):
            if value(spot.memory) >= max(map(value, found)) - FAR_BEHIND:
                found.append(_best_beside(spot, value))
    return found


def _best_beside(spot: Spot, value: Value) -> Memory:
    """The best wander of a kind by coordinate steps over the grid."""
    for _ in range(3):
        before, spot = spot, _uphill(_uphill(spot, 1, 0, value), 0, 1, value)
        if spot is before:
            break
    return spot.memory


def _rough_spot(system: System, left: np.ndarray, axes: Axes) -> tuple[Spot, float]:
    """Where on the grid the wander of a state's residual lies, its atoms held, and how likely it makes the residual.

    A frame that was registered is off by no more than readings scatter, or than the run shows of a wander about its
    mean: one that outlasts the run would else shift all of it for nothing.
    """
    clock, most = system.clock, len(SHARES) - 1
    if clock.registered:
        shown, _ = _likeliest(system, clock.about_means(left), axes, most)
        most = max(AT_REST, shown.share + 1)
    return _likeliest(system, left, axes, most)


def _likeliest(system: System, left: np.ndarray, axes: Axes, most: int) -> tuple[Spot, float]:
    constants = system.clock.constants
    spots = [Spot(i, j, axes, constants, most) for i in range(0, most + 1, 2) for j in range(0, len(constants), 2)]
    wanders = [spot.memory.wander for spot in spots]
    likely = likelihoods(left, [one for one in wanders if one is not None], system.clock)
    best = int(np.argmax(likely))
    return spots[best], float(likely[best])


def _uphill(spot: Spot, share: int, slow: int, value: Value) -> Spot:
    """The local maximum that single steps along one side of the grid lead to."""
    for sign in (1, -1):
        while (there := spot.beside(sign * share, sign * slow)) and value(there.memory) > value(spot.memory):
            spot = there
    return spot
