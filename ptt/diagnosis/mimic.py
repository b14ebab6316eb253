"""Sums that mimic: several effects that together do exactly the work of one.

Links, radius and lead together stretch a machine just as a wrong unit of the tracker would.
"""

import numpy as np

from ptt.diagnosis.columns import Trial
from ptt.diagnosis.screen import SIMPLE
from ptt.diagnosis.walker import State, hold
from ptt.sums import Projected, gain, project, solve

MOST_PARTS = 4
UNSEEN = 3.0  # chi-squared below which a difference is none
CLEAR = 30.0  # chi-squared that a step has to be worth before a sum can be said to mimic it


def find_sum(state: State, key: str) -> tuple[str, ...]:
    """Simple effects that together leave nothing to be seen of one effect of a model.

    Found forward, the effect that takes most first, then without those that the others make needless.

    Args:
        state: with the effect in its model.
        key: the effect.

    Returns:
        Two to four keys; empty where no such sum exists, or one effect alone would do.
    """
    design, spread = state.design, state.screened.spread
    rest = hold(state, [other for other in design.present if other != key])
    projected = project(*design.sums.total[:3], rest)
    own = design.present[key]
    values = solve(projected.gram, projected.side, projected.left, own).values
    side = projected.gram[:, own] @ values
    work = Projected(projected.gram, side, float(values @ side[own]), 0, projected.before)
    if work.left < CLEAR * spread:
        return ()
    parts = [trial for trial in design.trials if _is_plain(trial, key)]
    chosen: list[Trial] = []
    while _left(work, chosen) > UNSEEN * spread:
        if len(chosen) == MOST_PARTS or not parts:
            return ()
        best = min(parts, key=lambda trial: _left(work, [*chosen, trial]))
        parts = [trial for trial in parts if trial.effect.key != best.effect.key]
        chosen.append(best)
    for part in tuple(chosen):
        without = [other for other in chosen if other is not part]
        if _left(work, without) <= UNSEEN * spread:
            chosen = without
    return tuple(part.effect.key for part in chosen) if len(chosen) > 1 else ()


def _is_plain(trial: Trial, key: str) -> bool:
    return len(trial.columns) <= SIMPLE and trial.trials == 1 and trial.effect.name != key.partition("[")[0]


def _left(work: Projected, parts: list[Trial]) -> float:
    """Sum of squares of the effect's work that the parts leave."""
    if not parts:
        return work.left
    return work.left - gain(work, np.concatenate([part.columns for part in parts]))[0]
