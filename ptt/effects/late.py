"""Growth that follows the recorded temperature late, as a screw or a frame does that a thermometer is ahead of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.layout import shape_of
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import Phrase, ValuePhrase
from ptt.effects.refinement import between_trials
from ptt.run.behind import LAGS_S
from ptt.run.view import View

MINUTE = 60.0  # s; and minutes in an hour
MOST_MINUTES = 90.0  # beyond these, hours are said
# Nats against a growth that is late: what is told of a time that readings hardly show would be chance. A fit asks for
# as much of any shape but the first.
LATE_NATS = 5.0
START_SCATTER = 3.0  # K: how much warmer or cooler than the air bodies usually are as a run begins
# K by which a body may be warmer or cooler as the run begins: each four times the one before, as a fit finds its way
# from half and from twice the true one. In a steady room, too, a machine may be cold from the night.
STARTS = (0.5, -0.5, 2.0, -2.0, 8.0, -8.0)

START = Parameter(
    "start", "K", START_SCATTER, "how much warmer than the recorded temperature the body is at the first row, where "
    "the clock begins anew, and after a pause of an hour",
    count=4, role="searched", held=True, at_beginnings=True, default=0.0,
)  # fmt: skip
"""The parameter before the last one of growth; it belongs to the run. At further beginnings a body is at rest."""

BEGAN = Phrase(
    "start",
    "began the run {what} warmer than the recorded temperature",
    "began the run {what} cooler than the recorded temperature",
    "what grows",
)
"""Words of it."""

LATE = Parameter(
    "late", "s", LAGS_S[2], "time constant by which it follows the temperature late, searched from 5 min to 5 h",
    lower=0.0, upper=LAGS_S[-1], role="searched", default=0.0,
)  # fmt: skip
"""The last parameter of growth."""


@dataclass(frozen=True)
class Growth(Effect):
    """Base of what grows with temperature, at once or late; its last parameters are `START` and `LATE`."""

    requires: ClassVar[tuple[str, ...]] = ("temperature",)
    follows_clock: ClassVar[bool] = True

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """At once, and late by each of `LAGS_S` where a clock and a temperature that varies can show it.

        A late body is at the recorded temperature when the run begins, or by one of `STARTS` away from it.
        """
        if view.behind is None:
            return (_shape(0.0, 0.0, view),)
        late = (_shape(late, start, view) for start, late in product((0.0, *STARTS), LAGS_S))
        return (_shape(0.0, 0.0, view), *late)

    def odds_of_shape(self, shape: Mapping[str, Tensor]) -> float:
        """Against growth that is late, more the less its body was at rest; they cover the choice of a trial as well."""
        away = shape["start"] / START_SCATTER
        return LATE_NATS + 0.5 * float(away.square().sum()) if float(shape["late"]) > 0.0 else 0.0

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Times between its neighbours, where it is late."""
        return (shape,) if float(shape["late"]) <= 0.0 else between_trials(self.search(view)[1:], shape, "late")

    def usual_trial(self, view: View) -> Mapping[str, Tensor]:
        """At once."""
        return self.search(view)[0]

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """As of every effect; how warm its body began ranks by kelvin, to be said beside six values of screws."""
        parts = super().say(theta, std, view)
        return tuple(replace(part, worth=part.size) if part.unit == START.unit else part for part in parts)

    def cause(self, theta: Tensor, view: View) -> str:
        """With how late it is."""
        minutes = float(theta[-1]) / MINUTE
        if minutes <= 0.0:
            return super().cause(theta, view)
        told = f"{minutes:.2g} min" if minutes < MOST_MINUTES else f"{minutes / MINUTE:.2g} h"
        return f"{super().cause(theta, view)}, about {told} behind the temperature"


def _shape(late: float, start: float, view: View) -> Mapping[str, Tensor]:
    """A shape with the same start at all beginnings."""
    starts = torch.zeros(START.count, dtype=torch.float64)
    starts[: len(view.beginnings)] = start
    return {"start": starts, "late": torch.tensor([late], dtype=torch.float64)}


def late_warmth(view: View, start: Tensor, late: Tensor) -> Tensor:
    """Temperature of a body above the reference, (n,) K.

    Source: as `ptt.run.behind.lags_behind`; what a body has too much at a beginning dies away, start exp(-t / tau).

    Args:
        view: n rows.
        start: how much warmer than recorded it is at the first of `View.beginnings`, (b,) K.
        late: its time constant, (1,) s; between those of `LAGS_S` the lag is interpolated over its logarithm. Without a
            clock, or at a steady temperature, no body is late.
    """
    if view.behind is None or float(late.detach()) <= 0.0:
        return view.warmth
    begin = torch.tensor(view.beginnings, dtype=torch.float64)
    last = torch.searchsorted(begin, view.time, right=True) - 1  # its number, of each row
    # Rows of another run have endless times.
    own = torch.isfinite(view.time) & (last >= 0) & (last < len(start))
    last = torch.where(own, last, 0)
    since = torch.where(own, view.time - begin[last], 0.0)
    return view.warmth + view.behind @ _shares(late) + start[last] * torch.exp(-since / late) * own


def _shares(late: Tensor) -> Tensor:
    """Share of the lag of each of `LAGS_S`, (m,): cubic Hermite pieces with Catmull and Rom's slopes.

    Below the least time a lag is in proportion to it.
    """
    least, last = LAGS_S[0], len(LAGS_S) - 1
    shares = [late.new_zeros(()) for _ in LAGS_S]
    if float(late.detach()) <= least:
        shares[0] = late[0] / least
        return torch.stack(shares)
    place = torch.log2(late[0] / least)
    left = min(int(place.detach()), last - 1)
    u = place - left
    heights = {left: 2.0 * u**3 - 3.0 * u**2 + 1.0, left + 1: 3.0 * u**2 - 2.0 * u**3}
    slopes = {left: u**3 - 2.0 * u**2 + u, left + 1: u**3 - u**2}
    for at, weight in heights.items():
        shares[at] = shares[at] + weight
    for at, weight in slopes.items():
        low, high = max(at - 1, 0), min(at + 1, last)
        shares[high] = shares[high] + weight / (high - low)
        shares[low] = shares[low] - weight / (high - low)
    return torch.stack(shares)


def warmth_of(effect: Growth, theta: Tensor, view: View) -> Tensor:
    """Temperature above the reference of the body that grows, (n,) K; theta: all its parameters, flat."""
    shape = shape_of(effect, theta, view.joints)
    return late_warmth(view, shape["start"], shape["late"])


def is_late(effect: Effect, theta: Tensor) -> bool:
    """Whether an effect with these parameters depends on the temperatures of the rows before."""
    return isinstance(effect, Growth) and len(theta) > 0 and float(theta[-1]) > 0.0


def has_begun(effect: Effect, theta: Tensor) -> bool:
    """Whether an effect with these parameters says how warm a body was when one run began."""
    return is_late(effect, theta) and bool((starts_of(theta) != 0.0).any())


def starts_of(values: Tensor) -> Tensor:
    """How warm a body began, (b,) K; values: all parameters of growth, or their standard errors, flat."""
    return values[-1 - START.count : -1]
