"""The linearised problem: derivatives of the readings by every parameter, of the model and of candidates.

    linear = linear_columns(fitted, problem, candidates, noise)      # at a fit, candidates at zero beside it
    linear = assemble(layout, unknowns, problem, noise, candidates)  # the same at any point
    gram, side, square, count = linear.total()                       # normal equations, base reflectors included
    posterior = maximise(gram[np.ix_(own, own)], side[own], square, count, owner, freedom=...)

Any choice of columns together with `linear.frame` is a model of `linear.values` to first order.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np
import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.layout import linear_size
from ptt.effects.sudden import ALWAYS, Sudden
from ptt.effects.usual import usual_values
from ptt.errors import ModelError
from ptt.fitting.layout import FRAME, MOUNT, Layout
from ptt.fitting.result import FitResult
from ptt.fitting.whitened import Total, add_totals, build_whitened, sums_of, turned, whiten
from ptt.model.chain import Chain, signature
from ptt.run.noise import Noise
from ptt.run.problem import Problem

LONG_SEARCH = 12  # shapes from which only some of them stand for all in a saturated model
FEW_SHAPES = 6  # of these neighbouring shapes one stands for all

Shape = Mapping[str, Tensor]
Shapes = Sequence[Shape] | Mapping[str, Sequence[Shape]]


@dataclass(frozen=True)
class ShapeTrial:
    """One shape of one candidate.

    Attributes:
        effect: the candidate.
        shape: its searched and given parameters.
        columns: indices of its columns.
        trials: how many shapes of this effect are tried.
    """

    effect: Effect
    shape: Shape
    columns: np.ndarray
    trials: int


@dataclass(frozen=True)
class Linear:
    """Whitened columns in usual sizes, and the readings that they are to explain.

    `values` are the readings less the nominal part, so effects are solved for as a whole; frames and reflector mounts
    are solved for as they move on from where they are.

    Attributes:
        columns: (n, 3, P): present effects, mounts, frames, then candidates.
        values: (n, 3); zero where not observed.
        residual: residual of the present model, (n, 3) whitened.
        rows: rows that count, (n,) bool.
        frame: indices of the tracker frames' columns, then of the reflector mounts'.
        present: key -> indices of the columns of each effect in the model.
        trials: candidates in all their shapes.
        scale: (P,) usual size of each column.
        held: columns with a prior of one usual size by definition of their effect, (P,) bool.
        base_columns: of the base reflectors, (m, 3, P) in units of their own noise.
        base_values: (m, 3).
        at: gives further columns; None where the rows were dropped.
    """

    columns: np.ndarray
    values: np.ndarray
    residual: np.ndarray
    rows: np.ndarray
    frame: np.ndarray
    present: dict[str, np.ndarray]
    trials: tuple[ShapeTrial, ...]
    scale: np.ndarray
    held: np.ndarray
    base_columns: np.ndarray
    base_values: np.ndarray
    at: "LinearPoint | None" = field(repr=False)

    @property
    def simple(self) -> np.ndarray:
        """Indices of the columns of the present model and the frame, which come first."""
        return np.arange(sum(map(len, self.present.values())) + len(self.frame))

    def total(self, times: float = 1.0) -> Total:
        """Normal sums of the rows that count and of the base reflectors, without a prior.

        Args:
            times: how many rows each row stands for in a sample of a long run; base reflectors count once.
        """
        gram, side, square, count = sums_of(self.columns[self.rows], self.values[self.rows])
        rows = (times * gram, times * side, times * square, round(times * count))
        return add_totals(rows, sums_of(self.base_columns, self.base_values))

    def without_rows(self) -> "Linear":
        """The description of the columns without their rows, which is kept of a chunk once it is summed."""
        columns, values, residual, rows = (part[:0] for part in (self.columns, self.values, self.residual, self.rows))
        return replace(self, columns=columns, values=values, residual=residual, rows=rows, at=None)


@dataclass(frozen=True)
class LinearPoint:
    """The point at which a problem was linearised, which gives columns of further effects and shapes.

    Attributes:
        chain: the present model's.
        problem: the rows.
        whitener: (3, 3) 1/mm.
        motion: (f, 6) how the frames stand.
    """

    chain: Chain
    problem: Problem
    whitener: np.ndarray
    motion: Tensor

    def columns(self, effect: Effect, *shapes: Shape) -> np.ndarray:
        """Columns of an effect in one shape after the other, (n, 3, p), whitened, in the sizes it is tried with."""
        return self.join(self.shifts(effect, shapes), np.tile(tried_sizes(effect, self.problem), len(shapes)))

    def on_base(self, effect: Effect, *shapes: Shape) -> np.ndarray:
        """Columns at the base reflectors, (b, 3, p), in units of their own noise; zero but for metrology effects."""
        base, sizes = self.problem.base, np.tile(tried_sizes(effect, self.problem), len(shapes))
        if base is None or not len(self.motion):
            return np.zeros((0, 3, len(sizes)))
        if effect.stage != "metrology":
            return np.zeros((len(base.frame), 3, len(sizes)))
        count = len(sizes) // max(len(shapes), 1)
        own = torch.cat([effect.basis(base.view, shape)[..., :count] for shape in shapes], dim=-1)
        return base.whitened(turned(own, self.motion, base.frame).numpy(), self.whitener) * sizes

    def join(self, blocks: Sequence[Tensor], sizes: np.ndarray) -> np.ndarray:
        """Shifts of readings (n, 3, p) each, as the frames show them, side by side and whitened, in usual sizes."""
        block = blocks[0] if len(blocks) == 1 else torch.cat(list(blocks), dim=-1)
        return whiten([turned(block, self.motion, self.problem.frame).numpy()], self.whitener, sizes)

    def shifts(self, effect: Effect, shapes: Sequence[Shape]) -> list[Tensor]:
        """What an effect adds to the readings in each shape, (n, 3, p) mm per unit.

        A sudden effect is zero up to its moment, and from then on as if it acted throughout.

        Raises:
            ModelError: they are no numbers at a row that counts, as an effect of the user's own may have it.
        """
        if not isinstance(effect, Sudden) or len(shapes) < 2:
            count = len(tried_sizes(effect, self.problem))
            blocks = [signature(self.chain, effect, shape)[..., :count] for shape in shapes]
            self._require_numbers(effect, blocks)
            return blocks
        whole, clock = signature(self.chain, effect, ALWAYS), self.problem.view.clock
        return [whole * (clock > shape["after"]).to(whole.dtype)[:, None, None] for shape in shapes]

    def _require_numbers(self, effect: Effect, blocks: Sequence[Tensor]) -> None:
        """Refuse an effect's shifts (n, 3, p) that are not finite where the machine can stand."""
        for block in blocks:
            if np.isfinite(float(block.sum())):  # as nearly always, without a mask of all of them
                continue
            stood = torch.as_tensor(self.problem.used) & torch.isfinite(self.chain.reading).all(dim=1)
            lost = torch.nonzero(stood & ~torch.isfinite(block).flatten(1).all(dim=1)).flatten().tolist()
            if lost:
                more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
                what = f"the shift of effect '{effect.key}' is no finite number"
                fix = "mend its basis: no division by zero, no root or logarithm below it"
                raise ModelError(what, where=f"{self.problem.table.place(lost[0])}{more}", fix=fix)


