"""The drawing: of a real machine each size is off, and together they do what an unknown or a curve would do."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, holds_sizes, is_block, is_drawn, is_field, is_metrology, is_sudden
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.instead import drawn_instead
from ptt.diagnosis.search.moves import LEAST_NATS, droppable
from ptt.diagnosis.search.plainest import PLAIN_NATS

EVEN_ODDS = float(np.log(2.0))  # nats against one more size of the drawing, once one is off: even odds


def by_drawing(scorer: Scorer, state: State) -> tuple[Scorer, State]:
    """Hold unknowns, curves, and what the tracker may have done, against all sizes of the drawing together.

    Each size costs a name, which is fair of the first: a machine may be as it is drawn. Once one is off it is even
    whether the next one is. An unknown, or a rail that bends, which says no more than such a set is none; nor is an
    error that every pose has to itself, or one that follows something which a few poses label. What the tracker may
    have done is a name as well, and goes where they say clearly more.

    Args:
        scorer: of a linearised problem.
        state: the best set.

    Returns:
        The same where it holds nothing of the kind, or where that says more; else a scorer that does not allow it, and
        the best set without.
    """
    atoms, tried = scorer.system.atoms, set[tuple[object, ...]]()
    kinds = [(is_field, True), (is_field, False), (holds_sizes, True), (is_block, False)]
    kinds += [(partial(_is, key), True) for key in droppable(scorer, state) if _may_be_sizes(atoms[key])]
    for kind, poses in kinds:
        gone = [key for key in droppable(scorer, state) if kind(atoms[key])]
        go = scorer.system.errs_by_pose(state.memory) and not poses
        memory = replace(state.memory, pose=0.0) if go else state.memory
        asked = (state.keys, state.memory, memory, *gone)
        if asked in tried:
            continue
        tried.add(asked)
        named = _likelier(scorer, state, gone, memory)
        if named is not None:
            fields = scorer.fields and not go and not any(is_field(atoms[key]) for key in gone)
            scorer, state = _without(scorer, state, named, gone, fields=fields)
    return scorer, state


def _without(scorer: Scorer, state: State, named: State, gone: Sequence[str], *, fields: bool) -> tuple[Scorer, State]:
    """A scorer that does not allow what sizes of the drawing have taken the place of, and the best set that it finds.

    Nor does it allow another unknown, or another curve, that would say no more than these sizes either. One that the
    set did not have before does not do the same as what has gone.
    """
    atoms = scorer.system.atoms
    barred = scorer.barred | {atoms[key].name for key in gone}
    bending = {atom.name for atom in atoms.values() if is_block(atom) or holds_sizes(atom)}
    plain = Scorer(
        scorer.system, scorer.given, scorer.steps, barred | bending - {atoms[key].name for key in named.keys},
        fields=fields,
    )  # fmt: skip
    named = plain.score(named.keys, named.memory, named.variances)
    best = max(named, improve(plain, named), key=lambda one: _once_one_is_off(plain, one))
    every = Scorer(scorer.system, scorer.given, scorer.steps, barred, fields=fields)
    other = improve(every, every.score(best.keys, best.memory, best.variances))
    more = _once_one_is_off(every, other) - _once_one_is_off(plain, best)
    least = PLAIN_NATS if _unknowns(every, other) - _unknowns(plain, best) else LEAST_NATS
    allowed = _unknowns(every, other) <= _unknowns(scorer, state)
    return (every, other) if allowed and more > least else (plain, best)


def _unknowns(scorer: Scorer, state: State) -> set[str]:
    """Unknowns of a set, errors that each pose has to itself among them."""
    found = {key for key in state.keys if is_block(scorer.system.atoms[key])}
    return found | {"pose"} if scorer.system.errs_by_pose(state.memory) else found


def _likelier(scorer: Scorer, state: State, gone: Sequence[str], memory: Memory) -> State | None:
    """A set with sizes of the drawing in the place of something that says no more, an unknown no clearly more.

    Args:
        scorer: of the system.
        state: the best set.
        gone: atoms of it that go.
        memory: of the noise without what goes.

    Returns:
        The set; None where nothing goes, where it says more, or where no size has come in its place.
    """
    if not gone and memory == state.memory:
        return None
    named = drawn_instead(scorer, state, gone, memory)
    if _sizes(scorer, named) <= _sizes(scorer, state):
        return None
    unknown = memory != state.memory or any(is_block(scorer.system.atoms[key]) for key in gone)
    usual = any(_may_be_sizes(scorer.system.atoms[key]) for key in gone)
    more = _once_one_is_off(scorer, state) - _once_one_is_off(scorer, named)
    return named if more < (PLAIN_NATS if unknown else -PLAIN_NATS if usual else 0.0) else None


def _may_be_sizes(atom: Atom) -> bool:
    """Whether an effect of the tracker may be sizes of the drawing: it follows the place, and does not pay for that."""
    effect = atom.effect
    lasting = effect is not None and not effect.follows_clock and not is_sudden(atom)
    return effect is not None and is_metrology(atom) and lasting and not effect.stands_for


def _is(key: str, atom: Atom) -> bool:
    return atom.key == key


def _sizes(scorer: Scorer, state: State) -> set[str]:
    """Names of the sizes of the drawing that are off."""
    atoms = [scorer.system.atoms[key] for key in droppable(scorer, state)]
    return {atom.name for atom in atoms if is_drawn(atom)}


def _once_one_is_off(scorer: Scorer, state: State) -> float:
    """Total of a set where each size of the drawing beyond the first costs no name."""
    atoms = [scorer.system.atoms[key] for key in droppable(scorer, state)]
    odds = sorted((atom.odds for atom in atoms if is_drawn(atom)), reverse=True)
    return state.total + sum(each - EVEN_ODDS for each in odds[1:])
