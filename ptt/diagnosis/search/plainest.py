"""Parsimony: of the sets that score nearly as high as the best, the one with the fewest parts is reported."""

from ptt.diagnosis.evidence.atoms import causes, is_bent, is_drawn, is_effect, is_over_time
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.witness import drifts
from ptt.diagnosis.search.moves import SEEN_NATS, droppable

PLAIN_NATS = 5.0  # nats that a further unknown or name has to gain: less is no reason to accuse a machine
FEW_SIZES = 2  # sizes of the drawing that count as parts: where more are off, all may be
FURTHER_SIZE_PART = 0.1  # parts that each further size counts for: not zero, so that the set with fewer is preferred
BENT_PART = 0.5  # further parts that a curve or an unknown counts for: it lies between one plain name and two
UNTESTED_PART = 0.25  # further parts of an untested effect: less than `BENT_PART`, so that it only breaks ties
ODD_PARTS = 1.5  # parts of a memory of the noise that is no tracker's: one unknown that depends on nothing


def plainest(scorer: Scorer, best: State, *, nothing: bool = True) -> State:
    """Of the sets that score nearly as high as the best, the one with the fewest parts.

    Args:
        scorer: that has scored them.
        best: the best set.
        nothing: whether the empty set may be chosen.

    Returns:
        The set with the fewest parts (`_parts`), then the fewest curves and unknowns, which are flexible and so say
        little, then the fewest unknowns that depend on time, which is no cause in itself, then the highest score. A set
        whose effects are all in the model gets one nat more, as of two equal sets each looks better when linearised at
        the other.
    """

    def plain(state: State) -> tuple[float, int, int, float]:
        least = -state.total - SEEN_NATS * is_in_model(scorer, state)
        return _parts(scorer, state), _bends(scorer, state), timed(scorer, state), least

    near = [
        state for state in scorer.scored.values()
        if state.total > best.total - PLAIN_NATS and not _hides_sizes(scorer, state, best)
    ]  # fmt: skip
    first = min([best, *(state for state in near if nothing or _parts(scorer, state))], key=plain)
    first = max([first, *(state for state in near if _drifts_instead(scorer, state, first))], key=lambda one: one.total)
    return scorer.score(first.keys, first.memory)


def _hides_sizes(scorer: Scorer, state: State, best: State) -> bool:
    """Whether a set has an unknown where the best set has sizes of the drawing: it would have to be clearly better.

    Not where it is but another form of an unknown that the best set has beside them.
    """
    atoms, more, less = scorer.system.atoms, set(state.keys) - set(best.keys), set(best.keys) - set(state.keys)
    gone = [block for key in less if (block := atoms[key].block) is not None]
    new = [block for key in more if (block := atoms[key].block) is not None]
    other = [block for block in new if not any(block.is_like(one) for one in gone)]
    return bool(other) and any(is_drawn(atoms[key]) for key in less)


def _drifts_instead(scorer: Scorer, state: State, first: State) -> bool:
    """Whether a set names drifts of the tracker where the first has a wander longer than the run, an unnamed drift."""
    wander, atoms = first.memory.wander, scorer.system.atoms
    if wander is None or wander.constant <= scorer.system.clock.lasts.max() or state.memory.wander is not None:
        return False
    more = [atoms[key].effect for key in set(state.keys) - set(first.keys)]
    return set(first.keys) < set(state.keys) and all(effect is not None and drifts(effect) for effect in more)


def is_in_model(scorer: Scorer, state: State) -> bool:
    """Whether every effect of a set is in the model: only such a set has fitted values, words and commands."""
    return all(scorer.system.atoms[key].shape is None for key in state.keys)


def _parts(scorer: Scorer, state: State) -> float:
    """Number of parts of a set, weighted: names and unknowns, and memories of the noise that are no tracker's.

    An effect that looks like several commoner causes counts as these. Curves and unknowns count more than plain names,
    untested effects a little more, and sizes of the drawing beyond `FEW_SIZES` hardly at all.
    """
    odd = scorer.system.errs_by_pose(state.memory) or scorer.system.clock.is_fault(state.memory.wander)
    atoms = [scorer.system.atoms[key] for key in droppable(scorer, state)]
    unknowns, untested = sum(atom.block is not None for atom in atoms), sum(not atom.tested for atom in atoms)
    parts = float(sum(1 if atom.effect is None else causes(atom.effect) for atom in atoms))
    more = max(sum(causes(atom.effect) for atom in atoms if atom.effect is not None and is_drawn(atom)) - FEW_SIZES, 0)
    bent = unknowns + _curves(scorer, state)
    return parts - (1.0 - FURTHER_SIZE_PART) * more + BENT_PART * bent + UNTESTED_PART * untested + ODD_PARTS * odd


def _bends(scorer: Scorer, state: State) -> int:
    """Number of curves and unknowns of a set."""
    unknowns = sum(scorer.system.atoms[key].block is not None for key in droppable(scorer, state))
    return _curves(scorer, state) + unknowns


def timed(scorer: Scorer, state: State) -> int:
    """Number of unknowns of a set that depend on time."""
    return sum(is_over_time(scorer.system.atoms[key]) for key in state.keys)


def _curves(scorer: Scorer, state: State) -> int:
    """Number of effects of a set that are curves of many values."""
    atoms = [scorer.system.atoms[key] for key in droppable(scorer, state)]
    return sum(is_effect(atom) and is_bent(atom) for atom in atoms)
