"""Prices: what each effect of a model is worth, and what others in its place would be, to first order."""

from dataclasses import dataclass

from ptt.diagnosis.screen import Finding, effective_trials, toll
from ptt.diagnosis.walker import State, hold
from ptt.sums import gain, project

USELESS = 10.0  # chi-squared that an effect which adds nothing seen is charged, so that it goes


@dataclass(frozen=True)
class Swap:
    """A candidate in the place of an effect.

    Attributes:
        finding: the candidate.
        change: of the model's cost, to first order.
        toll: the part of it that tolls are.
    """

    finding: Finding
    change: float
    toll: float


@dataclass(frozen=True)
class Price:
    """One effect of a model.

    Attributes:
        worth: sum of squares, in noise units, that only it takes off.
        toll: what chance would take off.
        swaps: candidates in its place, cheapest first.
    """

    worth: float
    toll: float
    swaps: tuple["Swap", ...]

    @property
    def removal(self) -> float:
        """Change of the model's cost without it."""
        return self.worth - self.toll


def price(state: State, key: str) -> Price:
    """Price one effect of a state's model.

    Args:
        state: linearised, with its candidates.
        key: the effect.

    Returns:
        The price.
    """
    rest = [other for other in state.design.present if other != key]
    projected = project(*state.design.sums.total[:3], hold(state, rest))
    worth, own = _charge(state, *gain(projected, state.design.present[key]), 1.0)
    swaps = []
    for finding in state.screened.findings:
        if finding.trial.effect.name == key.partition("[")[0]:
            continue
        took = gain(projected, finding.trial.columns)
        gained, charged = _charge(state, *took, effective_trials(finding.trial))
        swaps.append(Swap(finding, worth - gained + charged - own, charged - own))
    return Price(worth, own, tuple(sorted(swaps, key=lambda swap: swap.change)))


def _charge(state: State, took: float, seen: int, trials: float) -> tuple[float, float]:
    """Worth in noise units, and toll, of what columns take off."""
    if not seen:
        return 0.0, USELESS
    return took / state.screened.spread, toll(seen, state.screened.freedom, state.screened.candidates * trials)


def in_order_of_worth(state: State, given: frozenset[str]) -> list[str]:
    """Effects of a model in the order in which a path would have added them.

    A map of which every value is held near zero, as a joint's error over its turn, imitates a part of everything and is
    told after the effects that have causes of their own.

    Args:
        state: the end of the path.
        given: effects that were there before.

    Returns:
        Keys.
    """
    chosen = [key for key in state.design.present if key in given]
    rest = [key for key in state.design.present if key not in given]
    layout = state.fitted.layout
    own = [layout.held[layout.owner == index] for index in range(len(layout.terms))]
    maps = {term.effect.key for term, held in zip(layout.terms, own, strict=True) if len(held) and held.all()}
    order: list[str] = []
    while rest:
        projected = project(*state.design.sums.total[:3], hold(state, [*chosen, *order]))
        charges = {key: _charge(state, *gain(projected, state.design.present[key]), 1.0) for key in rest}
        best = max([key for key in rest if key not in maps] or rest, key=lambda key: charges[key][0] - charges[key][1])
        order.append(best)
        rest.remove(best)
    return order