def linear_columns(
    fitted: FitResult, problem: Problem, candidates: Sequence[Effect], noise: Noise, shapes: Shapes | None = None
) -> Linear:
    """Linearise around a fitted model, with columns of candidates at zero.

    Args:
        fitted: the model.
        problem: the rows; those it was fitted on or others of the same run.
        candidates: effects that may be added.
        noise: the noise floor.
        shapes: shapes to try, for each candidate by its key or the same for all; None asks each candidate.

    Returns:
        The columns.
    """
    return assemble(fitted.layout, fitted.unknowns, problem, noise, candidates, shapes)


def assemble(
    layout: Layout, unknowns: np.ndarray, problem: Problem, noise: Noise, candidates: Sequence[Effect] = (),
    shapes: Shapes | None = None,
) -> Linear:  # fmt: skip
    """Linearise around any point.

    Args:
        layout: the present model's unknowns.
        unknowns: (u,) in usual sizes.
        problem: the rows.
        noise: the noise floor.
        candidates: effects that may be added.
        shapes: as in `linear_columns`.

    Returns:
        The columns.
    """
    system = build_whitened(layout, problem, noise.whitener, unknowns, crossed=False)  # as columns of candidates are
    at = LinearPoint(system.chain, problem, noise.whitener, layout.frame_parameters(unknowns))
    trials, blocks = _try(at, candidates, shapes, len(unknowns))
    own = layout.owner >= 0
    residual = np.nan_to_num(system.residual)
    values = residual + system.jacobian[..., own] @ unknowns[own]
    base_values = system.base_residual + system.base_jacobian[..., own] @ unknowns[own]
    tried = {key: tuple(own) for key, own in groupby(trials, lambda trial: trial.effect.key)}
    base = [at.on_base(own[0].effect, *(trial.shape for trial in own)) for own in tried.values()]
    frame = np.concatenate([np.flatnonzero(layout.owner == FRAME), np.flatnonzero(layout.owner == MOUNT)])
    present = {term.effect.key: np.flatnonzero(layout.owner == index) for index, term in enumerate(layout.terms)}
    usual = {key: tried_sizes(own[0].effect, problem) for key, own in tried.items()}
    held = {key: held_values(own[0].effect, problem)[: len(usual[key])] for key, own in tried.items()}
    return Linear(
        np.concatenate([system.jacobian, *blocks], axis=-1), values, residual,
        problem.used & np.isfinite(system.residual).all(axis=1), frame, present, tuple(trials),
        np.concatenate([layout.scale, *(usual[trial.effect.key] for trial in trials)]),
        np.concatenate([layout.held, *(held[trial.effect.key] for trial in trials)]).astype(bool),
        np.concatenate([system.base_jacobian, *base], axis=-1), base_values, at,
    )  # fmt: skip


