"""Sums of several effects that together look exactly like one.

Links, radius and lead together stretch a machine just as a wrong scale of the tracker does. That need not be three
faults at once: a machine is longer in all its parts where it is warmer than its drawing says.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.at_tool import without_rigid_motion
from ptt.diagnosis.evidence.atoms import Atom, is_plain
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.instead import commoner
from ptt.diagnosis.search.plainest import PLAIN_NATS
from ptt.effects.late import has_begun, starts_of
from ptt.effects.metrology import TrackerScale
from ptt.effects.phrases import SIGNIFICANT, listed
from ptt.fitting.projected import Projected, gain, project
from ptt.model.model import Term
from ptt.run.problem import Problem

MOST_PARTS = 4  # effects in a sum
UNSEEN_CHI2 = 3.0  # chi-squared below which a difference is not seen
EITHER = 0.5  # probability of either of two causes that no reading tells apart
CLEAR_CHI2 = 30.0  # chi-squared that a step has to be worth before a sum can be said to mimic it


def find_sum(scorer: Scorer, state: State, key: str) -> tuple[str, ...]:
    """Plain effects that together would explain as much as one effect of an explanation.

    Its commoner causes, where these score nearly as high; else effects beside which nothing of it is visible.

    Args:
        scorer: of the linearised problem.
        state: with the effect in it.
        key: of the effect's atom.

    Returns:
        Two to four names; empty where no such sum exists, or where one effect alone would do.
    """
    other = commoner(scorer, state, key)
    if other is not None and other.total > state.total - PLAIN_NATS:
        names = tuple(scorer.system.atoms[part].name for part in other.keys if part not in state.keys)
        if len(names) > 1:
            return names
    return _unseen(scorer.system, state, key)


def is_growth(name: str, together: tuple[str, ...]) -> bool:
    """Whether an effect may as well be a machine that has grown alike in all its parts, which is one cause.

    Args:
        name: of the effect.
        together: other effects that look like it together, from `find_sum`.
    """
    return name == TrackerScale.name and bool(together)


def growth_doubt(term: Term, problem: Problem) -> float:
    """Root mean square doubt in the tool's position where a tracker's scale may as well be the machine's, mm.

    Args:
        term: the scale at its value.
        problem: the rows.
    """
    apart = without_rigid_motion(term.effect.shift(term.theta, problem.view).numpy(), problem)
    return float(np.sqrt(EITHER * np.square(apart).sum(axis=1).mean()))


def kept_warm(term: Term, beside: Sequence[Term]) -> list[str]:
    """Say which errors of the drawing may be growth of a machine that its own motors keep warmer than the air.

    A body that is warmed by a constant amount begins cooler by it, and ends with every size a little too large.

    Args:
        term: an effect at its values.
        beside: the other named effects at theirs.

    Returns:
        One sentence for growth that clearly began cooler than the air beside errors of the drawing, else none.
    """
    drawn = [other.effect.key for other in beside if other.effect.of_drawing]
    if not drawn or not has_begun(term.effect, term.theta):
        return []
    first = float(starts_of(term.theta)[0])
    error = float(np.nan_to_num(starts_of(term.std)[0])) if term.std is not None else 0.0
    if first > -SIGNIFICANT * error:
        return []
    return [
        f"Motors that keep a machine warm would look like it with {listed(drawn)}: measure again after hours of rest."
    ]


def _unseen(system: System, state: State, key: str) -> tuple[str, ...]:
    """Effects that explain all of an effect's contribution: greedy forward selection, then backward elimination."""
    rest = [state.of(other) for other in without(state, key)]
    base = state.columns[np.concatenate([np.flatnonzero(state.owner < 0), *rest]).astype(int)]
    names = {system.atoms[other].name for other in state.keys}
    parts = [atom for atom in system.atoms.values() if _is_steady(atom) and atom.name not in names]
    own, values, phi = system.atoms[key].columns, state.posterior.values[state.of(key)], state.posterior.phi
    # Only these columns are needed, so they are numbered anew.
    there = np.unique(np.concatenate([base, own, *(part.columns for part in parts)]))
    own, parts = np.searchsorted(there, own), [replace(a, columns=np.searchsorted(there, a.columns)) for a in parts]
    sums = system.sums_of(there, WHITE)
    projected = project(sums.gram, sums.side, sums.square, np.searchsorted(there, base))
    side = projected.gram[:, own] @ values
    work = Projected(projected.gram, side, float(values @ side[own]), projected.before)
    if work.left < CLEAR_CHI2 * phi:
        return ()
    chosen: list[Atom] = []
    while _left(work, chosen) > UNSEEN_CHI2 * phi:
        if len(chosen) == MOST_PARTS or not parts:
            return ()
        best = min(parts, key=lambda atom: _left(work, [*chosen, atom]))
        parts = [atom for atom in parts if atom.name != best.name]
        chosen.append(best)
    for part in tuple(chosen):
        fewer = [other for other in chosen if other is not part]
        if _left(work, fewer) <= UNSEEN_CHI2 * phi:
            chosen = fewer
    return tuple(part.name for part in chosen) if len(chosen) > 1 else ()


def _is_steady(atom: Atom) -> bool:
    """Whether an atom is a plain effect that may be added and has no shape to search."""
    return is_plain(atom) and atom.shape is not None and not atom.shape


def _left(work: Projected, parts: list[Atom]) -> float:
    """Sum of squares of the effect's contribution that the parts do not explain."""
    if not parts:
        return work.left
    return work.left - gain(work, np.concatenate([part.columns for part in parts]))
