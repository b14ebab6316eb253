"""Choosing among candidates, and against doing nothing, by held-out error."""

from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import numpy.typing as npt
from scipy.special import stdtr

from nets.design import Design
from nets.scaling import FloatArray
from nets.settings import RbfSettings
from nets.weights import normal_equations, products, ridge_path

IntArray = npt.NDArray[np.int64]

LEAST_PLACES = 20  # distinct inputs; with ten, up to 7 % of pure noise outputs were learned
PLAIN_GAIN = 0.5  # ratio of rms errors below which a gain needs no test; never seen on independent noise


@dataclass(frozen=True)
class Choice:
    """One candidate and the ridge of each output.

    Attributes:
        candidate: index into the candidates.
        ridge: (o,) indices into the ridges.
    """

    candidate: int
    ridge: IntArray


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Sums of squared held-out errors, in squared units of the outputs.

    Attributes:
        squares: (c, r, k, o) per candidate, ridge, fold and output.
        null: (k, o), the same when zero is predicted.
        rows: (k,) rows per fold.
        places: number of distinct inputs.
    """

    squares: FloatArray
    null: FloatArray
    rows: IntArray
    places: int


@dataclass(frozen=True, eq=False)
class Verdict:
    """Test of a choice on held-out rows, for each output.

    Attributes:
        heldout_rms: (o,) of the choice, in units of the outputs.
        null_rms: (o,) of predicting zero.
        p_value: (o,) of the one-sided t test of the gain over folds, see `judge`.
        learned: (o,) whether the output is to be predicted at all.
    """

    heldout_rms: FloatArray
    null_rms: FloatArray
    p_value: FloatArray
    learned: npt.NDArray[np.bool_]


def deal_folds(groups: IntArray, folds: int, seed: int) -> list[IntArray]:
    """Deal whole groups into folds, in shuffled order, so that no group is ever split.

    Args:
        groups: (n,) group of each row; rows of a group (a block of travel, all visits of a pose) stay together.
        folds: at most so many.
        seed: of the shuffle.

    Returns:
        Row indices per fold; min(folds, groups) of them.
    """
    _, code = np.unique(groups, return_inverse=True)
    count = int(code.max()) + 1
    fold_of_group = np.random.default_rng(seed).permutation(count) % min(folds, count)
    fold = fold_of_group[code]
    return [np.flatnonzero(fold == index) for index in range(min(folds, count))]


def heldout_squares(design: Design, folds: list[IntArray], settings: RbfSettings) -> FloatArray:
    """Squared errors on each fold of weights fitted on all the others, for every ridge.

    Args:
        design: one candidate, all rows.
        folds: row indices per fold.
        settings: ridges and method.

    Returns:
        (r, k, o) sums over the rows of a fold, in squared units of the outputs.
    """
    ridges = np.asarray(settings.ridges)
    parts = [products(design.background[rows], design.features[rows], design.outputs[rows]) for rows in folds]
    total = reduce(add, parts)
    squares = np.empty((len(ridges), len(folds), design.outputs.shape[1]))
    for index, rows in enumerate(folds):
        equations = normal_equations(total - parts[index])
        weights = ridge_path(equations, ridges, rate=settings.rate, steps=settings.steps)  # (r, q, o)
        predicted = design.features[rows] @ weights + design.background[rows] @ equations.background(weights)
        squares[:, index] = np.square(design.outputs[rows] - predicted).sum(axis=1)
    return squares


def choose(held_out: HeldOut, *, without: int | None = None, null_candidate: bool = True) -> Choice:
    """The candidate with the least held-out error, and for it the best ridge of each output.

    Outputs count by their error relative to predicting zero, at most 1 each where zero is allowed, so an output with
    nothing to learn neither drives nor spoils the choice. The first candidate wins a tie: list simple ones first.

    Args:
        held_out: errors of all candidates.
        without: a fold to leave out of the choice.
        null_candidate: whether an output may stay zero.

    Returns:
        The choice.
    """
    keep = np.arange(held_out.null.shape[0]) != (-1 if without is None else without)
    total = held_out.squares[:, :, keep].sum(axis=2)  # (c, r, o)
    null = held_out.null[keep].sum(axis=0)  # (o,)
    share = np.divide(total.min(axis=1), null, out=np.ones_like(total[:, 0]), where=null > 0)  # (c, o)
    if null_candidate:
        share = np.minimum(share, 1.0)
    candidate = int(np.argmin(share.sum(axis=1)))
    return Choice(candidate, np.argmin(total[candidate], axis=0))


def judge(held_out: HeldOut, settings: RbfSettings) -> Verdict:
    """Whether choosing and fitting in this way helps rows that neither the choice nor the fit has seen.

    Each fold is judged with the choice made on the others alone, so trying many candidates cannot flatter the error.
    An output is learned when that error is below the error of predicting zero, and

    - over folds the gain (zero - choice) / (zero + choice) of the squared errors is above 0 by a one-sided t test (a
      ratio, so one fold with a large error does not outvote the rest), or
    - the root mean square error is less than half that of zero: few folds make the t test strict, and one fold that
      had nothing to gain would veto what helps all others.

    With fewer than 20 distinct inputs no output is learned. Rows in different groups count as independent: with groups
    shorter than the correlation time of the noise, drift is learned.

    Args:
        held_out: errors of all candidates.
        settings: level of the test, and whether zero is allowed.

    Returns:
        The verdict per output.
    """
    folds = held_out.null.shape[0]
    squares = np.empty_like(held_out.null)
    for fold in range(folds):
        choice = choose(held_out, without=fold, null_candidate=settings.null_candidate)
        squares[fold] = _squares_of(held_out, choice)[fold]
    p_value = _gain_p_value(held_out.null, squares)
    rows = held_out.rows.sum()
    rms, null_rms = np.sqrt(squares.sum(axis=0) / rows), np.sqrt(held_out.null.sum(axis=0) / rows)
    helps = (rms < null_rms) & (p_value < settings.significance) | (rms < PLAIN_GAIN * null_rms)
    learned = helps & (held_out.places >= LEAST_PLACES) if settings.null_candidate else np.ones_like(helps)
    return Verdict(np.where(learned, rms, null_rms), null_rms, p_value, learned)


def _squares_of(held_out: HeldOut, choice: Choice) -> FloatArray:
    outputs = np.arange(held_out.null.shape[1])
    return np.asarray(held_out.squares[choice.candidate, choice.ridge, :, outputs].T)  # (k, o)


def _gain_p_value(null: FloatArray, squares: FloatArray) -> FloatArray:
    both = null + squares
    gain = np.divide(null - squares, both, out=np.zeros_like(both), where=both > 0)  # (k, o), in [-1, 1]
    error = gain.std(axis=0, ddof=1) / np.sqrt(len(gain))
    mean = gain.mean(axis=0)
    # Equal gains in all folds have no scatter: certain where positive, nothing where not.
    t = np.divide(mean, error, out=np.where(mean > 0, np.inf, -np.inf), where=error > 0)
    return np.asarray(stdtr(len(gain) - 1, -t))
