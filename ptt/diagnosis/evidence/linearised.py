"""The problem linearised at a model, row by row, with columns of all candidates and of all unknown blocks."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import atoms_of_blocks, odds_of_block
from ptt.diagnosis.evidence.effect_atoms import atoms_of
from ptt.diagnosis.evidence.narrow import narrow
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.system import clock_of, straightened, whitened
from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.unknown.block import Block, Period
from ptt.diagnosis.unknown.blocks import unknown_blocks
from ptt.diagnosis.unknown.places import FEATURE_SIZE
from ptt.diagnosis.unknown.span import Span
from ptt.effects import Effect
from ptt.fitting.linear import Linear, Shapes, linear_columns
from ptt.fitting.result import FitResult
from ptt.run.holdout import blocks as travel_blocks
from ptt.run.holdout import blocks_beside, sharing_groups
from ptt.run.noise import Noise
from ptt.run.problem import Problem


def build_row_system(
    fitted: FitResult,
    problem: Problem,
    candidates: Sequence[Effect],
    noise: Noise,
    freedom: float,
    rows: np.ndarray,
    periods: Sequence[Period] = (),
    shapes: Shapes | None = None,
    span: Span | None = None,
    linear: Linear | None = None,
    *,
    unknown: bool = True,
) -> RowSystem:
    """Linearise at a model, with columns of all candidate effects and all unknown blocks.

    Args:
        fitted: the model.
        problem: n rows.
        candidates: effects that may be added.
        noise: the noise floor.
        freedom: degrees of freedom behind it.
        rows: rows that count, (n,) bool.
        periods: joint (None: time) and length of waves that spectra showed.
        shapes: key -> shapes of each candidate; None for those that each searches by itself.
        span: of the run that the problem is a sample of; None where it is the run.
        linear: the effects' columns in these shapes, where they were linearised already.
        unknown: with blocks; else effects alone.

    Returns:
        The system.
    """
    linear = straightened(linear or linear_columns(fitted, problem, candidates, noise, shapes), fitted, problem)
    assert linear.at is not None
    blocks = unknown_blocks(problem, linear.at.chain, periods, span) if unknown else ()
    columns = _side_by_side(linear.columns, blocks, noise, rows)
    atoms = atoms_of(linear, fitted, problem, candidates)
    atoms |= atoms_of_blocks(blocks, linear.columns.shape[2], odds_of_block(len(blocks)))
    more = columns.shape[2] - len(linear.scale)
    scale = np.concatenate([linear.scale, np.ones(more)])
    few = narrow(atoms, columns, scale)
    sharing, by_visit = sharing_groups(problem.table, rows)
    return RowSystem(
        np.flatnonzero(rows), few.place[linear.frame], few.atoms, clock_of(problem, rows), noise, freedom,
        few.scale(scale), few.columns(columns), linear.values[rows], poses_of(sharing[rows]),
        travel_blocks(problem.table, blocks_beside(problem.frames))[rows], _levers(linear, noise, rows), linear.at,
        few.columns(np.pad(linear.base_columns, [(0, 0), (0, 0), (0, more)])), linear.base_values,
        one_memory=span is not None, by_visit=by_visit, rounding_mm=problem.rounding[1],
    )  # fmt: skip


def _side_by_side(known: np.ndarray, blocks: Sequence[Block], noise: Noise, rows: np.ndarray) -> np.ndarray:
    """Given columns (n, 3, p) and those of blocks on the rows that count, in one array, (m, 3, P)."""
    some = slice(None) if rows.all() else rows
    place, width = known.shape[2], sum(block.width for block in blocks)
    flat = np.empty((place + width, 3, int(rows.sum())))
    flat[:place] = known[some].transpose(2, 1, 0)
    if blocks:
        flat[place:] = whitened(blocks, noise, some).transpose(2, 1, 0)
    return flat.transpose(2, 1, 0)


def _levers(linear: Linear, noise: Noise, rows: np.ndarray) -> dict[int, np.ndarray]:
    """Joint -> shift of each reading that counts per `FEATURE_SIZE` of the joint, (m, 3) whitened."""
    assert linear.at is not None
    by_joint = linear.at.chain.by_joint.numpy()[rows] * FEATURE_SIZE
    return {j: by_joint[:, :, j] @ noise.whitener.T for j in range(by_joint.shape[2])}
