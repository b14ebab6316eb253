"""Scans over the travel for effects with memory, in log depth: play and gradual reversal, with state handed on."""

import torch
from torch import Tensor

from ptt.view import View


def waypoints(view: View) -> tuple[Tensor, Tensor]:
    """The travel as a sequence of turns and rows.

    Args:
        view: n rows.

    Returns:
        Joint values, (2n, k): the last turn before a row, then the row; and (2n,) bool, first waypoints of runs.
    """
    q = torch.stack([view.turning, view.q], dim=1).reshape(-1, view.joints)
    starts = torch.stack([view.starts, torch.zeros_like(view.starts)], dim=1).reshape(-1)
    return q, starts


def play(view: View, gap: Tensor, entry: Tensor | None = None) -> Tensor:
    """Play operator along the commanded travel.

    The slider follows the nut at half the gap behind: y = min(max(y_before, q - gap/2), q + gap/2). Composing such
    clamps gives a clamp again, so the whole travel is one associative scan (Visintin, Differential Models of
    Hysteresis, 1994, for the operator).

    Args:
        view: n rows.
        gap: full gap of each joint, (k,) mm or rad, not negative.
        entry: where the slider was before the first row, (k,); None: the first row of a run is taken to arrive as
            the second moves.

    Returns:
        Shift y - q, (n, k), between -gap/2 and gap/2.
    """
    q, starts = waypoints(view)
    half = gap / 2.0
    low, high = q - half, q + half
    first = q - half * view.direction.repeat_interleave(2, dim=0)
    reset = starts[:, None]
    low, high = torch.where(reset, first, low), torch.where(reset, first, high)
    if entry is not None:
        known = torch.minimum(torch.maximum(entry, q[0] - half), q[0] + half)
        low, high = torch.cat([known[None], low[1:]]), torch.cat([known[None], high[1:]])
    step = 1
    while step < len(q):
        before_low, before_high = low[:-step], high[:-step]
        late_low, late_high = low[step:], high[step:]
        low = torch.cat([low[:step], torch.minimum(torch.maximum(before_low, late_low), late_high)])
        high = torch.cat([high[:step], torch.minimum(torch.maximum(before_high, late_low), late_high)])
        step *= 2
    return (low - q)[1::2]


def gradual_reversal(view: View, length: Tensor, entry: Tensor | None = None, place: Tensor | None = None) -> Tensor:
    """Normalised friction that turns over gradually after a reversal.

    dF/dx = (sign(x) - F) / l along the travel (Dahl, 1968): after a long move against the former one F runs
    from -1 to 1 as 1 - 2 exp(-x/l). The recurrence is affine, so it is one associative scan.

    Args:
        view: n rows.
        length: travel constant l, () or (k,) mm or rad.
        entry: F before the first row, (k,); None: fully turned in the direction of arrival.
        place: joint values at which `entry` held, (k,); None: those of the first waypoint.

    Returns:
        F, (n, k), between -1 and 1.
    """
    q, starts = waypoints(view)
    move = torch.diff(q, dim=0, prepend=q[:1])
    sign = torch.sign(move)
    decay = torch.where(move == 0.0, torch.ones_like(move), torch.exp(-move.abs() / length))
    gain = sign * (1.0 - decay)
    reset = starts[:, None]
    first = view.direction.repeat_interleave(2, dim=0).to(gain.dtype)
    decay, gain = torch.where(reset, torch.zeros_like(decay), decay), torch.where(reset, first, gain)
    if entry is not None:
        way = torch.zeros_like(q[0]) if place is None else q[0] - place
        kept = torch.exp(-way.abs() / length)
        gain = torch.cat([(entry * kept + torch.sign(way) * (1.0 - kept))[None], gain[1:]])
    step = 1
    while step < len(q):
        gain = torch.cat([gain[:step], gain[step:] + decay[step:] * gain[:-step]])
        decay = torch.cat([decay[:step], decay[step:] * decay[:-step]])
        step *= 2
    return gain[1::2]
