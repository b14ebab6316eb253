"""Play operator and Dahl friction along the travel, as associative scans (log depth), with their derivatives.

A run may be cut into parts: what a joint remembers of the travel before a part enters it as waypoints (`Entry`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ptt.effects.layout import family
from ptt.run.direction import STANDSTILL
from ptt.run.turns import REACH, REACH_RAD, Entry, remember
from ptt.run.view import View

FORGOTTEN = 1e-20  # share of an earlier state below which it has no effect on a float64 between -1 and 1
SCANNED = 8192  # waypoints in a block of a scan: 200 kB for an array of three joints


def keep_reversals(view: View, lengths: Sequence[Tensor]) -> None:
    """Cache gradual reversals of the lengths that a search tries, keyed by the identity of these tensors."""
    view.kept.update({id(length): (length, gradual_reversal(view, length)) for length in lengths})


@dataclass(frozen=True)
class Waypoints:
    """The travel as m waypoints: for each row the joints' last turning points on the way to it, then the row itself.

    Attributes:
        q: joint values, (m, k); the waypoints of an entry come before those of its row.
        starts: waypoints at which a run, or what is remembered of it, begins, (m,) bool.
        direction: direction of arrival at each waypoint, (m, k), +1 or -1.
        rows: index of each row's own waypoint, (n,) int.
    """

    q: Tensor
    starts: Tensor
    direction: Tensor
    rows: Tensor


def waypoints(view: View) -> Waypoints:
    """The waypoints of a view of n rows, those that its entries remember included."""
    q = torch.stack([view.turning_point, view.q], dim=1).reshape(-1, view.joints)
    starts = torch.stack([view.starts, torch.zeros_like(view.starts)], dim=1).reshape(-1)
    direction = view.direction.repeat_interleave(2, dim=0)
    if not view.entries:
        return Waypoints(q, starts, direction, torch.arange(1, len(q), 2))
    cuts = [2 * entry.row for entry in view.entries]
    pieces = [torch.tensor_split(values, cuts) for values in (q, starts, direction)]
    ways = [entry.way for entry in view.entries]
    first = [torch.arange(len(way)) == 0 for way in ways]
    signs = [entry.direction.expand_as(way) for entry, way in zip(view.entries, ways, strict=True)]
    new = [torch.zeros(len(way), dtype=torch.bool) for way in ways]
    own = [torch.ones(len(piece), dtype=torch.bool) for piece in pieces[0]]
    waypoint, start, arrival = (_put_between(*pair) for pair in zip(pieces, (ways, first, signs), strict=True))
    return Waypoints(waypoint, start, arrival, torch.nonzero(_put_between(own, new))[1::2, 0])


def _put_between(pieces: Sequence[Tensor], new: Sequence[Tensor]) -> Tensor:
    """Pieces of a table with new rows between each two of them."""
    return torch.cat([pieces[0], *(part for pair in zip(new, pieces[1:], strict=True) for part in pair)])


def entry_after(view: View) -> Entry:
    """What the joints remember at the end of a view, for the first row of the next.

    Args:
        view: the rows before, with an entry of its own unless it begins with a run.

    Returns:
        The entry.
    """
    way = waypoints(view)
    start = int(torch.nonzero(way.starts)[-1])
    reach = REACH if family(view) == "three-ptt" else REACH_RAD
    return remember(way.q[start:], way.direction[start], reach)


@dataclass(frozen=True)
class TravelBefore:
    """The travel up to a row, as far as that row and later ones depend on it.

    Attributes:
        entry: what the joints remember on arrival at the row; None where a run starts with it.
        direction: direction of arrival of each joint at the row, (k,), +1 or -1.
        turned: last turning point of each joint on the way to the row, less its value there, (k,); zero where it did
            not turn.
    """

    entry: Entry | None
    direction: Tensor
    turned: Tensor


def continue_travel(view: View, before: TravelBefore) -> View:
    """Join rows from the middle of a travel, whose view by itself begins a run, to the travel before them.

    Args:
        view: n rows, seen without those before.
        before: the travel up to its first row.

    Returns:
        The view as a part of the whole travel.
    """
    turning_point = torch.cat([view.q[:1] + before.turned, view.turning_point[1:]])
    view = keep_direction(replace(view, turning_point=turning_point), before.direction)
    direction = torch.cat([before.direction[None], view.direction[1:]])
    if before.entry is None:
        return replace(view, direction=direction)
    starts = torch.cat([torch.zeros_like(view.starts[:1]), view.starts[1:]])
    return replace(view, direction=direction, starts=starts, entries=(replace(before.entry, row=0),))


def keep_direction(view: View, direction: Tensor) -> View:
    """Give joints that have not moved since the first row the direction (k,) of their last move before it."""
    stood = standing(view.q, view.turning_point)
    return replace(view, direction=torch.where(stood, direction, view.direction))


def standing(q: Tensor, turning_point: Tensor) -> Tensor:
    """Which joints have stood still since the first row, (n, k) bool.

    Args:
        q: joint values, (n, k).
        turning_point: last turning point on the way to each row, (n, k); q where there is none.
    """
    moved = (q.diff(dim=0, prepend=q[:1]).abs() > STANDSTILL) | ((q - turning_point).abs() > STANDSTILL)
    return moved.cumsum(dim=0) == 0


def play(view: View, gap: Tensor) -> Tensor:
    """Play operator (backlash) along the commanded travel.

    The slider follows the nut half the gap behind: y = min(max(y_before, q - gap/2), q + gap/2). The composition of
    such clamps is a clamp again, so the whole travel is one associative scan (Visintin, Differential Models of
    Hysteresis, 1994, for the operator).

    Args:
        view: n rows.
        gap: full gap of each joint, (k,) mm or rad, not negative.

    Returns:
        Shift y - q, (n, k), between -gap/2 and gap/2; a run begins with the gap taken up in its first row's direction.
    """
    way = waypoints(view)
    q = way.q
    half = gap / 2.0
    low, high = q - half, q + half
    first = q - half * way.direction
    reset = way.starts[:, None]
    low, high = torch.where(reset, first, low), torch.where(reset, first, high)
    step = 1
    # Once both bounds of every clamp have met, the value no longer depends on anything earlier.
    while step < len(q) and not bool((low.detach() == high.detach()).all()):
        before_low, before_high = low[:-step], high[:-step]
        late_low, late_high = low[step:], high[step:]
        low = torch.cat([low[:step], torch.minimum(torch.maximum(before_low, late_low), late_high)])
        high = torch.cat([high[:step], torch.minimum(torch.maximum(before_high, late_low), late_high)])
        step *= 2
    return (low - q)[way.rows]


def play_slope(view: View, gap: Tensor) -> Tensor:
    """Derivative of the play operator's shift by each joint's own gap.

    The scan of `play` with slopes carried along: a composed clamp ends at one of its bounds, and each bound moves by
    half the gap's change, down (`falls`) or up (`rises`).

    Args:
        view: n rows.
        gap: full gap of each joint, (k,) mm or rad, not negative.

    Returns:
        (n, k), between -1/2 and 1/2.
    """
    way = waypoints(view)
    q, half, reset = way.q, gap / 2.0, way.starts[:, None]
    first = q - half * way.direction
    low, high = torch.where(reset, first, q - half), torch.where(reset, first, q + half)
    falls = torch.where(reset, -0.5 * way.direction, torch.full_like(q, -0.5))
    rises = torch.where(reset, -0.5 * way.direction, torch.full_like(q, 0.5))
    step = 1
    while step < len(q) and not bool((low == high).all()):
        bounds = low[step:], falls[step:], high[step:], rises[step:]
        (lower, fall), (upper, rise) = (
            _clamped(value[:-step], slope[:-step], *bounds) for value, slope in ((low, falls), (high, rises))
        )
        low, falls = torch.cat([low[:step], lower]), torch.cat([falls[:step], fall])
        high, rises = torch.cat([high[:step], upper]), torch.cat([rises[:step], rise])
        step *= 2
    return falls[way.rows]


def _clamped(
    value: Tensor, slope: Tensor, low: Tensor, falls: Tensor, high: Tensor, rises: Tensor
) -> tuple[Tensor, Tensor]:
    """A value clamped to bounds, and its derivative: that of the bound where it is clamped."""
    value, slope = torch.maximum(value, low), torch.where(value < low, falls, slope)
    return torch.minimum(value, high), torch.where(value > high, rises, slope)


def gradual_reversal(view: View, length: Tensor) -> Tensor:
    """Normalised Dahl friction, which changes over gradually after a reversal.

    dF/dx = (sign(dx) - F) / l along the travel x (Dahl, 1968): after a reversal from F = -1 it runs to 1 as
    1 - 2 exp(-x/l). The recurrence from waypoint to waypoint is affine, so it is one associative scan.

    Args:
        view: n rows.
        length: travel constant l, () or (k,) mm or rad.

    Returns:
        F, (n, k), between -1 and 1; at the first row of a run equal to the direction of arrival.
    """
    known = view.kept.get(id(length))
    if known is not None and known[0] is length:
        return known[1]
    way, move, decay = _decays(view, length)
    reset, gain = way.starts[:, None], torch.sign(move) * (1.0 - decay)
    first = way.direction.to(gain.dtype)
    decay, gain = torch.where(reset, torch.zeros_like(decay), decay), torch.where(reset, first, gain)
    return _recurrence(decay, gain)[way.rows]


def gradual_slope(view: View, length: Tensor) -> Tensor:
    """Derivative of the normalised friction by the travel constant of each joint.

    F_i = s_i + d_i (F_(i-1) - s_i) for a move of length x_i and sign s_i, d_i = exp(-x_i/l); hence the affine
    recurrence F'_i = d_i F'_(i-1) + d_i x_i/l^2 (F_(i-1) - s_i), which is scanned the same way.

    Args:
        view: n rows.
        length: travel constants, (k,) mm or rad.

    Returns:
        dF/dl, (n, k) per mm or rad.
    """
    way, move, decay = _decays(view, length)
    reset, sign = way.starts[:, None], torch.sign(move)
    own = torch.where(reset, torch.zeros_like(decay), decay)
    friction = _recurrence(own, torch.where(reset, way.direction.to(own.dtype), sign * (1.0 - decay)))
    before = torch.cat([friction[:1], friction[:-1]])
    return _recurrence(own, own * move.abs() / length.square() * (before - sign))[way.rows]


def _decays(view: View, length: Tensor) -> tuple[Waypoints, Tensor, Tensor]:
    """Waypoints, the moves to each of them, (m, k) mm or rad, and the decay exp(-|move|/l) of each, (m, k)."""
    way = waypoints(view)
    move = torch.diff(way.q, dim=0, prepend=way.q[:1])
    return way, move, torch.where(move == 0.0, torch.ones_like(move), torch.exp(-move.abs() / length))


def _recurrence(decay: Tensor, gain: Tensor) -> Tensor:
    """Solve x_i = gain_i + decay_i x_(i-1), (m, k), by a scan of each block that continues from the block before.

    One scan of the whole would make log2 m passes over arrays that fit into no cache.
    """
    blocks = list(zip(decay.split(SCANNED), gain.split(SCANNED), strict=True))
    found = [_scanned(*blocks[0])]
    for own, given in blocks[1:]:
        carried = given[:1] + own[:1] * found[-1][-1:]
        found.append(_scanned(torch.cat([torch.zeros_like(own[:1]), own[1:]]), torch.cat([carried, given[1:]])))
    return found[0] if len(found) == 1 else torch.cat(found)


def _scanned(decay: Tensor, gain: Tensor) -> Tensor:
    """The recurrence of `_recurrence` over one block, by doubling steps (Hillis-Steele scan)."""
    step = 1
    while step < len(gain) and float(decay.detach().max()) > FORGOTTEN:
        gain = torch.cat([gain[:step], gain[step:] + decay[step:] * gain[:-step]])
        decay = torch.cat([decay[:step], decay[step:] * decay[:-step]])
        step *= 2
    return gain
