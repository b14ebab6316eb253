"""The linearised problem: what every candidate would add to the readings, on top of the present model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from torch import Tensor

from ptt.diagnosis.columns import Linear, Trial, few_shapes, linear_columns
from ptt.diagnosis.gross import gross_errors
from ptt.diagnosis.wander import Wander, take_off
from ptt.effects import Effect, Library
from ptt.effects.metrology import TrackerFrame, rigid_basis
from ptt.fit.solve import FitResult
from ptt.holdout import blocks
from ptt.model import rival
from ptt.noise import Noise
from ptt.problem import SHIFT_USUAL, TURN_USUAL, Problem
from ptt.sums import Sums, accumulate, held_out_solutions

BLOCKS = 10
SECOND = {"once-per-rev": "harmonic 2", "setup-jump": "second"}  # effects of which a machine may well have two


@dataclass(frozen=True)
class Design:
    """Whitened columns in usual sizes, and the readings that they are to explain.

    `values` are the readings less the nominal part, so any choice of columns, the present model's or others, is a
    model of them to first order.

    Attributes:
        columns: (n, 3, P).
        values: (n, 3).
        rows: rows that count, (n,) bool.
        block: (n,) int, held-out block of each row, -1 for none.
        frame: indices of the tracker frame's columns, and of the reflector mounts'.
        present: key -> indices of the columns of each effect in the model.
        trials: candidates in all their shapes.
        scale: (P,) usual size of each column.
        sums: normal sums by block; base reflectors are in the first.
        noise: the noise floor that whitened it.
    """

    columns: np.ndarray
    values: np.ndarray
    rows: np.ndarray
    block: np.ndarray
    frame: np.ndarray
    present: dict[str, np.ndarray]
    trials: tuple[Trial, ...]
    scale: np.ndarray
    sums: Sums
    noise: Noise

    @property
    def base(self) -> np.ndarray:
        """Indices of the frame and all present effects."""
        return np.concatenate([self.frame, *self.present.values()])

    def held_out_rms(self, chosen: np.ndarray) -> float:
        """Error of hidden blocks when the chosen columns are fitted on the others, mm (total of the axes)."""
        used = np.flatnonzero(np.bincount(self.block[self.rows & (self.block >= 0)], minlength=len(self.sums.count)))
        color = np.linalg.inv(self.noise.whitener).T
        columns = self.columns[..., chosen]
        squares, count = 0.0, 0
        for index, solution in zip(used, held_out_solutions(self.sums, chosen, used.tolist()), strict=True):
            hidden = self.rows & (self.block == index)
            left = self.values[hidden] - columns[hidden] @ solution
            squares += float(np.square(left @ color).sum())
            count += int(hidden.sum())
        return float(np.sqrt(squares / max(count, 1)))


def present_candidates(fitted: FitResult, problem: Problem, known: Library) -> tuple[list[Effect], dict[str, str]]:
    """Effects that could be added, and those that the data cannot test.

    Args:
        fitted: the present model.
        problem: the readings.
        known: effects by name.

    Returns:
        Candidates, and name -> what it needs.
    """
    kind = problem.file.machine.kind
    candidates, untestable = [], {}
    for name, cls in known.items():
        effect = _next_label(cls, fitted.model.keys)
        if effect is None or kind not in cls.mechanisms:
            continue
        if cls is TrackerFrame and problem.file.tracker.frame != "trusted":
            continue
        if rival(effect, [entry.name for entry in problem.file.effect]):  # the user's choice between two of a kind
            continue
        lack = effect.needs(problem.view)
        if lack:
            if not effect.label:
                untestable[name] = lack
        else:
            candidates.append(effect)
    return candidates, untestable


def build_design(
    fitted: FitResult,
    problem: Problem,
    candidates: Sequence[Effect],
    noise: Noise,
    *,
    shapes: Sequence[Mapping[str, Tensor]] | None = None,
    wander: Wander | None = None,
    sift: bool = True,
) -> Design:
    """Linearise the problem around the present model, with every candidate's columns at zero beside it.

    Args:
        fitted: the present model and its residual.
        problem: the readings.
        candidates: effects that may be added.
        noise: the noise floor.
        shapes: shapes to try; None asks each candidate.
        wander: memory of the noise, taken off columns and readings alike.
        sift: look for gross errors among the rows.

    Returns:
        The design.
    """
    linear = linear_columns(fitted, problem, candidates, noise, shapes)
    columns, values, rows, simple = linear.columns, linear.values, linear.rows, linear.simple
    if sift:
        rows = rows & ~gross_errors(columns, values, rows, simple, few_shapes(linear.trials, simple))
    if wander is not None:
        columns, values = (take_off(item, wander, problem, rows) for item in (columns, values))
    block = blocks(problem.table, BLOCKS)
    sums = with_priors(accumulate(columns[rows], values[rows], block[rows], BLOCKS), fitted, problem, linear)
    return Design(
        columns, values, rows, block, linear.frame, linear.present, linear.trials, linear.scale, sums, noise
    )  # fmt: skip


def with_priors(sums: Sums, fitted: FitResult, problem: Problem, linear: Linear) -> Sums:
    """Add what is known beside the rows: base reflectors, and what an effect is defined without.

    Args:
        sums: over rows.
        fitted: the model they were linearised at.
        problem: for the base reflectors.
        linear: columns of any of the rows.

    Returns:
        The sums with both.
    """
    return _with_held(_with_base(sums, fitted, problem, linear.frame), linear.held.astype(float))


def _with_held(sums: Sums, held: np.ndarray) -> Sums:
    """Add the priors of held values, one usual size wide; whichever block is hidden, the rest has them."""
    share = np.diag(held) / len(sums.count)
    return Sums(sums.gram + share, sums.side, sums.square, sums.count)


def _with_base(sums: Sums, fitted: FitResult, problem: Problem, frame: np.ndarray) -> Sums:
    """Add base reflectors, which tell where the frame is; they are never held out, so every block's rest has them."""
    base = problem.base
    if base is None:
        return sums
    import torch

    rigid = rigid_basis(torch.as_tensor(base.place)).numpy() * np.array([SHIFT_USUAL] * 3 + [TURN_USUAL] * 3)
    motion = fitted.unknowns[len(fitted.unknowns) - 6 * problem.frames :].reshape(-1, 6)
    weight = 1.0 / base.sigma
    # Frame columns solve for further motion, so what the fit has moved already is taken off the reflectors too.
    left = base.reading - base.place - np.einsum("mcp,mp->mc", rigid, motion[base.frame])
    gram, side, square, count = (np.array(part) for part in (sums.gram, sums.side, sums.square, sums.count))
    extra = np.zeros((len(base.place), 3, gram.shape[-1]))
    for index in range(problem.frames):
        here = base.frame == index
        extra[np.ix_(here, np.arange(3), frame[6 * index : 6 * index + 6])] = rigid[here]
    joined = accumulate(extra * weight[:, None, None], left * weight[:, None], np.zeros(len(left), dtype=int), 1)
    # Spread evenly: hiding one of b blocks hides a b-th of the base's weight, which the others make up for.
    share = 1.0 / len(count)
    return Sums(gram + share * joined.gram, side + share * joined.side, square + share * joined.square, count)


def _next_label(cls: type[Effect], keys: Sequence[str]) -> Effect | None:
    """The effect itself, or, where it is in the model, a second of its kind if it can have one."""
    if cls.name not in keys:
        return cls()
    label = SECOND.get(cls.name)
    return cls(label) if label and f"{cls.name}[{label}]" not in keys else None
