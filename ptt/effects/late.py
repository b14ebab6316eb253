"""Growth that follows the recorded temperature late, as a screw or a frame does that a thermometer is ahead of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.parameter import Parameter
from ptt.effects.refinement import between_trials
from ptt.run.behind import LAGS_S
from ptt.run.view import View

MINUTE = 60.0  # s; and minutes in an hour
MOST_MINUTES = 90.0  # beyond these, hours are said
# Nats against a growth that is late: what is told of a time that readings hardly show would be chance. A fit asks for
# as much of any shape but the first.
LATE_NATS = 5.0

LATE = Parameter(
    "late", "s", LAGS_S[2], "time constant by which it follows the temperature late, searched from 5 min to 5 h",
    lower=0.0, upper=LAGS_S[-1], role="given", default=0.0,
)  # fmt: skip
"""The parameter that growth has beside its sizes, last of all."""


@dataclass(frozen=True)
class Growth(Effect):
    """Base of what grows with temperature, at once or late; how late is its last parameter, `LATE`."""

    requires: ClassVar[tuple[str, ...]] = ("temperature",)
    follows_clock: ClassVar[bool] = True

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """At once, and late by each of `LAGS_S` where a clock and a temperature that varies can show it."""
        late = LAGS_S if view.behind is not None else ()
        return tuple({"late": torch.tensor([value], dtype=torch.float64)} for value in (0.0, *late))

    def odds_of_shape(self, shape: Mapping[str, Tensor]) -> float:
        """Against growth that is late."""
        return LATE_NATS if float(shape["late"]) > 0.0 else 0.0

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Times between its neighbours, where it is late."""
        return (shape,) if float(shape["late"]) <= 0.0 else between_trials(self.search(view)[1:], shape, "late")

    def usual_trial(self, view: View) -> Mapping[str, Tensor]:
        """At once."""
        return self.search(view)[0]

    def cause(self, theta: Tensor, view: View) -> str:
        """With how late it is."""
        minutes = float(theta[-1]) / MINUTE
        if minutes <= 0.0:
            return super().cause(theta, view)
        told = f"{minutes:.2g} min" if minutes < MOST_MINUTES else f"{minutes / MINUTE:.2g} h"
        return f"{super().cause(theta, view)}, about {told} behind the temperature"


def late_warmth(view: View, late: Tensor) -> Tensor:
    """Temperature of a body above the reference, (n,) K.

    Args:
        view: n rows.
        late: its time constant, (1,) s; between two of `LAGS_S` the share of each goes by its logarithm. Without a
            clock, or at a steady temperature, no body is late.
    """
    constant = float(late)
    if view.behind is None or constant <= 0.0:
        return view.warmth
    place = torch.tensor(LAGS_S, dtype=torch.float64).log2() - torch.tensor(constant, dtype=torch.float64).log2()
    share = (1.0 - place.abs()).clamp(min=0.0)
    if constant < LAGS_S[0]:  # next to none of the least
        share[0] = constant / LAGS_S[0]
    return view.warmth + view.behind @ share


def is_late(effect: Effect, theta: Tensor) -> bool:
    """Whether an effect with these parameters depends on the temperatures of the rows before."""
    return isinstance(effect, Growth) and float(theta[-1]) > 0.0
