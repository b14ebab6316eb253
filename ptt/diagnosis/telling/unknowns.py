"""The unknowns of an explanation: contributions of its blocks, the largest first, and their posterior."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.found import parts_of
from ptt.diagnosis.unknown.block import Block
from ptt.run.problem import Problem

LARGER_FACTOR = 1.5  # times all that is left: a block that puts more into the readings is cancelled by something else
HIDDEN = 0.1  # share of what a block takes by itself, below which its part beside all others says nothing of that


@dataclass(frozen=True)
class Amounts:
    """Posterior of the features of all blocks of an explanation.

    Attributes:
        values: means, (w,).
        covariance: of them, (w, w).
    """

    values: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Unknown:
    """One block of an explanation.

    Attributes:
        block: the block.
        nats: that the explanation loses without it.
        energy: variance that it explains in addition to the blocks before it, over the residual variance of the names.
        part: its contribution to the readings, (n, 3) mm.
        amounts: posterior of the features of all blocks; None where the named effects cancel the contribution, or
            where it is what the block takes in addition.
        own: indices of its own features among them.
        in_addition: whether the contribution is what the block takes in addition to the blocks before it.
    """

    block: Block
    nats: float
    energy: float
    part: np.ndarray
    amounts: Amounts | None
    own: np.ndarray
    in_addition: bool = False


@dataclass(frozen=True)
class Unexplained:
    """The residual of the frame and the named effects, and the blocks that describe it.

    Attributes:
        left: (n, 3) mm, NaN on rows that do not count.
        unknowns: one for each block, by the variance explained, the largest first.
    """

    left: np.ndarray
    unknowns: tuple[Unknown, ...]


def unnamed_of(scorer: Scorer, state: State, problem: Problem, rows: slice | np.ndarray) -> Unexplained:
    """The residual of a set's named effects, and its blocks.

    Two blocks may cancel each other and be arbitrarily large. So shares are by forward selection: first the block that
    alone gives the highest score, then the best one beside it; each has the variance that it adds. Names and a block
    may cancel too (sizes of an arm's links and a gentle field). Where names and blocks together contribute much more
    than names alone leave, the contribution of a block is the change of the residual when it is left out and all else
    is refitted. Where the block that comes first has next to no part beside the others, because one of them does its
    work in the whole explanation, the contribution of each is what it takes in addition, as its share is.

    Args:
        scorer: of the system.
        state: the best set.
        problem: the readings.
        rows: rows of the problem on which the blocks' features are.

    Returns:
        Residual and blocks.
    """
    parts, system = parts_of(state, scorer.system), scorer.system

    def left_by(keys: Sequence[str]) -> np.ndarray:
        other = scorer.score(keys, state.memory, state.variances)
        return system.everywhere(system.residual(other.columns, other.posterior.values), problem.table.rows)[rows]

    whole, by_names = left_by(state.keys), left_by(without(state, *parts))
    most = LARGER_FACTOR**2 * _spread(by_names)
    fight = _spread(sum(parts.values(), whole)) > most
    counts = np.isfinite(whole).all(axis=1)
    back = {key for key, part in parts.items() if fight and _spread(part[counts]) > most}
    parts |= {key: left_by(without(state, key)) - whole for key in back}
    left, amounts = sum(parts.values(), whole), _amounts(state, system, list(parts))

    def beside(keys: Sequence[str]) -> np.ndarray:
        other = parts_of(scorer.score(keys, state.memory, state.variances), system)
        return left_by(keys) if fight else left - sum(other.values())

    first = dict(zip(parts, np.cumsum([0, *(_block(system, key).width for key in parts)]), strict=False))
    taken, found = list(_taken(scorer, state, list(parts), beside)), list[Unknown]()
    whole_spread = max(_spread(beside(without(state, *parts))), 1e-300)
    hidden = bool(taken) and _spread(parts[taken[0][0]]) < HIDDEN * _spread(taken[0][1])
    for key, alone, energy in taken:
        nats = state.total - scorer.less(state, key).total
        block, own = _block(system, key), first[key] + np.arange(_block(system, key).width)
        part, known = (alone, None) if hidden else (parts[key], None if key in back else amounts)
        found.append(Unknown(block, nats, energy / whole_spread, part, known, own, hidden))
    return Unexplained(left, tuple(sorted(found, key=lambda item: -item.energy)))


def _taken(
    scorer: Scorer, state: State, blocks: Sequence[str], beside: Callable[[Sequence[str]], np.ndarray]
) -> Iterator[tuple[str, np.ndarray, float]]:
    """Keys of blocks in the order of forward selection by score, what each takes in addition, and its mean square.

    Args:
        scorer: of the system.
        state: the best set.
        blocks: keys of its blocks.
        beside: keys of a set -> its residual, (n, 3) mm.

    Yields:
        Key, (n, 3) mm, and by how much the mean square falls, mm^2.
    """
    chosen = without(state, *blocks)
    left = beside(chosen)
    before = _spread(left)
    for _ in blocks:
        others = [(*chosen, key) for key in blocks if key not in chosen]
        chosen = max(others, key=lambda keys: scorer.score(keys, state.memory, state.variances).total)
        now = beside(chosen)
        after = min(before, _spread(now))
        yield chosen[-1], left - now, before - after
        left, before = now, after


def _block(system: System, key: str) -> Block:
    block = system.atoms[key].block
    assert block is not None
    return block


def _amounts(state: State, system: System, keys: Sequence[str]) -> Amounts:
    """Posterior of some blocks' features."""
    if not keys:
        return Amounts(np.zeros(0), np.zeros((0, 0)))
    return Amounts(*state.amounts([system.atoms[key] for key in keys], system.scale))


def _spread(readings: np.ndarray) -> float:
    """Mean square about the mean, mm^2, since a level belongs to the frame or an offset."""
    return float(np.nanmean(np.square(readings - np.nanmean(readings, axis=0))))
