"""A long run in chunks, and the point at which all chunks are linearised."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.system import straightened, whitened
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.unknown.block import Period
from ptt.diagnosis.unknown.blocks import unknown_blocks
from ptt.diagnosis.unknown.span import Span
from ptt.effects import Effect
from ptt.fitting.linear import Linear, Shape, linear_columns
from ptt.fitting.result import FitResult
from ptt.run.holdout import blocks as travel_blocks
from ptt.run.holdout import blocks_beside, sharing_groups
from ptt.run.noise import Noise
from ptt.run.problem import Problem

Chunks = Sequence[Callable[[], Problem]]  # makers of the chunks, in order
Trials = Mapping[str, tuple[Effect, Sequence[Shape]]]  # key -> candidate and the shapes in which it is summed


@dataclass(frozen=True)
class LongRun:
    """A long run in chunks.

    Attributes:
        problem: all n rows.
        chunks: makers of its chunks, in order.
        span: ranges and contexts of the run.
        block: held-out block of each row, (n,) int.
        pose: group of rows with a common random error, (n,) int: a pose, or a visit.
        by_visit: whether the groups are visits.
    """

    problem: Problem
    chunks: Chunks
    span: Span
    block: np.ndarray
    pose: np.ndarray
    by_visit: bool


@dataclass(frozen=True)
class Ansatz:
    """The point at which all chunks are linearised, and the unknown blocks beside it.

    Attributes:
        fitted: the model with its layout and unknowns.
        blocks: atoms of the blocks, in the order of their columns.
        periods: joint (None: time) and length of the waves among the blocks.
        noise: the noise floor, which whitens.
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
    """Find held-out blocks and groups of rows of a long run.

    Args:
        problem: all rows.
        chunks: makers of its chunks.
        span: ranges and contexts of the run.

    Returns:
        The run.
    """
    sharing = sharing_groups(problem.table, problem.used)
    return LongRun(problem, chunks, span, travel_blocks(problem.table, blocks_beside(problem.frames)), *sharing)


def columns_of(
    chunk: Problem, run: LongRun, at: Ansatz, trials: Trials, names: Sequence[str] | None = None
) -> tuple[Linear, np.ndarray]:
    """Linearise a chunk.

    Args:
        chunk: m rows.
        run: the run.
        at: where it is linearised.
        trials: candidates.
        names: names of the wanted blocks; None for all.

    Returns:
        The linearised chunk, and whitened columns of the model, the candidates and the blocks, (m, 3, P).
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
