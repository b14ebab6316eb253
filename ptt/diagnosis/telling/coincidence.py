"""What else changes at the moment of a sudden effect, so that no reading tells which of both it depends on."""

from collections.abc import Mapping

import numpy as np

from ptt.dependence.contexts import is_joint, path_views, unit_of
from ptt.dependence.said import middle
from ptt.effects.phrases import listed
from ptt.effects.sudden import Sudden
from ptt.model.model import Term
from ptt.run.axes import AXES
from ptt.run.problem import Problem

CONDITIONS = ("payload", "temperature", "feed")  # beside a user's own columns
AIR_SWING = 0.1  # K that room temperature goes up and down by itself, so rows near the moment may lie on the other side
NEAR_ROWS = 2  # rows by which a moment may be misplaced where its size is a few times the noise
RARE = 0.05  # share of the rows at which a variable that stays at levels changes them, at most
LEAST_SIDE = 3  # rows on either side, of which a place would part any one by chance
LEAST_SWINGS = 10.0  # swings that a variable has to cover before it has two sides


def coincidences(term: Term, problem: Problem) -> list[str]:
    """Say between which runs a sudden effect happens, and what passes a value then and at no other time, or changes.

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
        elif name in views and _changes_near(after, views[name][problem.used]):
            found.append(f"{name[:1].upper()}{name[1:]} changes about that moment, too: it may be the cause.")
    return found + _places(after, views, problem)


def _changes_near(after: np.ndarray, values: np.ndarray) -> bool:
    """Whether a variable that stays at levels changes its level within `NEAR_ROWS` of a moment."""
    steps, moment = np.flatnonzero(np.diff(values) != 0.0) + 1, np.flatnonzero(np.diff(after.astype(int)) != 0) + 1
    if not len(moment) or not 0 < len(steps) <= RARE * len(values):
        return False
    return bool(np.abs(steps - moment[0]).min() <= NEAR_ROWS)


def _places(after: np.ndarray, views: Mapping[str, np.ndarray], problem: Problem) -> list[str]:
    """A sentence on the places that part the rows after a moment from those before it.

    Most paths turn back again and again, and have none. On a raster by layers, or a helix, a fault that begins at a
    height begins at a moment.
    """
    if min(after.sum(), (~after).sum()) < LEAST_SIDE:
        return []
    names = [name for name in (*AXES, *filter(is_joint, views)) if name in views]
    parted = {name: place for name in names if (place := parting(after, views[name][problem.used])) is not None}
    if not parted:
        return []
    first, *others = parted
    where = middle(*parted[first], unit_of(problem, first))
    said = f"{first} passes {where} at that moment and at no other"
    beside = f" ({listed(others)} as well)" if others else ""
    return [f"{said}{beside}: a fault of the machine beyond that place would look the same until the path comes back."]


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
