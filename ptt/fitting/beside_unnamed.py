"""Beside the unnamed: how far a fit is open because sizes of the drawing that its model has not are off as well."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from ptt.effects import Effect, library
from ptt.effects.registry import parse_key
from ptt.fitting.chunks import LONG, SAMPLE, sample_stretches, take
from ptt.fitting.evidence import NARROWEST, WIDEST, learn
from ptt.fitting.linear import ShapeTrial, linear_columns
from ptt.fitting.posterior import Posterior
from ptt.fitting.prior import FRAME
from ptt.fitting.result import FitResult
from ptt.fitting.stated import fitted_terms
from ptt.fitting.unnamed import Unnamed
from ptt.fitting.whitened import Total
from ptt.model.model import rival
from ptt.run.problem import Problem

EXCLUDED = 1.5  # nats for leaving a size out from which readings say it is none: what they do not know costs less
ROUNDING = 1e-12  # share of the largest square that is rounding
TWICE = {"dh-offsets": ("dtheta", "homing-offset")}  # effect -> its parameter that another one is, and that one


def beside_unnamed(fitted: FitResult, problem: Problem) -> FitResult:
    """A fit with its errors as far as sizes of the drawing that its model does not have leave them open.

    A few values make good, where a run went, for all sizes that are off, and on every real machine all are a little:
    elsewhere they do not, and they are not what they say. So all sizes are learned together, each as large as the
    readings let it be. That may put the model's own values elsewhere: by so much, and by what is open then, they may
    be off, by the chance that each of these sizes has: even where readings know nothing of it.

    Args:
        fitted: the fit.
        problem: the readings that it was fitted to; of a long run stretches stand for all.

    Returns:
        The fit; as given where nothing of the machine was fitted.
    """
    if not (fitted.layout.owner >= 0).any():
        return fitted
    some, total = _sizes(fitted, problem)
    base, best = _learned(fitted, total, ()), _learned(fitted, total, some)
    while some:
        least = min(some, key=lambda size: float(best.scales[_groups(some, fitted)[size.effect.key]].max()))
        fewer = tuple(size for size in some if size is not least)
        other = _learned(fitted, total, fewer)
        if other.total < best.total + EXCLUDED:
            break
        some, best = fewer, other
    chance = float(expit((best.total - base.total) / max(len(some), 1)))
    root = _factor(chance * _moved(base, best)) if some else np.zeros((len(fitted.unknowns), 0))
    result = replace(fitted, unnamed=Unnamed(tuple(size.effect for size in some), _whole(root, some, fitted)))
    return replace(result, model=replace(result.model, terms=fitted_terms(result)))


def unnamed_sizes(keys: Sequence[str], problem: Problem) -> list[Effect]:
    """Sizes of the drawing that a model does not have, may be given, and a run can test.

    None that several others are together: they say it.

    Args:
        keys: of the model's effects.
        problem: the run.
    """
    return [effect for effect in _unnamed(keys, problem) if not rival(effect, keys)]


def _unnamed(keys: Sequence[str], problem: Problem) -> list[Effect]:
    """All of them, those included of which a part is in the model."""
    kind, names = problem.file.machine.kind, {parse_key(key)[0] for key in keys}
    every = [
        each() for name, each in library().items()
        if each.of_drawing and kind in each.mechanisms and name not in names and not each.stands_for
    ]  # fmt: skip
    found = [effect for effect in every if not effect.needs(problem.view)]
    whole = [*keys, *(effect.key for effect in found if effect.name in TWICE)]
    return [effect for effect in found if effect.name in TWICE or not rival(effect, whole)]


@dataclass(frozen=True)
class _Size:
    """A size of the drawing beside a fit.

    Attributes:
        effect: of which it is.
        columns: (w,) of its linear values.
        group: (w,) int, which parameter each is of; -1 for what the model has under another name.
    """

    effect: Effect
    columns: np.ndarray
    group: np.ndarray


def _sizes(fitted: FitResult, problem: Problem) -> tuple[tuple[_Size, ...], Total]:
    """Sizes of the drawing that a model does not have, and sums of all columns, the fit's unknowns first."""
    sound, keys = problem.masked(fitted.outliers), fitted.model.keys
    few = take(sound, sample_stretches(sound, SAMPLE)) if sound.table.rows > LONG else sound
    linear = linear_columns(fitted, few, _unnamed(keys, few), fitted.noise)
    gram, side, square, count = linear.sums(np.zeros(few.table.rows, dtype=int), 1).total
    times = sound.table.rows / few.table.rows
    sizes = tuple(_size(trial, keys, few) for trial in linear.trials)
    return sizes, (times * gram, times * side, times * square, round(times * count))


