"""Moments of sudden effects of a long run, to the row: a sample only tells the gap between two of its stretches."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.ansatz import Ansatz, LongRun, columns_of
from ptt.diagnosis.unknown.blocks import unknown_blocks
from ptt.diagnosis.unknown.moment import MomentSums, along, best_row, joined
from ptt.effects import Effect
from ptt.effects.sudden import Sudden
from ptt.fitting.chunks import map_chunks, numbers
from ptt.fitting.linear import Linear, LinearPoint, Shape
from ptt.fitting.moment import at_rows, last_before, put_after, rows_read
from ptt.run.problem import Problem

Carried = Mapping[str, np.ndarray]  # name of a block -> its values


def place_moments(run: LongRun, at: Ansatz, carried: Carried) -> Ansatz:
    """Move the moments of a model's own sudden effects to the best row of all.

    Args:
        run: the long run.
        at: the linearisation point, with its blocks.
        carried: name of a block -> its values.

    Returns:
        The point with the moments moved.
    """
    for index, term in enumerate(at.fitted.layout.terms):
        if isinstance(term.effect, Sudden):
            at = replace(at, fitted=put_after(at.fitted, index, _moment(run, at, index, carried)))
    return at


def find_moments(run: LongRun, at: Ansatz, effects: Sequence[Effect], carried: Carried) -> dict[str, Shape]:
    """The moment at which each sudden candidate would explain most of the residual, every row being tried.

    Args:
        run: the long run.
        at: the linearisation point, fitted to all rows, with its blocks.
        effects: candidates; only sudden ones are used.
        carried: name of a block -> its values.

    Returns:
        Key of an effect -> its best shape.
    """
    sudden = [effect for effect in effects if isinstance(effect, Sudden)]
    if not sudden:
        return {}

    def work(chunk: Problem) -> list[MomentSums]:
        linear, _ = columns_of(chunk, run, at, {}, ())
        left = linear.residual - _of_blocks(chunk, linear, run, at, carried) @ at.noise.whitener.T
        rows = linear.rows & run.problem.used[numbers(chunk)]
        frame = linear.columns[:, :, linear.frame]
        return [along(_point(linear), frame, left, rows, effect) for effect in sudden]

    parts = list(zip(*map_chunks(work, run.chunks), strict=True))
    found: dict[str, Shape] = {}
    for effect, own in zip(sudden, parts, strict=True):
        clock, row = run.problem.view.clock, best_row(joined(own))
        found[effect.key] = {"after": clock[row : row + 1].clone()}
    return found


def _point(linear: Linear) -> LinearPoint:
    assert linear.at is not None
    return linear.at


def _moment(run: LongRun, at: Ansatz, index: int, carried: Carried) -> float:
    """The moment of a sudden effect that minimises the sum of squares: without it before, with it after."""
    never, always = put_after(at.fitted, index, np.inf), put_after(at.fitted, index, -np.inf)

    def work(chunk: Problem) -> np.ndarray:
        linear = columns_of(chunk, run, at, {}, ())[0] if carried else None
        blocks = 0.0 if linear is None else _of_blocks(chunk, linear, run, at, carried)
        both = [np.nan_to_num(at_rows(fitted, chunk).residual - blocks) for fitted in (never, always)]
        squares = [np.square(left @ at.noise.whitener.T).sum(axis=1) for left in both]
        return np.where(run.problem.used[numbers(chunk)], squares[0] - squares[1], 0.0)

    read, gained = rows_read(run.problem), np.concatenate(list(map_chunks(work, run.chunks)))
    return last_before(run.problem.view.clock.numpy()[read], gained[read])


def _of_blocks(chunk: Problem, linear: Linear, run: LongRun, at: Ansatz, carried: Carried) -> np.ndarray:
    """Contribution of blocks to a chunk's readings, (m, 3) mm."""
    total = np.zeros((chunk.table.rows, 3))
    if carried:
        assert linear.at is not None
        for block in unknown_blocks(chunk, linear.at.chain, at.periods, run.span, tuple(carried)):
            total += block.features @ carried[block.name]
    return total
