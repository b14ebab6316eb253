"""The unknowns of an explanation: its blocks, the largest first, and how sure their values are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.found import parts_of
from ptt.diagnosis.unknown.blocks import Block


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
        amounts: of the features of all blocks.
        own: places of its own among them.
    """

    block: Block
    nats: float
    energy: float
    part: np.ndarray
    amounts: Amounts
    own: np.ndarray


def unknowns_of(scorer: Scorer, state: State, rest: np.ndarray) -> tuple[Unknown, ...]:
    """The blocks of a state, the one that takes most of what the names leave first.

    Two blocks that make good for each other are each as large as they please. So the one that the readings would have
    alone is taken first, then the one that they would have beside it, and each has the share that it adds.

    Args:
        scorer: of the system.
        state: the best set.
        rest: what the named effects leave of the rows that the blocks know, (n, 3) mm, NaN where they do not count.

    Returns:
        One for each block.
    """
    parts = parts_of(state, scorer.system)
    chosen, left, found = without(state, *parts), _spread(rest), list[Unknown]()
    whole, amounts = max(left, 1e-300), _amounts(state, scorer.system, list(parts))
    first = dict(zip(parts, np.cumsum([0, *(_block(scorer.system, key).width for key in parts)]), strict=False))
    for _ in parts:
        others = [key for key in parts if key not in chosen]
        ways = {key: scorer.score((*chosen, key), state.memory, state.scales) for key in others}
        key = max(ways, key=lambda key: ways[key].total)
        chosen = (*chosen, key)
        beside = _spread(rest - sum(parts_of(ways[key], scorer.system).values()))
        nats = state.total - scorer.score(without(state, key), state.memory, state.scales).total
        block, energy = _block(scorer.system, key), max(left - beside, 0.0) / whole
        found.append(Unknown(block, nats, energy, parts[key], amounts, first[key] + np.arange(block.width)))
        left = min(left, beside)
    return tuple(sorted(found, key=lambda item: -item.energy))


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
