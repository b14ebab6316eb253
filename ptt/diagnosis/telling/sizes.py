"""Size and direction of an unknown, from the posterior of its blocks or from binned readings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.dependence.bins import bins_of
from ptt.dependence.contexts import is_direction, path_views, residual_views, unit_of
from ptt.dependence.dependence import Dependence
from ptt.dependence.size import Estimate, Size, estimate_of, size_of, size_of_side, size_of_turn
from ptt.diagnosis.telling.unknowns import LARGER_FACTOR, Unknown
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.places import FEATURE_SIZE
from ptt.run.axes import AXES, rms_length
from ptt.run.frames import without_rigid_parts
from ptt.run.means import about_means
from ptt.run.problem import Problem

Contexts = dict[str, np.ndarray]


def size_of_unknown(
    item: Unknown, alike: Sequence[Unknown], found: Dependence, rest: np.ndarray, problem: Problem, contexts: Contexts
) -> Size | None:
    """The size of an unknown from the posterior of its blocks.

    Where blocks cancel each other, or one does another's work, their values say nothing, and the size comes from the
    binned readings.

    Args:
        item: one block.
        alike: all blocks at its place with its leading variable, itself included.
        found: its dependence.
        rest: residual of the named effects, (n, 3) mm, NaN on rows that do not count.
        problem: n rows.
        contexts: name -> context variable, (n,).

    Returns:
        The size; None where the rows do not determine it.
    """
    rows = np.isfinite(rest).all(axis=1) & np.isfinite(contexts[found.on])
    part = np.sum([one.part for one in alike], axis=0)[rows]
    rms = rms_length(part)
    amounts = item.amounts
    if amounts is None or rms > LARGER_FACTOR * rms_length(rest[rows]):
        # Binned readings have no context of the travel since a reversal: the size is then that of the two sides.
        second = None if item.block.gradual else found.with_
        where = found.acts_on if found.acts_on == "mount" else None
        size = sized((replace(found, acts_on=where, with_=second),), rest, problem)[0].size
        return size and replace(size, rms=rms_beside_frames(part, problem, rows) if item.in_addition else None)
    moves = np.concatenate([_moves(one.block, found, problem)[rows] for one in alike], axis=1)
    own = np.concatenate([one.own for one in alike])
    values, covariance = amounts.values[own], amounts.covariance[np.ix_(own, own)]

    def estimate(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        by_feature = weights @ moves
        return by_feature @ values, by_feature @ covariance @ by_feature.T

    along = found.with_ or next((name for name in item.block.on[1:] if name in contexts), None)
    if item.block.gradual:
        whole = size_of_turn(_off(found), estimate, contexts[found.on][rows], moves @ values)
        size = whole and _named(whole, found.on, "reversal", problem)
    else:
        size = _size(found, estimate, problem, contexts, rows, along)
    return size and replace(size, rms=rms_beside_frames(part, problem, rows))


def rms_beside_frames(part: np.ndarray, problem: Problem, rows: np.ndarray) -> float:
    """Root mean square contribution of an unknown after alignment of fitted frames, mm.

    Errors are reported after alignment, and part of a slow or one-sided unknown is only a shift of the frame.

    Args:
        part: contribution to some rows, (m, 3) mm.
        problem: n rows.
        rows: which these are, (n,) bool with m of them.
    """
    left = part
    if problem.frames and problem.file.tracker.frame != "measured":
        left = without_rigid_parts(part, problem.view.p.numpy()[rows], problem.frame[rows])
    return rms_length(left)


def sized(found: tuple[Dependence, ...], left: np.ndarray, problem: Problem) -> tuple[Dependence, ...]:
    """Add sizes to dependences that have no block, from means of binned readings.

    Args:
        found: the dependences.
        left: residual of the named effects, (n, 3) mm, NaN on rows that do not count.
        problem: n rows.

    Returns:
        The dependences with their sizes.
    """
    views, contexts = residual_views(problem, left), path_views(problem)
    told = []
    for item in found:
        rows = np.isfinite(views[item.residual]) & np.isfinite(contexts[item.on])
        readings = views[item.residual][rows]
        number, _ = bins_of(contexts[item.on][rows])
        inside = about_means(readings, number)
        sigma = float(np.sqrt(np.square(inside).sum() / max(len(inside) - number.max() - 1, 1)))
        size = _size(item, estimate_of(readings, sigma), problem, contexts, rows, item.with_)
        told.append(replace(item, size=size, points=points_of(item, views[item.residual], contexts)))
    return tuple(told)


def points_of(found: Dependence, readings: np.ndarray, contexts: Contexts) -> np.ndarray:
    """The points to plot with the curve of a dependence.

    Args:
        found: the dependence.
        readings: (n,) mm or rad, NaN on rows that do not count.
        contexts: (n,) each.

    Returns:
        Abscissa and reading about the mean, (m, 2): folded for a period; for a direction with a second variable along
            that, multiplied by the direction.
    """
    at = contexts[found.with_ or found.on]
    at = at if found.period_mm is None else np.remainder(at, found.period_mm)
    rows = np.isfinite(at) & np.isfinite(readings) & np.isfinite(contexts[found.on])
    signed = readings - readings[rows].mean() if rows.any() else readings
    signed = signed * np.sign(contexts[found.on]) if found.with_ else signed
    return np.column_stack([at[rows], signed[rows]])


def _moves(block: Block, found: Dependence, problem: Problem) -> np.ndarray:
    """Motion of the place (or else of the residual) by each feature of a block, (n, w) mm or rad."""
    if block.place.joint is not None and block.place.slopes.shape[2] == 1:
        return FEATURE_SIZE * block.shapes / block.place.lever
    if found.residual in AXES:
        return block.features[:, AXES.index(found.residual)]
    each = [residual_views(problem, column)[found.residual] for column in block.features.transpose(2, 0, 1)]
    return np.stack(each, axis=1)


def _size(
    found: Dependence,
    estimate: Estimate,
    problem: Problem,
    contexts: Contexts,
    rows: np.ndarray,
    second: str | None,
) -> Size | None:
    """Size of a dependence from an estimator of weighted means over the rows that count."""
    of, values = _off(found), contexts[found.on][rows]
    if not is_direction(found.on):
        size = size_of(of, estimate, values, period=found.period_mm, place=found.place, shape=found.shape)
    else:
        size = size_of_side(of, estimate, values, None if second is None else contexts[second][rows])
    if size is None:
        return None
    return _named(size, found.on, second if size.kind == "varying" and second is not None else found.on, problem)


def _off(found: Dependence) -> str:
    """The part that is said to be off: the place of an unknown; of a set-up, a mount or a load an axis of the tool."""
    if found.acts_on == "mount":
        return f"mount {found.residual}"
    return found.residual if found.acts_on in (None, "set-up", "load") else found.acts_on


def _named(size: Size, on: str, along: str, problem: Problem) -> Size:
    """A size with its variables, their unit, and the word for joints."""
    return replace(size, on=on, along=along, unit=unit_of(problem, along), noun=problem.file.machine.noun)
