"""Columns of the linearised problem: what every parameter, present or tried, would add to the readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from torch import Tensor

from ptt.chain import Chain, linearise, signature, trace
from ptt.effects import Effect
from ptt.effects.base import linear_size
from ptt.effects.metrology import rigid_basis
from ptt.fit.solve import FitResult
from ptt.fit.whitened import by_own, whiten
from ptt.noise import Noise
from ptt.problem import MOUNT_USUAL, SHIFT_USUAL, TURN_USUAL, Problem

Shapes = Sequence[Mapping[str, Tensor]] | Mapping[str, Sequence[Mapping[str, Tensor]]]


@dataclass(frozen=True)
class Trial:
    """One shape of one candidate.

    Attributes:
        effect: the candidate.
        shape: its searched and given parameters.
        columns: indices of its columns in the design.
        trials: how many shapes of this effect are tried.
    """

    effect: Effect
    shape: Mapping[str, Tensor]
    columns: np.ndarray
    trials: int


@dataclass(frozen=True)
class Linear:
    """Columns and readings of some rows, before anything is summed; as in `Design`.

    Attributes:
        columns: (n, 3, P).
        values: (n, 3).
        rows: rows that count, (n,) bool.
        frame: indices of the tracker frame's columns, and of the reflector mounts'.
        present: key -> indices of the columns of each effect in the model.
        trials: candidates in all their shapes.
        scale: (P,) usual size of each column.
        held: columns that are kept near zero by definition, (P,) bool.
    """

    columns: np.ndarray
    values: np.ndarray
    rows: np.ndarray
    frame: np.ndarray
    present: dict[str, np.ndarray]
    trials: tuple[Trial, ...]
    scale: np.ndarray
    held: np.ndarray

    @property
    def simple(self) -> np.ndarray:
        """Columns of the present model and the frame."""
        return np.concatenate([*self.present.values(), self.frame]).astype(int)


def linear_columns(
    fitted: FitResult,
    problem: Problem,
    candidates: Sequence[Effect],
    noise: Noise,
    shapes: Shapes | None = None,
) -> Linear:
    """Linearise around the present model, with every candidate's columns at zero beside it.

    Args:
        fitted: the present model and its residual on these rows.
        problem: the rows.
        candidates: effects that may be added.
        noise: the noise floor.
        shapes: shapes to try, for each candidate by its key or the same for all; None asks each candidate.

    Returns:
        The columns.
    """
    stack = _Stack()
    terms = list(zip((term.effect for term in fitted.model.terms), _thetas(fitted), strict=True))
    chain = trace(terms, fitted.layout.see(problem, fitted.unknowns))
    present = _stack_present(stack, fitted, problem, terms)
    own = np.arange(stack.width)
    frame = _stack_frames(stack, problem, chain)
    trials = _stack_candidates(stack, problem, chain, candidates, shapes)
    scale = np.concatenate([np.zeros(0), *stack.scales])
    columns = whiten(stack.parts, noise.whitener, scale)
    values = np.nan_to_num(fitted.residual) @ noise.whitener.T + columns[..., own] @ fitted.unknowns[own]
    rows = problem.used & np.isfinite(fitted.residual).all(axis=1)
    held = np.concatenate([np.zeros(0, dtype=bool), *stack.held])
    return Linear(columns, values, rows, frame, present, tuple(trials), scale, held)


class _Stack:
    """Columns side by side, with the usual size of each and whether it is held near zero."""

    def __init__(self) -> None:
        self.parts: list[np.ndarray] = []
        self.scales: list[np.ndarray] = []
        self.held: list[np.ndarray] = []
        self.width = 0

    def push(self, block: np.ndarray, scale: np.ndarray, held: np.ndarray | None = None) -> np.ndarray:
        """Add columns (n, 3, p); returns their indices."""
        count = block.shape[-1]
        self.parts.append(block)
        self.scales.append(scale)
        self.held.append(np.zeros(count, dtype=bool) if held is None else held)
        self.width += count
        return np.arange(self.width - count, self.width)


def _thetas(fitted: FitResult) -> list[Tensor]:
    return fitted.layout.thetas(fitted.unknowns)


def _stack_present(
    stack: _Stack, fitted: FitResult, problem: Problem, terms: Sequence[tuple[Effect, Tensor]]
) -> dict[str, np.ndarray]:
    """Columns of what the present model may change; key -> indices."""
    layout = fitted.layout
    free = linearise(terms, layout.see(problem, fitted.unknowns)).jacobian[..., layout.columns()].numpy()
    width = free.shape[-1]
    own = stack.push(free, layout.scale[:width], layout.held[:width])
    return {term.effect.key: own[layout.owner[:width] == index] for index, term in enumerate(layout.terms)}


def _stack_frames(stack: _Stack, problem: Problem, chain: Chain) -> np.ndarray:
    """Columns of the tracker frames and of reflector mounts that are not known; their indices."""
    rigid = rigid_basis(chain.reading).numpy()
    usual = np.array([SHIFT_USUAL] * 3 + [TURN_USUAL] * 3)
    indices = [
        stack.push(np.where((problem.frame == index)[:, None, None], rigid, 0.0), usual)
        for index in range(problem.frames)
    ]
    if problem.mounts:
        own = by_own(chain.by_slot[..., -3:].numpy(), problem.mount, problem.mounts)
        indices += [stack.push(block, np.full(3, MOUNT_USUAL)) for block in own]
    return np.concatenate([np.zeros(0, dtype=int), *indices])


def _stack_candidates(
    stack: _Stack,
    problem: Problem,
    chain: Chain,
    candidates: Sequence[Effect],
    shapes: Shapes | None,
) -> list[Trial]:
    """Columns of every candidate in all its shapes."""
    trials = []
    for effect in candidates:
        usual, held = usual_sizes(effect, problem), _held(effect, problem)
        own = shapes[effect.key] if isinstance(shapes, Mapping) else shapes
        tried = effect.search(problem.view) if own is None else own
        for shape in tried:
            columns = stack.push(signature(chain, effect, shape).numpy(), usual, held)
            trials.append(Trial(effect, dict(shape), columns, len(tried)))
    return trials


def usual_sizes(effect: Effect, problem: Problem) -> np.ndarray:
    """Usual size of each linear value of an effect, (P,)."""
    kind, joints = problem.file.machine.kind, problem.view.joints
    sizes = [
        np.full(parameter.size(joints), parameter.on(kind).usual)
        for parameter in effect.parameters
        if parameter.role == "linear"
    ]
    usual = np.concatenate(sizes)
    assert len(usual) == linear_size(effect, joints)
    return usual


def few_shapes(trials: Sequence[Trial], simple: np.ndarray) -> np.ndarray:
    """The present model's columns and every candidate's, of long searches only every sixth shape."""
    seen: dict[str, int] = {}
    chosen = [simple]
    for trial in trials:
        number = seen.get(trial.effect.key, 0)
        seen[trial.effect.key] = number + 1
        if trial.trials < 12 or number % 6 == 3:
            chosen.append(trial.columns)
    return np.concatenate(chosen).astype(int)


def _held(effect: Effect, problem: Problem) -> np.ndarray:
    """Linear values of an effect that its definition holds near zero, (P,) bool."""
    linear = [parameter for parameter in effect.parameters if parameter.role == "linear"]
    return np.concatenate([np.full(parameter.size(problem.view.joints), parameter.held) for parameter in linear])
