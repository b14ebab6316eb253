"""Laws of one variable: a curve or a jump over one variable at one place, the most specific form of an unknown.

One jump may differ over the workspace: what changed at one moment, as a load does that nobody noted.

A field over the workspace, a flexible curve, a slip or a knock can each stand in for physics that is not in the
library, and names found beside such a stand-in are wrong too. Where a law holds it explains as much with fewer degrees
of freedom and scores higher. A rail of two pieces, a dent or a loose clamp is passed again and again; named as slips
and knocks, the last of them would be corrected as if it were permanent. Where names say all, a law in the place of
sudden ones has to be clearly better: where a small knock lies nearly along a joint's way, two changes of that joint
look like a slip and the knock.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ptt.diagnosis.evidence.atoms import (
    SHAPE_POWER,
    Atom,
    atoms_of_blocks,
    is_any,
    is_bent,
    is_block,
    is_effect,
    is_over_time,
    is_sudden,
    odds_of_block,
)
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Allowed
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import whitened
from ptt.diagnosis.evidence.witness import drifts
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.search.improve import HOPEFUL_NATS, improve
from ptt.diagnosis.search.moves import LEAST_NATS, droppable
from ptt.diagnosis.search.plainest import plainest, timed
from ptt.diagnosis.search.switching import SURE_NATS, acts_over_time, switching_moments
from ptt.diagnosis.search.turn import moment_beside
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.jumps import HEIGHTS, MOST_EVENTS
from ptt.diagnosis.unknown.laws import Switching, laws_of
from ptt.effects.sudden import Sudden

MOST_LAWS = 5  # laws kept of each place: it follows two or three variables, and one may look like another at first
# Nats against a link that jumped once: a joint that slips is the common cause, and on a closed path it looks alike
LINK_NATS = 8.0


def by_laws(scorer: Scorer, state: State) -> tuple[Scorer, State]:
    """Compare everything that may be a stand-in with laws of one variable.

    Args:
        scorer: of a linearised problem.
        state: the best set.

    Returns:
        A scorer with the laws that were tried, and the better set; both as given where no law was tried.
    """
    atoms, free = scorer.system.atoms, droppable(scorer, state)
    blocks = tuple(key for key in free if is_block(atoms[key]))
    sudden = tuple(key for key in free if is_sudden(atoms[key]))
    curves = tuple(key for key in free if is_effect(atoms[key]) and is_bent(atoms[key]))
    drifting = tuple(key for key in free if (effect := atoms[key].effect) is not None and drifts(effect))
    switching = switching_moments(scorer.system, state)
    if not (blocks or sudden or drifting or switching or scorer.system.errs_by_pose(state.memory)):
        return _of_rough_curves(scorer, state, tuple(key for key in curves if atoms[key].fine is not None))
    fewer = [without(state, *blocks), without(state, *blocks, *sudden, *drifting)]
    moments = _moments(scorer, state)
    wider, best = _with_laws(scorer, state, fewer, moments, switching), state
    for gone in dict.fromkeys([blocks, sudden, *((key,) for key in (*sudden, *drifting, *curves))]):
        if set(gone) <= set(best.keys):
            best = _instead(wider, best, gone)
    over_time = tuple(key for key in blocks if is_over_time(atoms[key]))
    both = [(*sudden, *over_time)] if sudden and over_time else []  # each takes a part of what changed at one place
    for gone in (*combinations(sudden, 2), *combinations(sudden, 3), *both):
        if set(gone) <= set(best.keys):
            best = _instead(wider, best, gone, is_spell)
    happened = tuple(key for key in droppable(wider, best) if _is_timed(wider.system.atoms[key]))
    best = _instead(wider, best, happened, is_spell) if len(moments) > MOST_EVENTS else best
    best = _switching_instead(wider, best) if switching else best
    if not any(is_block(wider.system.atoms[key]) for key in best.keys):
        return wider, best
    # A law may be as good as a broader unknown that needs names beside it; and of laws tried one after the other, each
    # may be a little less than the best. But time is no cause, so it takes the place of none.
    most = max(wider.scored.values(), key=lambda each: each.total)
    most = max(most, best, key=lambda each: each.total)
    plain = plainest(wider, most, nothing=False)
    best = plain if timed(wider, plain) <= timed(wider, best) else best
    replaced = not blocks and not set(sudden) <= set(best.keys)
    return wider, state if replaced and most.total < state.total + SURE_NATS else best


def _of_rough_curves(scorer: Scorer, state: State, rough: Sequence[str]) -> tuple[Scorer, State]:
    """`by_laws` for a set whose only possible stand-ins are curves with fine detail.

    Fine detail of one joint's curve can imitate a spot or a step, which a law over its travel explains with less.
    """
    if not rough:
        return scorer, state
    system = rows_of(scorer.system)
    known, own = sum(is_block(atom) for atom in system.atoms.values()), list[Block]()
    for blocks in laws_of(system.at.problem, system.at.chain):
        own += [block for block in blocks if block.is_curve and block.place.kind == "slider"]
    wider, best = _widened(scorer, own, odds_of_block(known + len({block.name for block in own}))), state
    for key in rough:
        best = _instead(wider, best, (key,))
    return wider, best


def _moments(scorer: Scorer, state: State) -> list[float]:
    """Moments of a set's new sudden effects, by the clock, ascending; where it has none, the one that bends over time.

    Smooth functions of time that vary over the workspace follow what changed once, and leave nothing of its moment.
    """
    atoms, free = scorer.system.atoms, droppable(scorer, state)
    moments = {moment for key in free if (moment := atoms[key].moment) is not None}
    bends = [key for key in free if is_over_time(atoms[key])]
    if bends and not moments:
        sudden = {atom.effect.key: atom.effect for atom in atoms.values() if isinstance(atom.effect, Sudden)}
        moments = {float(moment_beside(scorer, state, bends, effect)["after"]) for effect in sudden.values()}
    return sorted(moments)


def _is_timed(atom: Atom) -> bool:
    return is_sudden(atom) or is_spell(atom)


def is_law(atom: Atom) -> bool:
    """Whether an atom is a law of one variable."""
    return atom.block is not None and atom.block.is_law


def is_spell(atom: Atom) -> bool:
    """Whether an atom is a law of something that came and went, or changed once by amounts that vary."""
    return atom.block is not None and atom.block.is_spell


def is_broad(atom: Atom) -> bool:
    """Whether an atom is an unknown that is no law of one variable."""
    return is_block(atom) and not is_law(atom)


def _instead(
    scorer: Scorer, state: State, gone: Sequence[str], allowed: Allowed = is_law, memory: Memory | None = None
) -> State:
    """The best set with laws in the place of some of its atoms, or of its memory; as given where none is better."""
    sudden = any(is_sudden(scorer.system.atoms[key]) for key in gone)
    fewer = scorer.score(without(state, *gone), memory or state.memory, state.variances)
    laws = improve(scorer, fewer, allowed, swaps=False)
    if laws.total < state.total - HOPEFUL_NATS:
        return state
    best = improve(scorer, laws, _lasts if sudden else is_any, swaps=False)
    return plainest(scorer, best) if best.total > state.total + LEAST_NATS else state


def _switching_instead(scorer: Scorer, state: State) -> State:
    """The best set with levels in the place of a wander and of all that acts over time alone, where that is better."""
    over_time = acts_over_time(scorer.system, state)
    gone = tuple(key for key in droppable(scorer, state) if key in over_time)
    still = replace(state.memory, wander=None)
    return max((_instead(scorer, state, gone, is_spell, memory=still), state), key=lambda each: each.total)


def _lasts(atom: Atom) -> bool:
    return not is_sudden(atom)


def _with_laws(
    scorer: Scorer,
    state: State,
    sets: Sequence[Sequence[str]],
    moments: Sequence[float],
    switching: Switching,
) -> Scorer:
    """A scorer with the best laws of each place beside some sets; all laws together would fill gigabytes."""
    system = rows_of(scorer.system)
    places = list(laws_of(system.at.problem, system.at.chain, moments, switching))
    known = sum(is_block(atom) for atom in system.atoms.values())
    odds = odds_of_block(known + sum(len({block.name for block in blocks}) for blocks in places))
    few = Scorer(system.only(state.keys), scorer.given)
    beside = [few.score(keys, state.memory, state.variances) for keys in dict.fromkeys(map(tuple, sets))]
    few.system.sums(state.memory)  # cached once for the laws of all places
    kept = list[Block]()
    for blocks in places:
        wider = _widened(few, blocks, odds)
        gains = [gain for fewer in beside for gain in wider.screen(fewer, is_law)[:MOST_LAWS]]
        names = {wider.system.atoms[gain.key].name for gain in gains}
        kept += [block for block in blocks if block.name in names or block.is_spell]
    system.forget()  # extending the cached sums of every memory would take longer than making the few that are needed
    return _widened(scorer, kept, odds)


def _widened(scorer: Scorer, blocks: Sequence[Block], odds: float) -> Scorer:
    """A scorer with some laws added."""
    return with_atoms(scorer, [_priced(atom, odds) for atom in atoms_of_blocks(blocks, 0, odds).values()])


def with_atoms(scorer: Scorer, laws: Sequence[Atom]) -> Scorer:
    """A scorer with further blocks' atoms, at their own prior odds.

    Args:
        scorer: of a linearised problem.
        laws: atoms of blocks.

    Returns:
        The scorer, as given where there are none.
    """
    blocks = [law.block for law in laws if law.block is not None]
    if not blocks:
        return scorer
    system = rows_of(scorer.system)
    columns = whitened(blocks, system.noise, system.rows)
    return scorer.widened(system.widened({law.key: law for law in laws}, columns, np.ones(columns.shape[2])))


def _priced(atom: Atom, odds: float) -> Atom:
    """A law's atom with the odds of choosing the values at which it jumps."""
    assert atom.block is not None
    rare = LINK_NATS if atom.block.place.kind == "link" and atom.block.is_spell and len(atom.block.jumps) == 1 else 0.0
    return replace(atom, odds=odds + len(atom.block.jumps) * SHAPE_POWER * float(np.log(HEIGHTS)) + rare)
