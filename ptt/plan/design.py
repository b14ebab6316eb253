"""Design columns: derivatives of the readings by the model's unknowns, the tracker's frames and rival effects."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np
import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.fitting.chunks import stretches, view_chunks
from ptt.fitting.linear import held_values, usual_sizes
from ptt.fitting.result import FitResult, sound_rows
from ptt.model.chain import linearise, signature
from ptt.plan.contest import triangle
from ptt.run.frames import by_own, rigid_columns
from ptt.run.problem import SHIFT_USUAL, TURN_USUAL, Problem
from ptt.run.view import View

EASE = 1e-4  # prior information on every unknown, per usual size squared: a hundred usual sizes cost one sigma
# Share of the fitted amplitudes at which derivatives are taken: exact ambiguities then hold to first order.
FAINT = 0.01
CHUNK = 20000  # rows whose columns are held in memory at once
CHUNKS = 4  # of a long run that are evaluated, at most; weighted to stand for all


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that is not in the model, with given values of its searched parameters.

    Attributes:
        effect: the effect.
        shape: its searched and given parameters.
    """

    effect: Effect
    shape: Mapping[str, Tensor]


@dataclass(frozen=True, eq=False)
class DesignColumns:
    """The P columns of the design, whitened and in usual sizes.

    In this order: the model's unknowns as in its fit (reflector mounts and frames last), the frame of a new run where
    each run has its own, the rivals.

    Attributes:
        fitted: the model at which derivatives are taken.
        problem: the rows it was fitted on.
        rivals: effects that might take the place of one of the model's.
        own_frame: whether a new run has a frame of its own.
        index: indices of the columns of each rival.
        scale: usual size of each column, (P,).
        prior: prior information on each column, (P,).
    """

    fitted: FitResult
    problem: Problem
    rivals: tuple[Rival, ...]
    own_frame: bool
    index: tuple[np.ndarray, ...]
    scale: np.ndarray
    prior: np.ndarray

    @property
    def width(self) -> int:
        """Number of columns P."""
        return len(self.scale)

    @property
    def frames(self) -> np.ndarray:
        """Columns of the tracker's frames."""
        end = len(self.fitted.layout.scale)
        return np.arange(end - 6 * self.fitted.layout.frames, end + 6 * self.own_frame)

    def of(self, key: str) -> np.ndarray:
        """Columns of an effect of the model."""
        place = [term.effect.key for term in self.fitted.layout.terms].index(key)
        return np.flatnonzero(self.fitted.layout.owner == place)

    @property
    def linear(self) -> np.ndarray:
        """Columns of linear parameters of the model's effects, (P,) bool."""
        layout, flags = self.fitted.layout, np.zeros(self.width, dtype=bool)
        for number, (term, free) in enumerate(zip(layout.terms, layout.free, strict=True)):
            sizes = [(p.role == "linear", p.size(self.problem.view.joints)) for p in term.effect.parameters]
            own = np.concatenate([np.full(size, flag) for flag, size in sizes])[free]
            flags[np.flatnonzero(layout.owner == number)] = own
        return flags

    def base(self, without: str) -> np.ndarray:
        """Columns of the frames and of all effects of the model but one."""
        taken = np.concatenate([self.of(without), *self.index]).astype(int)
        return np.setdiff1d(np.arange(self.width), taken)

    def amplitudes(self, key: str) -> np.ndarray:
        """Fitted amplitudes of an effect in usual sizes, (P,); zero in all columns but its linear ones."""
        own = np.intersect1d(self.of(key), np.flatnonzero(self.linear))
        values = np.zeros(self.width)
        values[own] = self.fitted.unknowns[own]
        return values


def build_design(fitted: FitResult, problem: Problem, rivals: tuple[Rival, ...]) -> DesignColumns:
    """Set up the design columns.

    Args:
        fitted: the model with the effects in question.
        problem: the rows it was fitted on.
        rivals: effects that might stand in their place.

    Returns:
        The columns.
    """
    layout = fitted.layout
    own_frame = problem.frames > 0 and problem.file.tracker.frame in ("fitted-per-run", "measured")
    scale = [layout.scale]
    prior = [np.where(layout.held, 1.0, EASE)]
    if own_frame:
        scale.append(np.array([SHIFT_USUAL] * 3 + [TURN_USUAL] * 3))
        prior.append(np.full(6, EASE))
    start = sum(len(part) for part in scale)
    index = []
    for rival in rivals:
        usual = usual_sizes(rival.effect, problem)
        scale.append(usual)
        prior.append(np.where(held_values(rival.effect, problem), 1.0, EASE))
        index.append(np.arange(start, start + len(usual)))
        start += len(usual)
    return DesignColumns(fitted, problem, rivals, own_frame, tuple(index), np.concatenate(scale), np.concatenate(prior))


