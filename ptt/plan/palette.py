"""Columns that rows are judged by: what the model, the tracker frame and rival effects would change in each reading."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np
import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.fitting.chunks import stretches, view_chunks
from ptt.fitting.linear import held_values, usual_sizes
from ptt.fitting.result import FitResult
from ptt.model.chain import linearise, signature
from ptt.plan.contest import triangle
from ptt.run.frames import by_own, rigid_columns
from ptt.run.problem import SHIFT_USUAL, TURN_USUAL, Problem
from ptt.run.view import View

EASE = 1e-4  # prior on every unknown, in usual sizes squared: a hundred usual sizes cost one sigma
FAINT = 0.01  # share of the fitted amplitudes at which columns are taken: what imitates exactly does so to first order
CHUNK = 20000  # rows whose columns are held in memory at once
CHUNKS = 4  # of a long run that are looked at; they stand for the others


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that is not in the model, in one shape.

    Attributes:
        effect: the effect.
        shape: its searched and given parameters.
    """

    effect: Effect
    shape: Mapping[str, Tensor]


@dataclass(frozen=True, eq=False)
class Palette:
    """Which columns there are, whitened and in units of usual sizes.

    Columns: the model's unknowns as its fit has them (reflector mounts and frames last), a frame of a new run where
    runs have their own, the rivals.

    Attributes:
        fitted: the model that the columns are taken at.
        problem: the rows it was fitted on.
        rivals: effects that might be in the place of one of the model's.
        own_frame: a new run has a frame of its own.
        index: for each rival its columns.
        scale: (P,) usual size of each column.
        prior: (P,) weight of the prior on each column.
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
        """Columns of amplitudes of the model's effects, (P,) bool; what they do grows with nothing else."""
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


def mix_palette(fitted: FitResult, problem: Problem, rivals: tuple[Rival, ...]) -> Palette:
    """Set up the columns.

    Args:
        fitted: the model with the effects in question.
        problem: the rows it was fitted on.
        rivals: effects that might stand in their place.

    Returns:
        The palette.
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
    return Palette(fitted, problem, rivals, own_frame, tuple(index), np.concatenate(scale), np.concatenate(prior))


def paint(palette: Palette, view: View, frame: np.ndarray | None, mount: np.ndarray | None = None) -> np.ndarray:
    """Columns of rows.

    Args:
        palette: which.
        view: n rows.
        frame: (n,) int, tracker frame of each row; None for a new run.
        mount: (n,) int, reflector mount of each row; None for the first.

    Returns:
        (n, 3, P), whitened, in usual sizes.
    """
    fitted, layout = palette.fitted, palette.fitted.layout
    linear = palette.linear
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
        new = frame is None and palette.own_frame
        where = np.full(view.rows, -1) if new else np.zeros(view.rows, dtype=int) if frame is None else frame
        parts += [np.where((where == i)[:, None, None], rigid.numpy(), 0.0) for i in range(layout.frames)]
        parts += [rigid.numpy() * float(new)] if palette.own_frame else []
    parts += [signature(chain, rival.effect, rival.shape).numpy() for rival in palette.rivals]
    columns = np.concatenate(parts, axis=-1) if parts else np.zeros((view.rows, 3, 0))
    return np.einsum("ij,njp->nip", fitted.noise.whitener, columns * palette.scale, optimize=True)


def known_rows(palette: Palette) -> np.ndarray:
    """What is known before: the run that was fitted, base reflectors and priors, as rows of a least squares problem.

    Args:
        palette: the columns.

    Returns:
        (r, P): a triangle with the same sums of squares as all those rows.
    """
    problem = palette.problem
    used = problem.used & ~palette.fitted.outliers & np.isfinite(palette.fitted.residual).all(axis=1)
    stack = [np.diag(np.sqrt(palette.prior)), _base_rows(palette)]
    whole = palette.fitted.layout.see(problem, palette.fitted.unknowns)
    parts = stretches(whole.rows, CHUNK)
    apart = -(-len(parts) // CHUNKS)
    weight = np.sqrt(len(parts) / len(parts[::apart]))
    for (first, last), view in islice(zip(parts, view_chunks(whole, CHUNK), strict=True), 0, None, apart):
        rows = slice(first, last)
        columns = paint(palette, view, problem.frame[rows], problem.mount[rows])[used[rows]]
        stack = [triangle(np.concatenate([*stack, weight * columns.reshape(-1, palette.width)]))]
    return stack[0]


def _base_rows(palette: Palette) -> np.ndarray:
    """Base reflectors: of the frames that were fitted, and once more of a new run's."""
    base, frames = palette.problem.base, palette.fitted.layout.frames
    if base is None or not frames:
        return np.zeros((0, palette.width))
    rigid = rigid_columns(torch.as_tensor(base.place))
    own = by_own(rigid.numpy(), base.frame, frames)
    first = len(palette.fitted.layout.scale) - 6 * frames
    old = np.zeros((len(base.place), 3, palette.width))
    old[..., first : first + 6 * frames] = np.concatenate(own, axis=-1)
    new = np.zeros_like(old)
    again = np.where((base.frame == 0)[:, None, None], rigid.numpy(), 0.0)
    new[..., first + 6 * frames : first + 6 * frames + 6] = again
    both = [base.whitened(part, palette.fitted.noise.whitener) for part in (old, new)]
    return (np.concatenate(both) * palette.scale).reshape(-1, palette.width)
