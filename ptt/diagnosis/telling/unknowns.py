"""The unknowns of an explanation: its blocks, the largest first, and how sure their values are."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.found import parts_of
from ptt.diagnosis.unknown.blocks import Block
from ptt.run.problem import Problem

LARGER_FACTOR = 1.5  # times all that is left: a block that puts more into the readings is cancelled by something else


@dataclass(frozen=True)
class Amounts:
    """Values of the features of all blocks of an explanation.

    Attributes:
        values: (w,).
        spread: their covariance, (w, w).
    """

    values: np.ndarray
    spread: np.ndarray


@dataclass(frozen=True)
class Unknown:
    """One block of an explanation.

    Attributes:
        block: the block.
        nats: that the explanation loses without it.
        energy: variance that it takes beside those before it, over that of what the named effects leave.
        part: what it puts into the readings, (n, 3) mm.
        amounts: of the features of all blocks; None where names take back what these put in.
        own: places of its own among them.
    """

    block: Block
    nats: float
    energy: float
    part: np.ndarray
    amounts: Amounts | None
    own: np.ndarray


@dataclass(frozen=True)
class Unnamed:
    """What the frame and the named effects leave of the readings, and the blocks that describe it.

    Attributes:
        left: (n, 3) mm, NaN on rows that do not count.
        unknowns: one for each block, the one that takes most of it first.
    """

    left: np.ndarray
    unknowns: tuple[Unknown, ...]


def unnamed_of(scorer: Scorer, state: State, problem: Problem, rows: slice | np.ndarray) -> Unnamed:
    """What the names of a set leave, and its blocks.

    Two blocks that make good for each other are each as large as they please. So the one that the readings would have
    alone is taken first, then the one that they would have beside it, and each has the share that it adds. Names and a
    block may do the same (sizes of an arm's links and a field that bends gently): where names beside blocks leave more
    than names alone do, a block is what the readings miss without it, all others as they would be then.

    Args:
        scorer: of the system.
        state: the best set.
        problem: the readings.
        rows: of these, those that the blocks know.

    Returns:
        Both.
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
    found = list[Unknown]()
    for key, energy in _energies(scorer, state, list(parts), beside):
        nats = state.total - scorer.score(without(state, key), state.memory, state.variances).total
        block, own = _block(system, key), first[key] + np.arange(_block(system, key).width)
        found.append(Unknown(block, nats, energy, parts[key], None if key in back else amounts, own))
    return Unnamed(left, tuple(sorted(found, key=lambda item: -item.energy)))


def _energies(
    scorer: Scorer, state: State, blocks: Sequence[str], beside: Callable[[Sequence[str]], np.ndarray]
) -> Iterator[tuple[str, float]]:
    """Blocks in the order in which the readings would have them, and the share that each adds to those before it.

    Args:
        scorer: of the system.
        state: the best set.
        blocks: its blocks.
        beside: what a set leaves of the readings, (n, 3) mm.
    """
    chosen = without(state, *blocks)
    before = whole = _spread(beside(chosen))
    for _ in blocks:
        others = [(*chosen, key) for key in blocks if key not in chosen]
        chosen = max(others, key=lambda keys: scorer.score(keys, state.memory, state.variances).total)
        after = min(before, _spread(beside(chosen)))
        yield chosen[-1], (before - after) / max(whole, 1e-300)
        before = after


def _block(system: System, key: str) -> Block:
    block = system.atoms[key].block
    assert block is not None
    return block


def _amounts(state: State, system: System, keys: Sequence[str]) -> Amounts:
    """Values of some blocks' features."""
    if not keys:
        return Amounts(np.zeros(0), np.zeros((0, 0)))
    return Amounts(*state.amounts([system.atoms[key] for key in keys], system.scale))


def _spread(readings: np.ndarray) -> float:
    """Mean square about the mean, mm^2: a level is another's to take, the frame's, an offset's."""
    return float(np.nanmean(np.square(readings - np.nanmean(readings, axis=0))))
