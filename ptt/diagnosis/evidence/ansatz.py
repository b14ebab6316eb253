"""Ansatz: a long run as chunks are made of it, and what all of them are linearised at."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.system import straightened, whitened
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.unknown.blocks import Period, unknown_blocks
from ptt.diagnosis.unknown.span import Span
from ptt.effects import Effect
from ptt.fitting.linear import Linear, Shape, linear_columns
from ptt.fitting.result import FitResult
from ptt.run.holdout import blocks as travel_blocks
from ptt.run.holdout import blocks_beside, sharing_groups
from ptt.run.noise import Noise
from ptt.run.problem import Problem

Chunks = Sequence[Callable[[], Problem]]
Trials = Mapping[str, tuple[Effect, Sequence[Shape]]]  # candidates by key, each in the shapes that are summed


@dataclass(frozen=True)
class LongRun:
    """A long run as chunks are made of it.

    Attributes:
        problem: all rows.
        chunks: makers of its chunks, in order.
        span: what it covers.
        block: held-out block of each row, (n,) int.
        pose: (n,) int, equal for rows that may err alike: of one pose, or of one visit.
        by_visit: whether of one visit.
    """

    problem: Problem
    chunks: Chunks
    span: Span
    block: np.ndarray
    pose: np.ndarray
    by_visit: bool


@dataclass(frozen=True)
class Ansatz:
    """What all chunks are linearised at.

    Attributes:
        fitted: the model; its layout and unknowns.
        blocks: atoms of the blocks that stand beside it, in the order of their columns.
        periods: joint (None: time) and length of periods among them.
        noise: the noise floor.
        freedom: degrees of freedom behind it.
        memory: of the noise.
    """

    fitted: FitResult
    blocks: tuple[Atom, ...]
    periods: Sequence[Period]
    noise: Noise
    freedom: float
    memory: Memory


def open_long_run(problem: Problem, chunks: Chunks, span: Span) -> LongRun:
    """A long run with its held-out blocks and poses.

    Args:
        problem: all rows.
        chunks: makers of its chunks.
        span: what it covers.

    Returns:
        The run.
    """
    sharing = sharing_groups(problem.table, problem.used)
    return LongRun(problem, chunks, span, travel_blocks(problem.table, blocks_beside(problem.frames)), *sharing)


def columns_of(
    chunk: Problem, run: LongRun, at: Ansatz, trials: Trials, names: Sequence[str] | None = None
) -> tuple[Linear, np.ndarray]:
    """Columns of the model, of candidates and of blocks, on a chunk.

    Args:
        chunk: m rows.
        run: the run.
        at: what it is linearised at.
        trials: candidates.
        names: of the blocks that are wanted; None for all.

    Returns:
        The linearised chunk, and its columns with those of blocks at the end, (m, 3, P).
    """
    shapes = {key: shapes for key, (_, shapes) in trials.items()}
    linear = linear_columns(at.fitted, chunk, [effect for effect, _ in trials.values()], at.noise, shapes)
    linear = straightened(linear, at.fitted, run.problem)
    wanted = [atom.name for atom in at.blocks] if names is None else list(names)
    if not wanted:
        return linear, linear.columns
    assert linear.at is not None
    blocks = unknown_blocks(chunk, linear.at.chain, at.periods, run.span, wanted)
    return linear, np.concatenate([linear.columns, whitened(blocks, at.noise)], axis=2)
