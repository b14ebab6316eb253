"""Sizes of the drawing together against unknowns and curves: on a real machine every size is a little off."""

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
    """Compare unknowns, curves and effects of the tracker in a set with all sizes of the drawing together.

    The first size costs a full name, as a machine may be built as drawn; once one size is off, each further one has
    even odds. An unknown, a bent rail, or a random error of each pose that explains no more than such a set is dropped.
    An effect of the tracker is a name as well, and is dropped only where the sizes explain clearly more.

    Args:
        scorer: of a linearised problem.
        state: the best set.

    Returns:
        The scorer and set as given where nothing is dropped; else a scorer that bars what was dropped, and its best
        set.
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
    """A scorer that bars what sizes of the drawing replaced, and its best set.

    Other unknowns and curves may come in its place only if they explain more than the sizes do, and only unknowns that
    the set had before.
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
    """Unknowns of a set: keys of blocks, and 'pose' for random errors of poses."""
    found = {key for key in state.keys if is_block(scorer.system.atoms[key])}
    return found | {"pose"} if scorer.system.errs_by_pose(state.memory) else found


def _likelier(scorer: Scorer, state: State, gone: Sequence[str], memory: Memory) -> State | None:
    """The best set with sizes of the drawing in the place of some atoms, if it is likely enough.

    An unknown has to be `PLAIN_NATS` better than it to stay, an effect of the tracker may be as much worse, and all
    others have to be better.

    Args:
        scorer: of the system.
        state: the best set.
        gone: atoms of it to replace.
        memory: of the noise without what is replaced.

    Returns:
        The set; None where nothing is replaced, where the given set is better, or where no size was added.
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
    """Whether an effect of the tracker looks like sizes of the drawing: it depends on position and not on time."""
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
    """Score of a set with `EVEN_ODDS` instead of a name's odds for each size of the drawing beyond the first."""
    atoms = [scorer.system.atoms[key] for key in droppable(scorer, state)]
    odds = sorted((atom.odds for atom in atoms if is_drawn(atom)), reverse=True)
    return state.total + sum(each - EVEN_ODDS for each in odds[1:])
