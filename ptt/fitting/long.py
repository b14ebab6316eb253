"""A fit's normal equations for a long run, summed chunk by chunk; of each row only the residual is kept.

A Jacobian of all rows would take hundreds of bytes for each row and parameter. A chunk is entered in the state in which
the one before left it (`ptt.fitting.chunks`), so sums and residuals equal those of the whole run up to rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial, reduce

import numpy as np
import torch

from ptt.fitting.chunks import CHUNK, cut, map_beside, stretches
from ptt.fitting.gauss_newton import bounded_step
from ptt.fitting.layout import Layout
from ptt.fitting.result import FitResult
from ptt.fitting.whitened import Total, WhitenedSystem, add_totals, build_whitened
from ptt.model.chain import Prediction
from ptt.run.noise import Noise
from ptt.run.problem import Problem


@dataclass(eq=False)
class LongSystem:
    """Whitened residual of all rows at one point, and sums of whatever rows are asked for.

    Attributes:
        residual: measured less predicted, (n, 3) in units of noise; NaN where not observed.
        prediction: of the model, without frames.
        evaluate: the evaluator that made it.
        unknowns: the point, (u,) in usual sizes.
    """

    residual: np.ndarray
    prediction: Prediction
    evaluate: "LongEvaluator"
    unknowns: np.ndarray
    _known: tuple[np.ndarray, Total] | None = field(default=None, repr=False)

    def sums(self, kept: np.ndarray) -> Total:
        """J^T J, J^T r, r^T r and the number of coordinates of the rows that count and the base reflectors."""
        if self._known is None or not np.array_equal(self._known[0], kept):
            *_, total = self.evaluate.pass_over(self.unknowns, kept)
            self._known = kept.copy(), total
        return self._known[1]


class LongEvaluator:
    """Builds the system at given unknowns in one pass over all chunks; the last one is cached."""

    def __init__(self, layout: Layout, problem: Problem, noise: Noise, *, size: int = CHUNK) -> None:
        self.layout, self.problem, self.noise = layout, problem, noise
        self.calls = 0
        self.kept = problem.used
        self._size, self._chunks = size, cut(problem, size)
        self._system: LongSystem | None = None

    def __call__(self, unknowns: np.ndarray) -> LongSystem:
        """The system at these unknowns, (u,) in usual sizes."""
        if self._system is None or not np.array_equal(self._system.unknowns, unknowns):
            residual, prediction, total = self.pass_over(unknowns, self.kept)
            self._system = LongSystem(residual, prediction, self, unknowns.copy(), (self.kept.copy(), total))
        return self._system

    def pass_over(self, unknowns: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, Prediction, Total]:
        """Residual, prediction and sums of the rows that count, in one pass."""
        self.calls += 1
        self.kept = kept  # the next points are asked for with the same rows
        work = partial(_sum_chunk, self.layout, self.noise.whitener, unknowns)
        parts = list(map_beside(work, self._chunks, self._cut(kept)))
        residual, prediction = np.concatenate([own for own, _, _ in parts]), _joined([own for _, own, _ in parts])
        total, base = reduce(add_totals, [own for _, _, own in parts]), self._base(unknowns)
        return residual, prediction, total if base is None else add_totals(total, base)

    def _cut(self, values: np.ndarray) -> list[np.ndarray]:
        """Values (n, ..) cut at the chunks."""
        return [values[first:last] for first, last in stretches(len(values), self._size)]

    def parts(self, unknowns: np.ndarray, kept: np.ndarray, part: np.ndarray, parts: int) -> list[Total]:
        """Sums over each part of the rows that count, then over the rows of none and the base reflectors.

        Args:
            unknowns: (u,) in usual sizes.
            kept: rows that count, (n,) bool.
            part: (n,) int, -1 for rows of none.
            parts: how many there are.
        """
        work = partial(_sum_parts, self.layout, self.noise.whitener, unknowns, parts)
        pairs = list(zip(self._cut(kept), self._cut(part), strict=True))
        found = reduce(add_lists, map_beside(work, self._chunks, pairs))
        base = self._base(unknowns)
        return found if base is None else [*found[:-1], add_totals(found[-1], base)]

    def moved(self, unknowns: np.ndarray, steps: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Residual of all rows, each with its part's step taken, to first order.

        Args:
            unknowns: (u,) in usual sizes.
            steps: (parts, u).
            part: (n,) int; rows of none, -1, stay.

        Returns:
            (n, 3) in units of noise.
        """
        work = partial(_move_chunk, self.layout, self.noise.whitener, unknowns, steps)
        return np.concatenate(list(map_beside(work, self._chunks, self._cut(part))))

    def _base(self, unknowns: np.ndarray) -> Total | None:
        if self.problem.base is None or not self.layout.frames:
            return None
        system = build_whitened(self.layout, self._chunks[0](), self.noise.whitener, unknowns)
        return system.sums(np.zeros(len(system.residual), dtype=bool))