def _try(
    at: LinearPoint, candidates: Sequence[Effect], shapes: Shapes | None, start: int
) -> tuple[list[ShapeTrial], list[np.ndarray]]:
    """Every candidate in all its shapes: what it is, and its columns."""
    trials, blocks, sizes = [], list[Tensor](), list[np.ndarray]()
    for effect in candidates:
        own = shapes[effect.key] if isinstance(shapes, Mapping) else shapes
        tried = effect.search(at.problem.view) if own is None else own
        usual = tried_sizes(effect, at.problem)
        for shape, block in zip(tried, at.shifts(effect, tried), strict=True):
            trials.append(ShapeTrial(effect, dict(shape), np.arange(start, start + len(usual)), len(tried)))
            blocks.append(block)
            sizes.append(usual)
            start += len(usual)
    return trials, [at.join(blocks, np.concatenate(sizes))] if blocks else []


def usual_sizes(effect: Effect, problem: Problem) -> np.ndarray:
    """Usual size of each linear value of an effect, (P,)."""
    return usual_values(effect, problem.view)[: linear_size(effect, problem.view.joints)].numpy()


def detailed_columns(at: LinearPoint, effect: Effect, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Columns of an effect with its fine detail, (n, 3, P), whitened, and the usual sizes they are in, (P,)."""
    sizes = usual_sizes(effect, at.problem)
    return at.join([signature(at.chain, effect, shape)], sizes), sizes


def tried_sizes(effect: Effect, problem: Problem) -> np.ndarray:
    """Usual size of each linear value that an effect is tried with, (P,): without fine detail, which is added later."""
    joints = problem.view.joints
    fine = sum(parameter.size(joints) for parameter in effect.parameters if parameter.fine)  # the last of them
    usual = usual_sizes(effect, problem)
    return usual[: len(usual) - fine]


def held_values(effect: Effect, problem: Problem) -> np.ndarray:
    """Which linear values have a prior of one usual size by the definition of the effect, (P,) bool."""
    parameters = [parameter for parameter in effect.parameters if parameter.role == "linear"]
    return np.concatenate([np.zeros(0), *(np.full(item.size(problem.view.joints), item.held) for item in parameters)])


def few_shapes(trials: Sequence[ShapeTrial], simple: np.ndarray) -> np.ndarray:
    """Columns of a saturated model: the present one's and candidates', of long searches one shape of every few."""
    seen: dict[str, int] = {}
    chosen = [simple]
    for trial in trials:
        number = seen.get(trial.effect.key, 0)
        seen[trial.effect.key] = number + 1
        if trial.trials < LONG_SEARCH or number % FEW_SHAPES == FEW_SHAPES // 2:
            chosen.append(trial.columns)
    return np.concatenate(chosen).astype(int)
