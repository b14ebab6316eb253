"""Replacements that swaps one for one do not find: several plain effects for a curve, an unknown, or another effect."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import (
    Atom,
    holds_sizes,
    is_bent,
    is_drawn,
    is_effect,
    is_field,
    is_metrology,
    is_plain,
)
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.moves import LEAST_NATS, SCREEN_ERROR, SEEN_NATS, TRIED, added, droppable, worth_a_try

ZEROS = "homing-offset"


def refilled(scorer: Scorer, best: State) -> State:
    """Try effects in the place of unknowns, and several plain effects in the place of curves and composite ones.

    Args:
        scorer: of the system.
        best: a local maximum of plain moves.

    Returns:
        The best set found.
    """
    best = _zero_instead(scorer, _named_instead(scorer, best))
    if smooth := [key for key in droppable(scorer, best) if _goes_by_place(scorer.system.atoms[key])]:
        drawn = drawn_instead(scorer, best, smooth, best.memory)
        best = improve(scorer, drawn) if drawn.total > best.total + LEAST_NATS else best
    for key in droppable(scorer, best):
        for other in (_instead_of, _beside):
            if key in best.keys and is_bent(scorer.system.atoms[key]):
                best = other(scorer, best, key)
        if key in best.keys:
            best = _commoner(scorer, best, key)
    return _tracker_or_machine(scorer, best)


def _named_instead(scorer: Scorer, best: State) -> State:
    """The set with effects alone in the place of its unknowns, if better, plain effects tried beside its curves.

    A curve that holds a tower's part has far too large a prior variance, which the screen holds; the unknown has both
    parts, so that only an exact score shows that the two effects are better.
    """
    blocks = [key for key in droppable(scorer, best) if scorer.system.atoms[key].block is not None]
    if not blocks:
        return best
    fewer = scorer.less(best, *blocks)
    named = improve(scorer, fewer, is_effect, swaps=False)
    for key in droppable(scorer, named):
        if key in named.keys and is_bent(scorer.system.atoms[key]):
            named = _beside(scorer, named, key)
    return named if named.total > best.total + LEAST_NATS else best


def _zero_instead(scorer: Scorer, best: State) -> State:
    """The set with a zero that is off in the place of an unknown that is hardly more than the level of its joint.

    A block has a level, so that no zero is named beside a fault that is large in one corner, and no usual size, so that
    of a zero far off it scores higher than its name. What it has beside the level has to be worth its odds by itself.
    """
    for key in droppable(scorer, best):
        atom = scorer.system.atoms[key]
        if not _is_mostly_level(scorer, best, atom):
            continue
        keys = without(best, key)
        zero = _addable(scorer, keys, {ZEROS})
        other = scorer.score((*keys, *zero), best.memory, best.variances)
        if zero and other.total > best.total - atom.odds:
            best = other
    return best


def _is_mostly_level(scorer: Scorer, best: State, atom: Atom) -> bool:
    """Whether what an unknown of a joint has beside its level is worth less than the odds of an unknown."""
    block = atom.block
    if block is None or block.place.kind not in ("slider", "joint"):
        return False
    level = np.ptp(block.shapes, axis=0) == 0.0
    values, covariance = best.amounts([atom], scorer.system.scale)
    bends = values[~level] @ np.linalg.lstsq(covariance[np.ix_(~level, ~level)], values[~level])[0]
    return bool(level.any()) and 0.5 * float(bends) < atom.odds


def drawn_instead(scorer: Scorer, best: State, gone: Sequence[str], memory: Memory) -> State:
    """The set with sizes of the drawing in the place of unknowns and curves of position.

    All sizes are added at once and needless ones dropped: where each is off by no more than the readings scatter, none
    alone is worth its name, and adding them one by one gains less than an unknown does at once.

    Args:
        scorer: of the system.
        best: a set.
        gone: unknowns and curves of it to replace.
        memory: of the noise.
    """
    rest = without(best, *gone)
    drawn = {atom.name for atom in scorer.system.atoms.values() if is_drawn(atom)}
    all_of_them = scorer.score((*rest, *_addable(scorer, rest, drawn)), memory, best.variances)
    fewer = improve(scorer, all_of_them, _nothing, swaps=False)
    return improve(scorer, fewer, is_plain, swaps=False)


def _goes_by_place(atom: Atom) -> bool:
    """Whether an atom is an unknown of position, or a curve whose level and slope are sizes of the drawing."""
    return is_field(atom) or holds_sizes(atom)


def _nothing(atom: Atom) -> bool:
    return False


def _instead_of(scorer: Scorer, best: State, key: str) -> State:
    """The set with several plain effects in the place of a curve, if better; the curve may be added again.

    None of the plain effects alone is worth as much as the curve, so no swap finds them.
    """
    fewer = scorer.less(best, key)
    if not worth_a_try(scorer, fewer, is_plain):
        return best
    plain = improve(scorer, fewer, is_plain, swaps=False)
    if set(plain.keys) <= set(fewer.keys):  # nothing replaces it; swaps have tried other curves
        return best
    other = improve(scorer, plain, swaps=False)
    return improve(scorer, other) if other.total > best.total + LEAST_NATS else best


def _beside(scorer: Scorer, best: State, key: str) -> State:
    """The set with a plain effect beside a curve, or with the effects of the curve's level and slope in its place.

    The screen holds the curve's prior variance. That the rest of the curve is smaller once its slope has a name, only
    an exact score shows.
    """
    near = [gain for gain in scorer.screen(best, is_plain) if gain.nats > SEEN_NATS - SCREEN_ERROR]
    tried = [added(scorer, best, gain) for gain in near[:TRIED]]
    lenders = _lenders(scorer, best, key)
    if lenders:
        tried.append(scorer.score((*without(best, key), *lenders), best.memory, best.variances))
    other = max(tried, key=lambda state: state.total, default=best)
    return improve(scorer, other) if other.total > best.total + LEAST_NATS else best


def _commoner(scorer: Scorer, best: State, key: str) -> State:
    """The set with those commoner causes that together look like an effect in its place, if better.

    None of them alone is worth as much, and a greedy search without the effect may add yet another one first.
    """
    there = commoner(scorer, best, key)
    if there is None:
        return best
    other = improve(scorer, there, is_plain, swaps=False)
    return improve(scorer, other) if other.total > best.total + LEAST_NATS else best


def commoner(scorer: Scorer, state: State, key: str) -> State | None:
    """A set with all the commoner causes that together look like one of its effects in the place of that.

    Args:
        scorer: of the system.
        state: a set.
        key: of the effect's atom.

    Returns:
        The set; None where there are no such causes, or where one of them may not stand beside the others.
    """
    effect = scorer.system.atoms[key].effect
    if effect is None or not effect.stands_for:
        return None
    rest = without(state, key)
    names = set(effect.stands_for) - {scorer.system.atoms[other].name for other in rest}
    coming = _addable(scorer, rest, names)
    return scorer.score((*rest, *coming), state.memory, state.variances) if 0 < len(names) == len(coming) else None


def _lenders(scorer: Scorer, state: State, key: str) -> list[str]:
    """Keys of atoms of the effects that level and slope of one of a set's curves belong to, and that it lacks."""
    effect = scorer.system.atoms[key].effect
    names = {name for parameter in effect.parameters for name in parameter.lent} if effect is not None else set()
    return _addable(scorer, without(state, key), names)


def _addable(scorer: Scorer, keys: Sequence[str], names: set[str]) -> list[str]:
    """Key of one atom for each of some names that may be added to a set beside the others."""
    found = list[str]()
    for name in sorted(names):
        may_come = scorer.opens([*keys, *found])
        found += [key for key, atom in scorer.system.atoms.items() if atom.name == name and may_come(atom)][:1]
    return found


def _tracker_or_machine(scorer: Scorer, best: State) -> State:
    """Replace each effect of the machine by effects of the tracker, and the other way round, where that is better.

    Commands corrected for what the tracker did make a machine worse, and so does an error of the machine that is blamed
    on the tracker. Either may have done two things at once, which no swap one for one finds.
    """
    for key in droppable(scorer, best):
        atom = scorer.system.atoms[key]
        if key in best.keys and atom.effect is not None:
            fewer = scorer.less(best, key)
            other = improve(scorer, fewer, _is_of_machine if is_metrology(atom) else is_metrology, swaps=False)
            if other.total > best.total + LEAST_NATS:
                best = improve(scorer, other)
    return best


def _is_of_machine(atom: Atom) -> bool:
    return is_plain(atom) and not is_metrology(atom)
