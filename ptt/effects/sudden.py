"""Effects that set in at one moment (a step in time), and the moments that a search tries."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter
from ptt.run.view import View

MOMENTS = 48  # tried at first, spread over the run; `refine` then tries every row between
EDGE = 5  # fewest readings before and after a moment
LEAST_READINGS = 20  # of a run in which such an effect is looked for
AFTER = Parameter("after", "1", 1.0, "last moment before it: seconds, or rows where there is no clock", role="given")
ALWAYS = {"after": torch.tensor([-torch.inf], dtype=torch.float64)}  # the shape of what is there all along


def dated(readings: int) -> slice:
    """Of readings in the order of time, those after which there may be a moment: `EDGE` stand on either side."""
    return slice(EDGE - 1, max(readings - EDGE, 0))


@dataclass(frozen=True)
class Sudden(Effect):
    """Base of effects that are zero up to a moment and in force from then on."""

    def needs(self, view: View) -> str | None:
        """Enough readings on both sides of a moment."""
        return (
            None
            if len(self._clock_of_readings(view)) >= LEAST_READINGS
            else f"at least {LEAST_READINGS} rows with a reading"
        )

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """Moments spread over the readings, and the end of each run, with at least `EDGE` readings on either side.

        A jump with fewer readings on one side than it has values would fit these exactly, and move all the others at
        will. Between runs somebody was at the machine: it may have been switched off, homed, or hit.
        """
        moments = self._clock_of_readings(view).sort().values
        chosen = _thinned(moments[dated(len(moments))])
        between = self._ends_of_runs(view)
        between = between[(between >= chosen[0]) & (between <= chosen[-1])] if len(chosen) else between
        return tuple({"after": moment.reshape(1)} for moment in torch.cat([chosen, _thinned(between)]).unique())

    def _ends_of_runs(self, view: View) -> Tensor:
        """Clock of the last reading of each run except the run that ends last."""
        clock, run = view.clock, view.run
        if view.read is not None:
            clock, run = clock[view.read], run[view.read]
        last = torch.full((int(run.max()) + 1 if len(run) else 0,), -1).scatter_reduce(
            0, run, torch.arange(len(run)), "amax"
        )
        return clock[last[last >= 0].sort().values[:-1]]

    def _clock_of_readings(self, view: View) -> Tensor:
        """Clock of the rows that have a reading, (m,)."""
        return view.clock if view.read is None else view.clock[view.read]

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Every row from two trials before to two after: gross errors can make the first choice miss by one."""
        tried = torch.cat([trial["after"] for trial in self.search(view)])
        place = int(torch.argmin((tried - shape["after"]).abs()))
        low, high = tried[max(place - 2, 0)], tried[min(place + 2, len(tried) - 1)]
        moments = view.clock.unique()
        return tuple({"after": moment.reshape(1)} for moment in moments[(moments >= low) & (moments <= high)])

    def since(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """1 in rows after the moment, 0 up to it, (n,)."""
        return (view.clock > shape["after"]).to(view.q.dtype)

    def cause(self, theta: Tensor, view: View) -> str:
        """With the moment: seconds by the table's own clock, or the number of the row."""
        after = float(theta[-1])
        moment = f"{after + view.began:.0f} s" if "time" in view.varies else f"row {after + 1.0:.0f}"
        return f"{super().cause(theta, view)} after {moment}"


def _thinned(moments: Tensor) -> Tensor:
    """At most `MOMENTS` of sorted moments, evenly spread over them."""
    return moments[torch.linspace(0, len(moments) - 1, min(MOMENTS, len(moments))).round().long()]
