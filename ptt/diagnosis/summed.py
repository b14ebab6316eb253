"""Designs whose rows are gone: normal sums of a long run, chunk by chunk, and the fit that they give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np
import torch

from ptt.chain import Prediction, predict
from ptt.chunks import map_chunks
from ptt.diagnosis.columns import Linear, Shapes, few_shapes, linear_columns
from ptt.diagnosis.design import BLOCKS, Design, with_priors
from ptt.diagnosis.gross import gross_errors
from ptt.effects import Effect
from ptt.fit.outliers import inside
from ptt.fit.solve import FitResult, conclude
from ptt.noise import Noise
from ptt.problem import Problem, apply_frames
from ptt.sums import Sums, accumulate, project, solve

Chunks = Sequence[Callable[[], Problem]]


@dataclass(frozen=True)
class SummedDesign(Design):
    """A design that keeps sums only; its columns and values have no rows.

    Attributes:
        axes: the sums of each whitened coordinate by itself, without priors.
    """

    axes: tuple[Sums, ...] = ()

    def held_out_rms(self, chosen: np.ndarray) -> float:
        """As `Design`; whitened coordinates are taken back to mm as if uncorrelated there."""
        color = np.square(np.linalg.inv(self.noise.whitener)).sum(axis=0)
        squares = 0.0
        for index in np.flatnonzero(self.axes[0].count):
            values = self._without_block(int(index), chosen)
            for weight, axis in zip(color, self.axes, strict=True):
                gram, side = axis.gram[index][np.ix_(chosen, chosen)], axis.side[index][chosen]
                squares += weight * float(axis.square[index] - 2.0 * values @ side + values @ gram @ values)
        return float(np.sqrt(squares / max(int(self.axes[0].count.sum()), 1)))

    def _without_block(self, index: int, chosen: np.ndarray) -> np.ndarray:
        """Solution on all blocks but one; what is new beside the present model first, as the screen sees it."""
        gram, side, square, _ = self.sums.total
        gram, side = gram - self.sums.gram[index], side - self.sums.side[index]
        old = np.isin(chosen, self.base)
        base, new = chosen[old], chosen[~old]
        projected = project(gram, side, square, base)
        values = np.zeros(len(chosen))
        values[~old] = solve(projected.gram, projected.side, projected.left, new, projected.least(new)).values
        values[old] = solve(gram, side - gram[:, new] @ values[~old], square, base).values
        return values


@dataclass(frozen=True)
class Part:
    """What one chunk contributes.

    Attributes:
        axes: sums of each whitened coordinate; they add up over chunks in any order.
        rows: rows that count, (m,) bool.
        linear: what the columns are, without their rows.
    """

    axes: tuple[Sums, ...]
    rows: np.ndarray
    linear: Linear


def sum_chunk(
    chunk: Problem, fitted: FitResult, candidates: Sequence[Effect], shapes: Shapes, noise: Noise, block: np.ndarray,
    *, sift: bool,
) -> Part:  # fmt: skip
    """Linearise one chunk and sum it up.

    Args:
        chunk: its rows, entered as the chunk before left them.
        fitted: the model that all chunks are linearised at.
        candidates: effects that may be added.
        shapes: their shapes, the same for all chunks.
        noise: the noise floor.
        block: held-out block of every row of the run, by its number.
        sift: look for gross errors, which only makes sense with the candidates beside.

    Returns:
        The chunk's part.
    """
    assert chunk.view.number is not None
    here = at_rows(fitted, chunk)
    linear = linear_columns(here, chunk, candidates, noise, shapes)
    rows = linear.rows
    if sift and not inside(here.residual @ noise.whitener.T, rows)[rows].all():
        saturated = few_shapes(linear.trials, linear.simple)
        rows = rows & ~gross_errors(linear.columns, linear.values, rows, linear.simple, saturated)
    number = chunk.view.number.numpy().astype(int)[rows]
    axes = tuple(
        accumulate(linear.columns[rows, axis], linear.values[rows, axis], block[number], BLOCKS) for axis in range(3)
    )
    return Part(axes, rows, linear.without_rows())


def sum_up(
    problem: Problem, chunks: Chunks, fitted: FitResult, candidates: Sequence[Effect], shapes: Shapes, noise: Noise,
    block: np.ndarray, *, sift: bool = True,
) -> SummedDesign:  # fmt: skip
    """Sum up all chunks.

    Args:
        problem: the whole run.
        chunks: makers of its chunks.
        fitted: the model they are linearised at.
        candidates: effects that may be added.
        shapes: their shapes.
        noise: the noise floor.
        block: held-out block of every row.
        sift: look for gross errors.

    Returns:
        The design of the whole run.
    """

    def work(chunk: Problem) -> Part:
        return sum_chunk(chunk, fitted, candidates, shapes, noise, block, sift=sift)

    rows: list[np.ndarray] = []
    axes: tuple[Sums, ...] = ()
    for part in map_chunks(work, chunks):
        axes = tuple(map(add, axes, part.axes)) if axes else part.axes
        rows.append(part.rows)
    linear = part.linear
    sums = with_priors(reduce(add, axes), fitted, problem, linear)
    return SummedDesign(
        linear.columns, linear.values, np.concatenate(rows), block, linear.frame, linear.present, linear.trials,
        linear.scale, sums, noise, axes,
    )  # fmt: skip


def at_rows(fitted: FitResult, problem: Problem) -> FitResult:
    """The same model and frames on other rows.

    Args:
        fitted: on any rows of the run.
        problem: the rows.

    Returns:
        With their prediction and residual.
    """
    layout, unknowns = fitted.layout, fitted.unknowns
    thetas = layout.thetas(unknowns)
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, thetas, strict=True)]
    prediction = predict(terms, layout.see(problem, unknowns))
    reading = prediction.reading
    if layout.frames:
        reading, _ = apply_frames(reading, problem.frame, layout.frame_parameters(unknowns))
    return replace(fitted, prediction=prediction, residual=problem.measured - reading.numpy())


def at_all_rows(fitted: FitResult, chunks: Chunks, rows: np.ndarray) -> FitResult:
    """The same model and frames on the whole run.

    Args:
        fitted: on any rows.
        chunks: makers of the run's chunks.
        rows: rows that count, (n,) bool.

    Returns:
        With prediction, residual and chi-squared of all rows.
    """
    parts = [at_rows(fitted, make()) for make in chunks]
    whole = [part.prediction for part in parts]
    geometry = torch.cat([item.geometry.expand(len(item.q), -1) for item in whole])
    prediction = Prediction(
        torch.cat([item.q for item in whole]), geometry, torch.cat([item.p for item in whole]),
        torch.cat([item.reading for item in whole]),
    )  # fmt: skip
    residual = np.concatenate([part.residual for part in parts])
    chi2 = float(np.square(residual[rows] @ fitted.noise.whitener.T).sum())
    return replace(fitted, prediction=prediction, residual=residual, chi2=chi2)


def refit(fitted: FitResult, design: SummedDesign) -> FitResult:
    """One Gauss-Newton step on the sums; the residual is left as it was.

    Args:
        fitted: the model that the sums were linearised at.
        design: the sums.

    Returns:
        The model at its new parameters, with their covariance.
    """
    layout = fitted.layout
    motion = 6 * layout.frames
    own = np.arange(len(fitted.unknowns) - motion - 3 * layout.mounts)
    order = np.concatenate([own, design.frame[motion:], design.frame[:motion]]).astype(int)
    gram, side, square, count = design.sums.total
    solution = solve(gram, side, square, order)
    # Effects are solved for as a whole, mounts and frames for how they move on.
    start = np.where(np.arange(len(order)) < len(own), 0.0, fitted.unknowns)
    unknowns = np.clip(start + solution.values, layout.lower, layout.upper)
    information = gram[np.ix_(order, order)] - np.diag(layout.held.astype(float))
    result = conclude(fitted, unknowns, information, solution.left, count)
    return replace(result, noise=design.noise, iterations=fitted.iterations + 1)
