"""Uncertainty of a fit because sizes of the drawing that its model does not have are a little off too."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import expit

from ptt.fitting.drawn_sizes import DrawnSize, groups_of, learn_beside, sizes_beside
from ptt.fitting.factor import RANK_TOLERANCE
from ptt.fitting.other_ways import other_ways
from ptt.fitting.posterior import Posterior
from ptt.fitting.result import FitResult
from ptt.fitting.stated import with_fitted_terms
from ptt.fitting.unnamed import Unnamed
from ptt.run.problem import Problem

# nats gained by leaving a size out from which the readings exclude it: one they know nothing of gains less
EXCLUSION_NATS = 1.5


def beside_unnamed(fitted: FitResult, problem: Problem) -> FitResult:
    """Widen a fit's errors by sizes of the drawing that its model does not have.

    On every real machine all sizes are a little off. The few values of a model make up for the others where the run
    went, but not elsewhere, and are then not what they say. So prior variances of all sizes are learned together, and
    sizes that the readings exclude are dropped. The shift of the model's own values beside the remaining sizes, and
    their larger covariance there, are added, weighted by the probability of these sizes: one half each where the
    readings do not determine them.

    Args:
        fitted: the fit.
        problem: the readings that it was fitted to; a long run is sampled.

    Returns:
        The fit with `unnamed`; as given where no effect was fitted.
    """
    if not (fitted.layout.owner >= 0).any():
        return fitted
    every, total = sizes_beside(fitted, problem)
    base, best, some = learn_beside(fitted, total, ()), learn_beside(fitted, total, every), every
    while some:
        least = min(some, key=lambda size: float(best.group_variances[groups_of(some, fitted)[size.effect.key]].max()))
        fewer = tuple(size for size in some if size is not least)
        other = learn_beside(fitted, total, fewer)
        if other.total < best.total + EXCLUSION_NATS:
            break
        some, best = fewer, other
    chance = float(expit((best.total - base.total) / max(len(some), 1)))
    others = other_ways(fitted, total, every, base, max(base.total, best.total))
    ways = [(chance, some, best), *((way.chance, (way.size,), way.there) for way in others)]
    beside = tuple(size for size in every if any(size in own for _, own, _ in ways))
    square = np.sum([weight * _among(_moved(base, there), own, beside, fitted) for weight, own, there in ways], axis=0)
    otherwise = dict.fromkeys((effect, way.size.effect.key) for way in others for effect in way.effects)
    effects = tuple(size.effect for size in beside)
    unnamed = Unnamed(effects, _whole(_factor(square), beside, fitted), tuple(otherwise))
    return with_fitted_terms(replace(fitted, unnamed=unnamed))


def _moved(base: Posterior, best: Posterior) -> np.ndarray:
    """Second moments of the difference between values beside further sizes and without, less the covariance without."""
    width, off = len(base.values), best.values.copy()
    off[:width] -= base.values
    square = best.covariance + np.outer(off, off)
    square[:width, :width] -= base.covariance
    return np.asarray(square)


def _among(square: np.ndarray, own: Sequence[DrawnSize], every: Sequence[DrawnSize], fitted: FitResult) -> np.ndarray:
    """Second moments of the fit's unknowns and some sizes, embedded among those of more sizes with zeros."""
    place, first = list(range(len(fitted.unknowns))), len(fitted.unknowns)
    for size in every:
        kept = int((size.group >= 0).sum())
        place += range(first, first + kept) if size in own else ()
        first += kept
    whole = np.zeros((first, first))
    whole[np.ix_(place, place)] = square
    return whole


def _factor(square: np.ndarray) -> np.ndarray:
    """Square root, (p, r), of the positive part of a symmetric matrix."""
    eigenvalues, vectors = np.linalg.eigh(square)
    kept = eigenvalues > RANK_TOLERANCE * max(float(eigenvalues[-1]), 0.0)
    return np.asarray(vectors[:, kept] * np.sqrt(eigenvalues[kept]))


def _whole(root: np.ndarray, sizes: Sequence[DrawnSize], fitted: FitResult) -> np.ndarray:
    """The root with a row for every linear value of each size, zero for what the model has under another name."""
    rows, first = [root[: len(fitted.unknowns)]], len(fitted.unknowns)
    for size in sizes:
        kept = size.group >= 0
        own = np.zeros((len(size.group), root.shape[1]))
        own[kept] = root[first : first + int(kept.sum())]
        first += int(kept.sum())
        rows.append(own)
    return np.concatenate(rows)
