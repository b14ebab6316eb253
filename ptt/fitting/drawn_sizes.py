"""Sizes of the drawing beside a fit: their columns, and the posterior of both with all prior variances learned."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.effects import Effect, library
from ptt.effects.registry import parse_key
from ptt.fitting.chunks import sampled_if_long
from ptt.fitting.evidence import LEAST_VARIANCE, MOST_VARIANCE, maximise
from ptt.fitting.linear import ShapeTrial, linear_columns
from ptt.fitting.posterior import Posterior
from ptt.fitting.prior import FRAME_VARIANCE
from ptt.fitting.result import FitResult
from ptt.fitting.whitened import Total
from ptt.model.model import rival
from ptt.run.problem import Problem

# effect -> the parameter that another effect consists of, and that effect
SHARED_PARAMETER = {"dh-offsets": ("dtheta", "homing-offset")}
SMALL_VARIANCE = 1e-2  # a tenth of the usual size squared: start from which a variance falls to nothing where it may


@dataclass(frozen=True)
class DrawnSize:
    """A size of the drawing beside a fit.

    Attributes:
        effect: the effect that corrects it.
        columns: indices of the columns of its linear values, (w,).
        group: number of the parameter of each value, (w,) int; -1 for what the model has under another name.
    """

    effect: Effect
    columns: np.ndarray
    group: np.ndarray


def unnamed_sizes(keys: Sequence[str], problem: Problem) -> list[Effect]:
    """Sizes of the drawing that a model does not have, could have, and that a run can test.

    Without those that are the same as several others together.

    Args:
        keys: of the model's effects.
        problem: the run.
    """
    return [effect for effect in _unnamed(keys, problem) if not rival(effect, keys)]


def _unnamed(keys: Sequence[str], problem: Problem) -> list[Effect]:
    """`unnamed_sizes`, including those of which a part is in the model."""
    kind, names = problem.file.machine.kind, {parse_key(key)[0] for key in keys}
    every = [
        each() for name, each in library().items()
        if each.of_drawing and kind in each.mechanisms and name not in names and not each.stands_for
    ]  # fmt: skip
    found = [effect for effect in every if not effect.needs(problem.view)]
    whole = [*keys, *(effect.key for effect in found if effect.name in SHARED_PARAMETER)]
    return [effect for effect in found if effect.name in SHARED_PARAMETER or not rival(effect, whole)]


def sizes_beside(fitted: FitResult, problem: Problem) -> tuple[tuple[DrawnSize, ...], Total]:
    """Sizes of the drawing that a model does not have, and normal sums of all columns, the fit's unknowns first."""
    sound, keys = problem.masked(fitted.outliers), fitted.model.keys
    few = sampled_if_long(sound)
    linear = linear_columns(fitted, few, _unnamed(keys, few), fitted.noise)
    sizes = tuple(_size(trial, keys, few) for trial in linear.trials)
    return sizes, linear.total(sound.table.rows / few.table.rows)


def _size(trial: ShapeTrial, keys: Sequence[str], problem: Problem) -> DrawnSize:
    part, twin = SHARED_PARAMETER.get(trial.effect.name, ("", ""))
    there = twin in {parse_key(key)[0] for key in keys}
    linear = [parameter for parameter in trial.effect.parameters if parameter.role == "linear"]
    group = np.concatenate([
        np.full(parameter.size(problem.view.joints), -1 if there and parameter.stem == part else number)
        for number, parameter in enumerate(linear)
    ])  # fmt: skip
    return DrawnSize(trial.effect, trial.columns, group[: len(trial.columns)])


def groups_of(sizes: Sequence[DrawnSize], fitted: FitResult) -> dict[str, np.ndarray]:
    """Key of a size -> numbers of its variance groups, which follow those of the fit."""
    found, first = {}, len(fitted.layout.kinds)
    for size in sizes:
        own = len(np.unique(size.group[size.group >= 0]))
        found[size.effect.key] = np.arange(first, first + own)
        first += own
    return found


def learn_beside(
    fitted: FitResult, total: Total, sizes: Sequence[DrawnSize], *, held: float | None = None, small: int | None = None,
    start: np.ndarray | None = None,
) -> Posterior:  # fmt: skip
    """Posterior of the fit's unknowns and some further sizes, their prior variances learned.

    Args:
        fitted: the fit.
        total: normal sums of all columns.
        sizes: the further sizes.
        held: prior variance of these sizes; None learns it.
        small: number of a group of the fit whose variance starts near zero; None for none.
        start: variances of the fit's groups to start from; None for those of the fit.
    """
    layout, prior, (gram, side, square, count) = fitted.layout, fitted.prior, total
    groups = groups_of(sizes, fitted)
    columns, owner = [np.arange(len(layout.scale))], [layout.group]
    for size in sizes:
        kept = size.group >= 0
        columns.append(size.columns[kept])
        owner.append(groups[size.effect.key][np.unique(size.group[kept], return_inverse=True)[1]])
    more = sum(map(len, groups.values()))
    every = np.concatenate(columns).astype(int)
    fixed = np.array([kind != "free" for kind in layout.kinds] + [False] * more, dtype=bool)
    variances = np.concatenate([prior.group_variances, np.full(more, 1.0 if held is None else held)])
    fixed[len(layout.kinds) :] = held is not None
    begun = variances.copy()
    begun[: len(layout.kinds)] = prior.group_variances if start is None else start
    if small is not None:  # and all others at usual sizes or more, so that they can take its place
        begun = np.where(fixed, begun, np.maximum(begun, 1.0))
        begun[small] = SMALL_VARIANCE
    wide = prior.design_effect * fitted.scatter
    return maximise(
        gram[np.ix_(every, every)] / wide, side[every] / wide, square / wide, count / prior.design_effect,
        np.concatenate(owner).astype(int), freedom=np.inf, start=begun, ungrouped_variance=FRAME_VARIANCE,
        floor=np.where(fixed, variances, LEAST_VARIANCE), ceiling=np.where(fixed, variances, MOST_VARIANCE),
    )  # fmt: skip
