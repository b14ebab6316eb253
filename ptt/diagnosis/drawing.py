"""The drawing: of a real machine each size is off, and together they do what a smooth unknown of the place would do."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.atoms import holds_sizes, is_block, is_drawn, is_field
from ptt.diagnosis.improve import improve
from ptt.diagnosis.instead import drawn_instead
from ptt.diagnosis.moves import LEAST, loose
from ptt.diagnosis.plainest import PLAIN
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.state import State

EVEN = float(np.log(2.0))  # nats against one more size, once one is off


def by_drawing(scorer: Scorer, state: State) -> tuple[Scorer, State]:
    """Hold unknowns, and curves, against all sizes of the drawing together.

    Each size costs a name, which is fair of the first: a machine may be as it is drawn. Once one is off it is even
    whether the next one is. An unknown, or a rail that bends, which says no more than such a set is none; nor is an
    error that every pose has to itself, or one that follows something which a few poses label.

    Args:
        scorer: of a linearised problem.
        state: the best set.

    Returns:
        The same where it holds nothing of the kind, or where that says more; else a scorer that does not allow it, and
        the best set without.
    """
    atoms = scorer.system.atoms
    for kind in (is_field, holds_sizes, is_block):
        gone = [key for key in loose(scorer, state) if kind(atoms[key])]
        named = _likelier(scorer, state, gone, poses=kind is holds_sizes)
        if named is not None:
            less, best = _without(scorer, named, gone, fields=scorer.fields and kind is holds_sizes)
            if {key for key in best.keys if is_block(atoms[key])} <= set(state.keys):  # else these do not do the same
                scorer, state = less, best
    return scorer, state


def _without(scorer: Scorer, named: State, gone: Sequence[str], *, fields: bool) -> tuple[Scorer, State]:
    """A scorer that does not allow what sizes of the drawing have taken the place of, and the best set that it finds.

    Nor does it allow another unknown, or another curve, that would say no more than these sizes either.
    """
    atoms = scorer.system.atoms
    barred = scorer.barred | {atoms[key].name for key in gone}
    bending = {atom.name for atom in atoms.values() if is_block(atom) or holds_sizes(atom)}
    plain = Scorer(
        scorer.system, scorer.given, scorer.steps, barred | bending - {atoms[key].name for key in named.keys},
        fields=fields,
    )  # fmt: skip
    best = improve(plain, plain.score(named.keys, named.memory, named.scales))
    every = Scorer(scorer.system, scorer.given, scorer.steps, barred, fields=fields)
    other = improve(every, every.score(best.keys, best.memory, best.scales))
    least = PLAIN if any(is_block(atoms[key]) for key in set(other.keys) - set(best.keys)) else LEAST
    return (every, other) if _once_one_is_off(every, other) > _once_one_is_off(plain, best) + least else (plain, best)


def _likelier(scorer: Scorer, state: State, gone: Sequence[str], *, poses: bool) -> State | None:
    """A set with sizes of the drawing in the place of something that says no more; None where nothing is to go.

    An unknown has to say clearly more.

    Args:
        scorer: of the system.
        state: the best set.
        gone: atoms of it that go.
        poses: whether errors that each pose has to itself may stay.
    """
    go = not poses and scorer.system.errs_by_pose(state.memory)
    if not gone and not go:
        return None
    named = drawn_instead(scorer, state, gone, replace(state.memory, pose=0.0) if go else state.memory)
    more = _once_one_is_off(scorer, state) - _once_one_is_off(scorer, named)
    unknown = go or any(is_block(scorer.system.atoms[key]) for key in gone)
    return named if more < (PLAIN if unknown else 0.0) else None


def _once_one_is_off(scorer: Scorer, state: State) -> float:
    """Total of a set where each size of the drawing beyond the first costs no name."""
    atoms = [scorer.system.atoms[key] for key in loose(scorer, state)]
    odds = sorted((atom.odds for atom in atoms if is_drawn(atom)), reverse=True)
    return state.total + sum(each - EVEN for each in odds[1:])
