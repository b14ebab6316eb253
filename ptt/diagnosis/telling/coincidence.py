"""What else changes at the moment of a sudden effect, so that no reading tells which of both it depends on."""

import numpy as np

from ptt.dependence.contexts import path_views, unit_of
from ptt.dependence.said import middle
from ptt.effects.sudden import Sudden
from ptt.model.model import Term
from ptt.run.problem import Problem

# Conditions looked at beside a user's own columns; position is left out, as it turns back again and again
CONDITIONS = ("payload", "temperature", "feed")
AIR_SWING = 0.1  # K that room temperature goes up and down by itself, so rows near the moment may lie on the other side
LEAST_SWINGS = 10.0  # swings that a variable has to cover before it has two sides


def coincidences(term: Term, problem: Problem) -> list[str]:
    """Say between which runs a sudden effect happens, and which conditions pass a value then and at no other time.

    Args:
        term: an effect at its values.
        problem: n rows.

    Returns:
        One sentence for each; none for other effects.
    """
    if not isinstance(term.effect, Sudden):
        return []
    shape = {"after": term.theta[-1:]}
    after = term.effect.since(problem.view, shape).numpy()[problem.used] > 0.5
    views = path_views(problem)
    found = _between_runs(after, problem)
    for name in (*CONDITIONS, *problem.table.watched):
        slack = AIR_SWING if name == "temperature" else 0.0
        place = parting(after, views[name][problem.used], slack) if name in views else None
        if place is not None:
            what, where = f"{name[:1].upper()}{name[1:]}", middle(*place, unit_of(problem, name))
            alike = "a step that depends on it would look the same until that value is passed again"
            found.append(f"{what} passes {where} at that moment and at no other: {alike}.")
    return found


def _between_runs(after: np.ndarray, problem: Problem) -> list[str]:
    """A sentence on the runs between which a moment lies; none where it lies within one."""
    run, label = problem.table.run[problem.used], problem.table.run_label
    if after.all() or not after.any() or run[~after][-1] == run[after][0]:
        return []
    before, then = (label[own] for own in (run[~after][-1], run[after][0]))
    if not (before and then):
        return ["That is between two runs."]
    first, second = (each if each.lower().startswith("run") else f"run {each}" for each in (before, then))
    return [f"That is between {first} and {second}."]


def parting(after: np.ndarray, values: np.ndarray, slack: float = 0.0) -> tuple[float, float] | None:
    """The value of a variable that separates the rows after a moment from those before it.

    Args:
        after: rows after the moment, (n,) bool.
        values: of the variable, (n,).
        slack: how far rows may lie on the wrong side of the value.

    Returns:
        The nearest values below and above it; None where the variable does not separate them.
    """
    if after.all() or not after.any():
        return None
    for low, high in ((values[~after], values[after]), (values[after], values[~after])):
        wide = high.max() - low.min() > LEAST_SWINGS * slack
        if wide and low.max() < high.min() + 2.0 * slack:
            below, above = sorted((float(low.max()), float(high.min())))
            return below, above
    return None
