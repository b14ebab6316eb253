"""Effects that belong to one run, applied to a table with other runs: their clock and rows are those of that run."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.late import has_begun
from ptt.effects.sudden import Sudden
from ptt.run.view import View

Kind = TypeVar("Kind", bound=Effect)


@dataclass(frozen=True)
class RunPlace:
    """Where the run that an effect belongs to lies in a table.

    Attributes:
        runs: codes of its runs in their order; empty where the table does not hold it.
        time: the view's time at its first row, s.
        number: index of its first row.
    """

    runs: tuple[int, ...]
    time: float = 0.0
    number: float = 0.0

    def own(self, view: View) -> Tensor:
        """Rows of the run, (n,) bool."""
        return torch.isin(view.run, torch.tensor(self.runs, dtype=view.run.dtype))


def is_dated(effect: Effect) -> bool:
    """Whether an effect's values refer to the run that they were fitted on: its set-up, or a moment of it.

    Args:
        effect: the effect.
    """
    return effect.of_run or isinstance(effect, Sudden)


def has_date(effect: Effect, theta: Tensor) -> bool:
    """Whether an effect with these values depends on the run that they were fitted on.

    Args:
        effect: the effect.
        theta: all its parameters, flat; empty before a fit.
    """
    return is_dated(effect) or has_begun(effect, theta)


def unplaced(effect: Kind) -> type[Kind]:
    """Class of an effect without the place that `at_place` has given it.

    Args:
        effect: with or without one.
    """
    own: type[Kind] = getattr(type(effect), "_unplaced", type(effect))
    return own


def at_place(effect: Kind, place: RunPlace) -> Kind:
    """The same effect for a table in which its run is one of several, or is not there.

    An effect of the set-up is zero in the rows of other runs. A change of the machine at some moment is zero in runs
    before its own, and holds from the first row in runs after it; where the table lacks its own run, that run is taken
    to lie in the past. Growth holds in all runs, and what its body had too much when its own began in that one alone.

    Args:
        effect: it belongs to one run; a place that it has already is replaced.
        place: where that run lies.

    Returns:
        An effect of a subclass made here, with the same parameters.
    """
    own = unplaced(effect)
    values = {each.name: getattr(effect, each.name) for each in fields(effect)}
    effect = own(**values)
    parts: dict[str, Any] = {
        "_unplaced": own,
        "basis": lambda self, view, shape: _basis(own, self, view, shape, place),
        "__reduce__": lambda self: (at_place, (effect, place)),
    }
    if own.shift is not Effect.shift:
        parts["shift"] = lambda self, theta, view: (
            _weight(effect, view, place) * own.shift(self, theta, _local(effect, view, place))
        )
    if own.slope is not Effect.slope:
        parts["slope"] = lambda self, theta, view: (
            _weight(effect, view, place)[..., None] * own.slope(self, theta, _local(effect, view, place))
        )
    if not place.runs and is_dated(effect):
        parts["needs"] = lambda self, view: "the run that it was found on"
    made = type(own.__name__, (own,), parts)
    return made(**values)


def _basis(own: type[Effect], effect: Effect, view: View, shape: Mapping[str, Tensor], place: RunPlace) -> Tensor:
    return _weight(effect, view, place)[..., None] * own.basis(effect, _local(effect, view, place), shape)


def _weight(effect: Effect, view: View, place: RunPlace) -> Tensor:
    """(n, 1): 0 in rows of other runs for an effect of the set-up, else 1."""
    if not effect.of_run:
        return torch.ones(view.rows, 1, dtype=view.q.dtype)
    return place.own(view).to(view.q.dtype)[:, None]


def _local(effect: Effect, view: View, place: RunPlace) -> View:
    """The view with the clock of the effect's own run: -inf in rows before that run, +inf in rows after it."""
    own = place.own(view)
    behind = ~own if not place.runs else view.run > max(place.runs)
    endless = torch.where(behind, torch.inf, -torch.inf).to(view.q.dtype)
    if effect.of_run:
        endless = torch.zeros_like(endless)  # these rows get weight 0, and 0 times infinity is not a number
    return replace(
        view,
        time=torch.where(own, view.time - place.time, endless),
        number=torch.where(own, view.row_numbers - place.number, endless),
        beginnings=(0.0, *(each - place.time for each in view.beginnings if each > place.time)),
    )