def _size(trial: ShapeTrial, keys: Sequence[str], problem: Problem) -> _Size:
    part, twin = TWICE.get(trial.effect.name, ("", ""))
    there = twin in {parse_key(key)[0] for key in keys}
    linear = [parameter for parameter in trial.effect.parameters if parameter.role == "linear"]
    group = np.concatenate([
        np.full(parameter.size(problem.view.joints), -1 if there and parameter.stem == part else number)
        for number, parameter in enumerate(linear)
    ])  # fmt: skip
    return _Size(trial.effect, trial.columns, group[: len(trial.columns)])


def _groups(sizes: Sequence[_Size], fitted: FitResult) -> dict[str, np.ndarray]:
    """Numbers of the learned widths of each size, behind those of the fit."""
    found, first = {}, len(fitted.layout.kinds)
    for size in sizes:
        own = len(np.unique(size.group[size.group >= 0]))
        found[size.effect.key] = np.arange(first, first + own)
        first += own
    return found


def _learned(fitted: FitResult, total: Total, sizes: Sequence[_Size]) -> Posterior:
    """The fit's unknowns and some further sizes, every width learned."""
    layout, prior, (gram, side, square, count) = fitted.layout, fitted.prior, total
    groups = _groups(sizes, fitted)
    columns, owner = [np.arange(len(layout.scale))], [layout.group]
    for size in sizes:
        kept = size.group >= 0
        columns.append(size.columns[kept])
        owner.append(groups[size.effect.key][np.unique(size.group[kept], return_inverse=True)[1]])
    more = sum(map(len, groups.values()))
    every = np.concatenate(columns).astype(int)
    fixed = np.array([kind != "free" for kind in layout.kinds] + [False] * more, dtype=bool)
    scales = np.concatenate([prior.scales, np.ones(more)])
    wide = prior.crowding * max(1.0, fitted.chi2 / max(fitted.freedom, 1))
    return learn(
        gram[np.ix_(every, every)] / wide, side[every] / wide, square / wide, count / prior.crowding,
        np.concatenate(owner).astype(int), freedom=np.inf, start=scales, wide=FRAME,
        floor=np.where(fixed, scales, NARROWEST), ceiling=np.where(fixed, scales, WIDEST),
    )  # fmt: skip


def _moved(base: Posterior, best: Posterior) -> np.ndarray:
    """Mean squares and products by which values beside other sizes are off those without, beyond their covariance."""
    width, off = len(base.values), best.values.copy()
    off[:width] -= base.values
    square = best.covariance + np.outer(off, off)
    square[:width, :width] -= base.covariance
    return np.asarray(square)


def _factor(square: np.ndarray) -> np.ndarray:
    """Root of what is positive of a symmetric matrix, (p, r)."""
    size, ways = np.linalg.eigh(square)
    kept = size > ROUNDING * max(float(size[-1]), 0.0)
    return np.asarray(ways[:, kept] * np.sqrt(size[kept]))


def _whole(root: np.ndarray, sizes: Sequence[_Size], fitted: FitResult) -> np.ndarray:
    """The same with a row for every linear value of each size, zero for what the model has under another name."""
    rows, first = [root[: len(fitted.unknowns)]], len(fitted.unknowns)
    for size in sizes:
        kept = size.group >= 0
        own = np.zeros((len(size.group), root.shape[1]))
        own[kept] = root[first : first + int(kept.sum())]
        first += int(kept.sum())
        rows.append(own)
    return np.concatenate(rows)
