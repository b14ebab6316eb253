"""Extrapolation of a model's curves beyond the joint values of its own run: an uncertainty, not a change."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from ptt.again.prior import Prior
from ptt.effects.layout import shape_of
from ptt.effects.shapes import SHAPES, smooth_shapes
from ptt.fitting.linear import LinearPoint, tried_sizes
from ptt.model.model import Term
from ptt.run.problem import Problem

BENDS = 4  # shapes of a curve beyond its end; the fifth has a twentieth of the amplitude of the first
NEAR = 0.01  # share of a curve's range by which a run may exceed it: there the slope makes less than a micrometre


@dataclass(frozen=True)
class CurveEnd:
    """One end of the curve of one joint, beyond which a run has readings.

    Attributes:
        term: the effect with the curve.
        joint: its index, from 0.
        upper: whether it is the upper end.
        at: joint value at which the curve ends, mm.
        furthest: the run's joint value that is furthest beyond it, mm.
        range: length of the curve, mm.
    """

    term: Term
    joint: int
    upper: bool
    at: float
    furthest: float
    range: float


def exceeded_ends(prior: Prior, problem: Problem) -> Iterator[CurveEnd]:
    """Ends of the model's curves beyond which a run has readings.

    Args:
        prior: the solved model.
        problem: the run.

    Yields:
        Each end.
    """
    q = problem.view.q[torch.as_tensor(problem.used)]
    for term in prior.layout.terms:
        shape = shape_of(term.effect, term.theta, problem.view.joints)
        if term.effect.key in prior.cured or not {"from", "to"} <= shape.keys():
            continue
        for joint in range(q.shape[1]):
            low, high = float(shape["from"][joint]), float(shape["to"][joint])
            least, most = float(q[:, joint].min()), float(q[:, joint].max())
            if most > high + NEAR * (high - low):
                yield CurveEnd(term, joint, True, high, most, high - low)
            if least < low - NEAR * (high - low):
                yield CurveEnd(term, joint, False, low, least, high - low)


def extrapolation_columns(prior: Prior, at: LinearPoint, problem: Problem) -> np.ndarray:
    """Shifts of the readings by curves beyond their ends, each column scaled to one prior standard deviation.

    A curve is an integrated random walk along the axis: beyond its end the slope stays uncertain, and the departure
    from it grows as the length to the power 3/2 (as in `screw-error-map`).

    Args:
        prior: the solved model.
        at: where the model is linearised.
        problem: the run, n rows.

    Returns:
        (n, 3, c) whitened; c = 0 where the run stays within all curves.
    """
    parts = [_columns_beyond_end(end, at, problem) for end in exceeded_ends(prior, problem)]
    return np.concatenate([np.zeros((problem.table.rows, 3, 0)), *parts], axis=2)


def _columns_beyond_end(end: CurveEnd, at: LinearPoint, problem: Problem) -> np.ndarray:
    """Columns of the curves of one joint beyond one of their ends, (n, 3, c) whitened."""
    effect, joints = end.term.effect, problem.view.joints
    shape = {stem: value.clone() for stem, value in shape_of(effect, end.term.theta, joints).items()}
    near, far = ("from", "to") if end.upper else ("to", "from")
    shape[near][end.joint], shape[far][end.joint] = end.at, end.furthest
    sizes, share = tried_sizes(effect, problem), abs(end.furthest - end.at) / end.range
    columns = at.columns(effect, shape) / sizes
    fixed = smooth_shapes(torch.tensor(0.0 if end.upper else 1.0)).numpy()[:BENDS]  # values of the shapes at the end
    parts = list[np.ndarray]()
    for bends, line in _curves(end, joints):
        slope, level = columns[:, :, [line]], columns[:, :, [line + 1]]
        own = end.term.theta[bends].abs().numpy() / sizes[bends]
        usual = sizes[bends.start] * max(1.0, float(own.max()))
        parts.append(usual * share**1.5 * (columns[:, :, bends][:, :, :BENDS] - fixed * level))
        parts.append(2.0 * usual * share * (slope + level if end.upper else slope - level))
    return np.concatenate(parts, axis=2)


def _curves(end: CurveEnd, joints: int) -> Iterator[tuple[slice, int]]:
    """Indices of each curve of a joint in the effect's parameters: its shapes, and its slope, followed by its level."""
    starts = np.cumsum([0, *(parameter.size(joints) for parameter in end.term.effect.parameters)])
    rows = list(zip(end.term.effect.parameters, starts.tolist(), strict=False))
    line, pairs = next((start, p.count // 2) for p, start in rows if p.held)
    curves = [start for p, start in rows if p.count == SHAPES]
    for number, start in enumerate(curves):
        first = start + end.joint * SHAPES
        yield slice(first, first + SHAPES), line + 2 * (end.joint * pairs + number)


def extrapolation_notes(prior: Prior, problem: Problem) -> tuple[str, ...]:
    """A line for each effect whose curves a run leaves.

    Args:
        prior: the solved model.
        problem: the run.

    Returns:
        The lines.
    """
    places: dict[str, list[str]] = {}
    for end in exceeded_ends(prior, problem):
        way = "up" if end.upper else "down"
        words = f"slider {end.joint + 1} goes {way} to {end.furthest:.0f} mm ({end.at:.0f} when the model was made)"
        places.setdefault(end.term.effect.key, []).append(words)
    return tuple(
        f"{', '.join(words)}: how {key} continues beyond that is taken as unknown" for key, words in places.items()
    )
