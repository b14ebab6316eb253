"""The drawing: of a real machine each size is off, and together they do what a smooth unknown of the place would do."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.atoms import holds_sizes, is_block, is_drawn, is_field
from ptt.diagnosis.improve import improve
from ptt.diagnosis.instead import drawn_instead
from ptt.diagnosis.moves import loose
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.state import State

EVEN = float(np.log(2.0))  # nats against one more size, once one is off


def by_drawing(scorer: Scorer, state: State) -> tuple[Scorer, State]:
    """Hold unknowns that vary with the place alone, and curves, against all sizes of the drawing together.

    Each size costs a name, which is fair of the first: a machine may be as it is drawn. Once one is off it is even
    whether the next one is. An unknown, or a rail that bends, which says no more than such a set is none.

    Args:
        scorer: of a linearised problem.
        state: the best set.

    Returns:
        The same where it holds nothing of the kind, or where that says more; else a scorer that does not allow it, and
        the best set without.
    """
    atoms = scorer.system.atoms
    for kind in (is_field, holds_sizes):
        gone = [key for key in loose(scorer, state) if kind(atoms[key])]
        named = _likelier(scorer, state, gone)
        if named is not None:
            barred = scorer.barred | {atoms[key].name for key in gone if holds_sizes(atoms[key])}
            fields = scorer.fields and kind is not is_field
            less = Scorer(scorer.system, scorer.given, scorer.steps, barred, fields=fields)
            best = improve(less, less.score(named.keys, named.memory, named.scales))
            if {key for key in best.keys if is_block(atoms[key])} <= set(state.keys):  # else these do not do the same
                scorer, state = less, best
    return scorer, state


def _likelier(scorer: Scorer, state: State, gone: Sequence[str]) -> State | None:
    """A set with sizes of the drawing in the place of something, where it is likelier; None where nothing is to go."""
    if not gone:
        return None
    named = drawn_instead(scorer, state, gone)
    return named if _once_one_is_off(scorer, named) > _once_one_is_off(scorer, state) else None


def _once_one_is_off(scorer: Scorer, state: State) -> float:
    """Total of a set where each size of the drawing beyond the first costs no name."""
    atoms = [scorer.system.atoms[key] for key in loose(scorer, state)]
    odds = sorted((atom.odds for atom in atoms if is_drawn(atom)), reverse=True)
    return state.total + sum(each - EVEN for each in odds[1:])
