"""What happens at once in the middle of a run, and the moments that are worth trying."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter
from ptt.run.view import View

MOMENTS = 48
EDGE = 5  # readings before and after any moment
LEAST_READINGS = 20  # from which there may be one
AFTER = Parameter("after", "1", 1.0, "last moment before it: seconds, or rows where there is no clock", role="given")
ALWAYS = {"after": torch.tensor([-torch.inf], dtype=torch.float64)}  # the shape of what is there all along


@dataclass(frozen=True)
class Sudden(Effect):
    """Base of effects that are zero up to a moment and there from then on."""

    def needs(self, view: View) -> str | None:
        """Readings enough on both sides of any moment."""
        return None if len(self._told(view)) >= LEAST_READINGS else f"at least {LEAST_READINGS} rows with a reading"

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """Moments spread over the rows, and the end of each run, with at least a few readings on either side.

        A jump with fewer of them before it than values would say what it likes of all the others. Between runs somebody
        was at the machine: it was switched off, homed, or hit.
        """
        moments = self._told(view).sort().values[EDGE - 1 : -EDGE]
        chosen = _spread(moments)
        between = self._ends(view)
        between = between[(between >= chosen[0]) & (between <= chosen[-1])] if len(chosen) else between
        return tuple({"after": moment.reshape(1)} for moment in torch.cat([chosen, _spread(between)]).unique())

    def _ends(self, view: View) -> Tensor:
        """The clock of the last reading of each run, but that of the run that ends last."""
        clock, run = view.clock, view.run
        if view.read is not None:
            clock, run = clock[view.read], run[view.read]
        last = torch.full((int(run.max()) + 1 if len(run) else 0,), -1).scatter_reduce(
            0, run, torch.arange(len(run)), "amax"
        )
        return clock[last[last >= 0].sort().values[:-1]]

    def _told(self, view: View) -> Tensor:
        """The clock of the rows that have a reading."""
        return view.clock if view.read is None else view.clock[view.read]

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Every row between the trials two before and two after: rows that look gross can blur the first choice."""
        tried = torch.cat([trial["after"] for trial in self.search(view)])
        place = int(torch.argmin((tried - shape["after"]).abs()))
        low, high = tried[max(place - 2, 0)], tried[min(place + 2, len(tried) - 1)]
        moments = view.clock.unique()
        return tuple({"after": moment.reshape(1)} for moment in moments[(moments >= low) & (moments <= high)])

    def since(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Which rows come after the moment, (n,) as numbers 0 and 1."""
        return (view.clock > shape["after"]).to(view.q.dtype)

    def cause(self, theta: Tensor, view: View) -> str:
        """With the moment, by the table's own clock."""
        after = float(theta[-1])
        moment = f"{after + view.began:.0f} s" if "time" in view.varies else f"row {after + 1.0:.0f}"
        return f"{super().cause(theta, view)} after {moment}"


def _spread(moments: Tensor) -> Tensor:
    """As many of some moments as are worth trying, evenly spread over them."""
    return moments[torch.linspace(0, len(moments) - 1, min(MOMENTS, len(moments))).round().long()]
