"""The fit's system of equations at one point: residual and Jacobian of all readings in units of their noise."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ptt.fitting.layout import Layout
from ptt.model.chain import Chain, EffectTerms, Prediction, linearise, linearise_base
from ptt.run.frames import by_own, rotation
from ptt.run.noise import Noise
from ptt.run.problem import Problem, apply_frames

Total = tuple[np.ndarray, np.ndarray, float, int]  # J^T J, J^T r, r^T r, number of coordinates


@dataclass(frozen=True)
class WhitenedSystem:
    """Whitened residual and Jacobian at one point.

    Attributes:
        residual: measured less predicted, (n, 3) in units of noise; NaN where not observed.
        jacobian: derivative of the prediction by the unknowns in usual sizes, (n, 3, u).
        base_residual: base reflectors, (m, 3) in units of their own noise.
        base_jacobian: (m, 3, u).
        prediction: of the model, without frames.
        chain: linearised kinematic chain, for the columns of further effects.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    base_residual: np.ndarray
    base_jacobian: np.ndarray
    prediction: Prediction
    chain: Chain

    def stacked(self, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows that count and the base reflectors, flattened.

        Args:
            kept: (n,) bool.

        Returns:
            Residual (r,) and Jacobian (r, u).
        """
        width = self.jacobian.shape[-1]
        residual, jacobian = self.residual[kept].ravel(), self.jacobian[kept].reshape(3 * int(kept.sum()), width)
        if not len(self.base_residual):
            return residual, jacobian
        base = self.base_jacobian.reshape(3 * len(self.base_jacobian), width)
        return np.concatenate([residual, self.base_residual.ravel()]), np.concatenate([jacobian, base])

    def sums(self, kept: np.ndarray) -> Total:
        """J^T J, J^T r, r^T r and the number of coordinates of the rows that count and the base reflectors."""
        residual, jacobian = self.stacked(kept)
        return sums_of(jacobian, residual)


def sums_of(columns: np.ndarray, values: np.ndarray) -> Total:
    """Normal sums of rows, (r, u) or (m, 3, u), and their readings, (r,) or (m, 3); there may be none of either."""
    flat, value = columns.reshape(values.size, columns.shape[-1]), values.ravel()
    return flat.T @ flat, flat.T @ value, float(value @ value), len(value)


def add_totals(one: Total, other: Total) -> Total:
    """Sums over the rows of both."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2], one[3] + other[3]


class Evaluator:
    """Builds the system at given unknowns and remembers the last one, which fit and outlier search both ask for."""

    def __init__(self, layout: Layout, problem: Problem, noise: Noise, *, coarse: bool = False) -> None:
        self.layout, self.problem, self.noise, self.coarse = layout, problem, noise, coarse
        self.calls = 0
        self._at: np.ndarray | None = None
        self._system: WhitenedSystem | None = None

    def __call__(self, unknowns: np.ndarray) -> WhitenedSystem:
        """The system at these unknowns, (u,) in usual sizes."""
        if self._system is None or self._at is None or not np.array_equal(self._at, unknowns):
            self.calls += 1
            self._system = build_whitened(
                self.layout, self.problem, self.noise.whitener, unknowns, crossed=not self.coarse
            )
            self._at = unknowns.copy()
        return self._system


def build_whitened(
    layout: Layout, problem: Problem, whitener: np.ndarray, unknowns: np.ndarray, *, crossed: bool = True
) -> WhitenedSystem:
    """Linearise the model and the frames at a point.

    Args:
        layout: order and scale of the unknowns.
        problem: the readings.
        whitener: (3, 3) 1/mm.
        unknowns: (u,) in usual sizes.
        crossed: as in `ptt.model.chain.linearise`.

    Returns:
        The system.
    """
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
    at = linearise(terms, layout.see(problem, unknowns), crossed=crossed)
    columns = layout.columns()
    machine = at.jacobian if columns.all() else at.jacobian[..., torch.as_tensor(columns)]
    if layout.mounts:
        own = by_own(at.by_mount.numpy(), problem.mount, layout.mounts)
        machine = torch.cat([machine, *(torch.as_tensor(block) for block in own)], dim=-1)
    reading, blocks, motion = at.prediction.reading, [machine.numpy()], layout.frame_parameters(unknowns)
    if layout.frames:
        reading, by_frame = apply_frames(reading, problem.frame, motion)
        blocks = [turned(machine, motion, problem.frame).numpy()]
        blocks += by_own(by_frame.numpy(), problem.frame, layout.frames)
    jacobian = whiten(blocks, whitener, layout.scale)
    residual = (problem.measured - reading.numpy()) @ whitener.T
    base = _base_rows(problem, layout, terms, motion, whitener)
    return WhitenedSystem(residual, jacobian, *base, at.prediction, at.chain)


def whiten(blocks: list[np.ndarray], whitener: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Join columns and put them in units of noise and usual size.

    Args:
        blocks: (n, 3, P) each, mm per unit.
        whitener: (3, 3) 1/mm.
        scale: usual size of each column.

    Returns:
        (n, 3, sum P).
    """
    turned = [whitener @ block for block in blocks]
    result = turned[0] if len(turned) == 1 else np.concatenate(turned, axis=-1)
    result *= scale
    return result


def turned(machine: Tensor, motion: Tensor, frame: np.ndarray) -> Tensor:
    """Columns of machine shifts rotated by the small rotations of the frames.

    Args:
        machine: (n, 3, P) in the base frame.
        motion: (f, 6) how the frames stand; f = 0 where they are trusted.
        frame: (n,) int, frame of each row.

    Returns:
        (n, 3, P).
    """
    if not bool(motion[:, 3:].any()) or not machine.shape[-1]:
        return machine
    turns = rotation(motion[:, 3:])[0]
    if len(turns) == 1:
        return torch.from_numpy(turns[0].numpy() @ machine.numpy())  # several times faster than torch's own
    return turns[torch.as_tensor(frame)] @ machine


def _base_rows(
    problem: Problem, layout: Layout, terms: EffectTerms, motion: Tensor, whitener: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Whitened residual of base reflectors under metrology effects and frames, and its derivative."""
    base = problem.base
    if base is None or not layout.frames:
        return np.zeros((0, 3)), np.zeros((0, 3, len(layout.scale)))
    told, columns = linearise_base(terms, base.view)
    own = turned(columns[..., torch.as_tensor(layout.columns())], motion, base.frame)
    moved, by_frame = apply_frames(told, base.frame, motion)
    still = np.zeros((len(base.frame), 3, 3 * layout.mounts))
    blocks = [own.numpy(), still, *by_own(by_frame.numpy(), base.frame, layout.frames)]
    jacobian = base.whitened(np.concatenate(blocks, axis=-1), whitener) * layout.scale
    return base.whitened((base.reading - moved.numpy())[..., None], whitener)[..., 0], jacobian