def add_lists(one: list[Total], other: list[Total]) -> list[Total]:
    """Sums over the rows of both, part by part."""
    return [add_totals(a, b) for a, b in zip(one, other, strict=True)]


def _sum_chunk(
    layout: Layout, whitener: np.ndarray, unknowns: np.ndarray, chunk: Problem, kept: np.ndarray
) -> tuple[np.ndarray, Prediction, Total]:
    """Residual (m, 3), prediction and sums of a chunk of m rows, of which some are kept, (m,) bool."""
    system = build_whitened(layout, chunk, whitener, unknowns)
    return system.residual, system.prediction, _rows_alone(system).sums(kept)


def _sum_parts(
    layout: Layout, whitener: np.ndarray, unknowns: np.ndarray, parts: int, chunk: Problem,
    own: tuple[np.ndarray, np.ndarray],
) -> list[Total]:  # fmt: skip
    """Sums over each part of a chunk of m rows, then over those of none; `own` is kept (m,) bool and part (m,) int."""
    system, (kept, part) = _rows_alone(build_whitened(layout, chunk, whitener, unknowns)), own
    return [system.sums(kept & (part == index)) for index in (*range(parts), -1)]


def _move_chunk(
    layout: Layout, whitener: np.ndarray, unknowns: np.ndarray, steps: np.ndarray, chunk: Problem, part: np.ndarray
) -> np.ndarray:
    """Residual of a chunk of m rows, (m, 3), with the steps (parts, u) in usual sizes of their parts (m,) int taken."""
    system = build_whitened(layout, chunk, whitener, unknowns)
    change = np.einsum("ncu,nu->nc", system.jacobian, steps[part])
    return np.where((part >= 0)[:, None], system.residual - change, system.residual)


def _rows_alone(system: WhitenedSystem) -> WhitenedSystem:
    """The system without base reflectors, which must not be counted once for each chunk."""
    width = system.jacobian.shape[-1]
    return WhitenedSystem(
        system.residual, system.jacobian, np.zeros((0, 3)), np.zeros((0, 3, width)), system.prediction, system.chain
    )


def _joined(parts: list[Prediction]) -> Prediction:
    """Predictions concatenated; a geometry that is the same in all rows stays one row."""
    geometry = [part.geometry for part in parts]
    same = all(len(each) == 1 for each in geometry)
    spread = [each.expand(len(part.q), -1) for each, part in zip(geometry, parts, strict=True)]
    return Prediction(
        torch.cat([part.q for part in parts]), geometry[0] if same else torch.cat(spread),
        torch.cat([part.p for part in parts]), torch.cat([part.reading for part in parts]),
    )  # fmt: skip


def held_out_residual(fitted: FitResult, problem: Problem, parts: Sequence[np.ndarray]) -> np.ndarray:
    """Held-out residual of every row: its part is left out by one Gauss-Newton step from the fit of all rows.

    Args:
        fitted: the fit of all rows.
        problem: n rows.
        parts: (n,) bool, rows that are held out in turn.

    Returns:
        (n, 3) mm; rows of no part as fitted.
    """
    layout, prior, kept = fitted.layout, fitted.prior, problem.used & ~fitted.outliers
    evaluate = LongEvaluator(layout, problem, fitted.noise)
    part = np.full(len(kept), -1)
    for index, rows in enumerate(parts):
        part[rows] = index
    own = evaluate.parts(fitted.unknowns, kept, part, len(parts))
    total, steps = reduce(add_totals, own), np.zeros((len(parts), len(fitted.unknowns)))
    for index in range(len(parts)):
        normal = total[0] - own[index][0] + np.diag(prior.weight)
        side = total[1] - own[index][1] - prior.pull(fitted.unknowns)
        steps[index] = bounded_step(
            normal,
            side,
            np.minimum(layout.lower - fitted.unknowns, 0.0),
            np.maximum(layout.upper - fitted.unknowns, 0.0),
        )
    moved = evaluate.moved(fitted.unknowns, steps, part)
    return moved @ np.linalg.inv(fitted.noise.whitener).T
