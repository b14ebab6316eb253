"""Shared by effects with curves along a joint's travel: their range, their extremes in words."""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.phrases import Phrase, ValuePhrase, said
from ptt.effects.shapes import smooth_shapes, straight_shapes, wave_shapes
from ptt.run.view import View

PLACES = 201  # points of a curve among which its extremes are looked for


def covered_range(view: View) -> dict[str, Tensor]:
    """Range of each joint that the rows cover: the abscissa scale that a curve is saved with.

    Args:
        view: n rows.

    Returns:
        'from' and 'to', each (k,).
    """
    low, high = view.covered
    still = high - low < 1e-6
    return {"from": low, "to": torch.where(still, low + 1.0, high)}


def curve_extremes(
    effect: Effect, theta: Tensor, std: Tensor, curves: Sequence[tuple[Phrase, tuple[str, ...], slice]]
) -> tuple[ValuePhrase, ...]:
    """Maximum and minimum of curves along each joint's travel, in words.

    Args:
        effect: has 'straight', 'from' and 'to'.
        theta: all its parameters, flat.
        std: their standard errors, NaN where none is known.
        curves: for each curve its words, the stems of its bending modes and of its finer splines (if any), and which
            of a joint's values of 'straight' are its slope and level.

    Returns:
        The maximum of each curve where it is positive, and the minimum where it is negative.
    """
    names = [parameter.stem for parameter in effect.parameters]
    joints = len(theta) // sum(parameter.count for parameter in effect.parameters)
    counts = [parameter.count * joints for parameter in effect.parameters]
    values, errors = (dict(zip(names, part.split(counts), strict=True)) for part in (theta, std.nan_to_num()))
    place = torch.linspace(0.0, 1.0, PLACES, dtype=torch.float64)
    parts = []
    for phrase, stems, line in curves:
        own = next(parameter for parameter in effect.parameters if parameter.stem == stems[0])
        kinds = (smooth_shapes, wave_shapes)[: len(stems)]
        every = [(stem, slice(None)) for stem in stems]
        shapes = torch.cat([*(kind(place) for kind in kinds), straight_shapes(place)], dim=1)
        for joint in range(joints):
            size, error = (
                torch.cat([part[stem].reshape(joints, -1)[joint, some] for stem, some in (*every, ("straight", line))])
                for part in (values, errors)
            )
            curve, spread = shapes @ size, (shapes.square() @ error.square()).sqrt()
            low, high = float(values["from"][joint]), float(values["to"][joint])
            for at, right in ((int(curve.argmax()), 1.0), (int(curve.argmin()), -1.0)):
                if right * float(curve[at]) > 0.0:
                    where = f" near b = {low + float(place[at]) * (high - low):z.0f} mm"
                    here = replace(phrase, plus=phrase.plus + where, minus=phrase.minus + where)
                    parts.append(said(here, float(curve[at]), float(spread[at]), own.unit, own.usual, joint + 1))
    return tuple(parts)