def design_rows(
    design: DesignColumns, view: View, frame: np.ndarray | None, mount: np.ndarray | None = None
) -> np.ndarray:
    """Design rows.

    Args:
        design: the columns.
        view: n rows.
        frame: (n,) int, tracker frame of each row; None for a new run.
        mount: (n,) int, reflector mount of each row; None for the first.

    Returns:
        (n, 3, P), whitened, in usual sizes.
    """
    fitted, layout = design.fitted, design.fitted.layout
    linear = design.linear
    faint = fitted.unknowns * np.where(linear[: len(fitted.unknowns)], FAINT, 1.0)
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(faint), strict=True)]
    at = linearise(terms, view, crossed=False)
    chain, parts = at.chain, []
    if terms:
        machine = at.jacobian[..., torch.as_tensor(layout.columns())].numpy()
        parts.append(machine * np.where(linear[: machine.shape[-1]], 1.0, 1.0 / FAINT))
    rigid = rigid_columns(chain.reading)
    if layout.mounts:
        held = np.zeros(view.rows, dtype=int) if mount is None else mount
        parts += by_own(chain.by_slot[..., -3:].numpy(), held, layout.mounts)
    if layout.frames:
        new = frame is None and design.own_frame
        where = np.full(view.rows, -1) if new else np.zeros(view.rows, dtype=int) if frame is None else frame
        parts += [np.where((where == i)[:, None, None], rigid.numpy(), 0.0) for i in range(layout.frames)]
        parts += [rigid.numpy() * float(new)] if design.own_frame else []
    parts += [signature(chain, rival.effect, rival.shape).numpy() for rival in design.rivals]
    columns = np.concatenate(parts, axis=-1) if parts else np.zeros((view.rows, 3, 0))
    return np.einsum("ij,njp->nip", fitted.noise.whitener, columns * design.scale, optimize=True)


def known_rows(design: DesignColumns) -> np.ndarray:
    """The run that was fitted, its base reflectors and the priors, as rows of a least squares problem.

    Args:
        design: the columns.

    Returns:
        (r, P): a triangle with the same sums of squares as all those rows.
    """
    problem = design.problem
    used = sound_rows(problem, design.fitted)
    stack = [np.diag(np.sqrt(design.prior)), _base_rows(design)]
    whole = design.fitted.layout.see(problem, design.fitted.unknowns)
    parts = stretches(whole.rows, CHUNK)
    apart = -(-len(parts) // CHUNKS)
    weight = np.sqrt(len(parts) / len(parts[::apart]))
    for (first, last), view in islice(zip(parts, view_chunks(whole, CHUNK), strict=True), 0, None, apart):
        rows = slice(first, last)
        columns = design_rows(design, view, problem.frame[rows], problem.mount[rows])[used[rows]]
        stack = [triangle(np.concatenate([*stack, weight * columns.reshape(-1, design.width)]))]
    return stack[0]


def _base_rows(design: DesignColumns) -> np.ndarray:
    """Design rows of base reflectors: as read in the fitted run, and once more in a new one."""
    base, frames = design.problem.base, design.fitted.layout.frames
    if base is None or not frames:
        return np.zeros((0, design.width))
    rigid = rigid_columns(torch.as_tensor(base.place))
    own = by_own(rigid.numpy(), base.frame, frames)
    first = len(design.fitted.layout.scale) - 6 * frames
    old = np.zeros((len(base.place), 3, design.width))
    old[..., first : first + 6 * frames] = np.concatenate(own, axis=-1)
    new = np.zeros_like(old)
    again = np.where((base.frame == 0)[:, None, None], rigid.numpy(), 0.0)
    new[..., first + 6 * frames : first + 6 * frames + 6] = again
    both = [base.whitened(part, design.fitted.noise.whitener) for part in (old, new)]
    return (np.concatenate(both) * design.scale).reshape(-1, design.width)
