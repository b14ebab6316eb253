"""Which numbers a fit may change: effect parameters and tracker frames, packed in units of their usual size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ptt.model import Model, Term, parameter_names
from ptt.problem import SHIFT_USUAL, TURN_USUAL, Problem

FRAME_NAMES = ("tracker x", "tracker y", "tracker z", "tracker rotation about x", "tracker rotation about y",
               "tracker rotation about z")  # fmt: skip


@dataclass(frozen=True)
class Layout:
    """Order and scale of the unknowns: free effect parameters, term by term, then six for each frame.

    Attributes:
        terms: the model's terms, their given parameters held.
        free: for each term, (P,) bool of what may change.
        scale: (u,) usual size of each unknown.
        lower: (u,) bound in units of scale.
        upper: (u,) bound in units of scale.
        held: (u,) bool, kept near zero at its scale by definition of the effect.
        owner: (u,) int, index of the term; -1 for frames.
        names: one for each unknown.
        frames: number of frames.
    """

    terms: tuple[Term, ...]
    free: tuple[np.ndarray, ...]
    scale: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    held: np.ndarray
    owner: np.ndarray
    names: tuple[str, ...]
    frames: int

    def thetas(self, unknowns: np.ndarray) -> list[Tensor]:
        """Full flat parameters of every term at these unknowns."""
        values = unknowns * self.scale
        result, start = [], 0
        for term, free in zip(self.terms, self.free, strict=True):
            theta = term.theta.clone()
            count = int(free.sum())
            theta[torch.as_tensor(free)] = torch.as_tensor(values[start : start + count])
            result.append(theta)
            start += count
        return result

    def frame_parameters(self, unknowns: np.ndarray) -> Tensor:
        """Frame motions at these unknowns, (f, 6) mm and rad."""
        values = (unknowns * self.scale)[len(unknowns) - 6 * self.frames :]
        return torch.as_tensor(values.reshape(self.frames, 6))

    def start(self) -> np.ndarray:
        """Unknowns at the terms' present values and unmoved frames."""
        parts = [term.theta.numpy()[free] for term, free in zip(self.terms, self.free, strict=True)]
        values = np.concatenate([*parts, np.zeros(6 * self.frames)])
        return values / self.scale

    def columns(self) -> np.ndarray:
        """Which columns of the terms' joined Jacobian are free, (sum P,) bool."""
        return np.concatenate(self.free) if self.free else np.zeros(0, dtype=bool)


def lay_out(model: Model, problem: Problem, terms: Sequence[Term]) -> Layout:
    """Lay out the unknowns of a model.

    Args:
        model: for the mechanism family.
        problem: for the number of frames.
        terms: the terms, with values.

    Returns:
        The layout.
    """
    kind, joints = model.file.machine.kind, problem.view.joints
    free, scale, lower, upper, held, owner, names = [], [], [], [], [], [], []
    for index, term in enumerate(terms):
        flags = []
        for parameter in (p.on(kind) for p in term.effect.parameters):
            size = parameter.size(joints)
            open_ = parameter.role != "given" and parameter.stem not in term.fixed
            flags += [open_] * size
            if open_:
                scale += [parameter.usual] * size
                lower += [parameter.lower / parameter.usual] * size
                upper += [parameter.upper / parameter.usual] * size
                held += [parameter.held] * size
                owner += [index] * size
        free.append(np.array(flags, dtype=bool))
        local = parameter_names(term.effect, kind, joints)
        names += [f"{term.effect.key} {name}" for name, flag in zip(local, flags, strict=True) if flag]
    for frame in range(problem.frames):
        scale += [SHIFT_USUAL] * 3 + [TURN_USUAL] * 3
        lower += [-np.inf] * 6
        upper += [np.inf] * 6
        held += [False] * 6
        owner += [-1] * 6
        run = f" of run {problem.table.run_label[frame]}" if problem.frames > 1 else ""
        names += [name + run for name in FRAME_NAMES]
    return Layout(
        tuple(terms), tuple(free), np.array(scale), np.array(lower), np.array(upper), np.array(held, dtype=bool),
        np.array(owner, dtype=int),
        tuple(names), problem.frames,
    )  # fmt: skip
