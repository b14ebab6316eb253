"""Effects of one run, seen beside other runs: the clock is that run's, and so are the rows."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.sudden import Sudden
from ptt.run.view import View

Kind = TypeVar("Kind", bound=Effect)


@dataclass(frozen=True)
class RunPlace:
    """Where the run that an effect belongs to lies in a table.

    Attributes:
        runs: codes of the runs in their order; none where the table does not hold it.
        time: seconds at its first row.
        number: number of its first row.
    """

    runs: tuple[int, ...]
    time: float = 0.0
    number: float = 0.0

    def own(self, view: View) -> Tensor:
        """Rows of the run, (n,) bool."""
        return torch.isin(view.run, torch.tensor(self.runs, dtype=view.run.dtype))


def is_dated(effect: Effect) -> bool:
    """Tell whether an effect's values mean something for the run alone that they were fitted on.

    Args:
        effect: the effect.

    Returns:
        True for what a set-up did, and for what happened at some moment.
    """
    return effect.of_run or isinstance(effect, Sudden)


def at_place(effect: Kind, place: RunPlace) -> Kind:
    """The same effect as rows of other runs see it.

    What a set-up did is nothing there. What happened to the machine at some moment stays: runs before know nothing of
    it, runs behind, and those of which nothing tells when they were, have it from their first row on.

    Args:
        effect: of one run.
        place: where that run lies.

    Returns:
        An effect of the same class.
    """
    own = type(effect)
    parts: dict[str, Any] = {
        "basis": lambda self, view, shape: _basis(own, self, view, shape, place),
        "__reduce__": lambda self: (at_place, (effect, place)),
    }
    if own.shift is not Effect.shift:
        parts["shift"] = lambda self, theta, view: (
            _share(effect, view, place) * own.shift(self, theta, _local(effect, view, place))
        )
    if own.slope is not Effect.slope:
        parts["slope"] = lambda self, theta, view: (
            _share(effect, view, place)[..., None] * own.slope(self, theta, _local(effect, view, place))
        )
    if not place.runs:
        parts["needs"] = lambda self, view: "the run that it was found on"
    made = type(own.__name__, (own,), parts)
    return made(**{each.name: getattr(effect, each.name) for each in fields(effect)})


def _basis(own: type[Effect], effect: Effect, view: View, shape: Mapping[str, Tensor], place: RunPlace) -> Tensor:
    return _share(effect, view, place)[..., None] * own.basis(effect, _local(effect, view, place), shape)


def _share(effect: Effect, view: View, place: RunPlace) -> Tensor:
    """(n, 1), 0 in rows that a set-up of another run does not touch."""
    if not effect.of_run:
        return torch.ones(view.rows, 1, dtype=view.q.dtype)
    return place.own(view).to(view.q.dtype)[:, None]


def _local(effect: Effect, view: View, place: RunPlace) -> View:
    """The view by the clock of the run: long before its first row in runs before, long after in runs behind."""
    own = place.own(view)
    behind = ~own if not place.runs else view.run > max(place.runs)
    endless = torch.where(behind, torch.inf, -torch.inf).to(view.q.dtype)
    if effect.of_run:
        endless = torch.zeros_like(endless)  # those rows count for nothing, and nothing may be infinite there
    return replace(
        view,
        time=torch.where(own, view.time - place.time, endless),
        number=torch.where(own, view.places - place.number, endless),
    )
