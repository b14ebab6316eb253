"""Search: the set of atoms with the highest score, by adding, dropping and swapping."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from ptt.diagnosis.atoms import Atom, is_any, is_block, is_effect, is_metrology
from ptt.diagnosis.memory import WHITE
from ptt.diagnosis.probability import TEMPER
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.screen import Allowed, Gain
from ptt.diagnosis.state import State

ROUNDS = 16
LEAST = 0.3  # nats that a move has to gain
SEEN = 1.0  # nats by the screen from which an atom is worth an exact score
TRIED, EFFECTS_TRIED = 3, 2  # leaders of the screen that are scored exactly, and effects beside them
SLOW_BELOW = 8.0  # nats: swaps are looked for only where the plain moves bring less, and gone past if they lose less
MISJUDGED = 5.0  # nats by which variances that are learned anew may change what goes before any screen
NEAR = 15.0  # nats by the screen within which another may do better than the one that goes
SWAPS = 3
PAST = 2  # swaps that lose a little from which plain moves are tried
SCREENS = 150  # sets screened from which swaps are looked for no more: a machine with a few faults asks for far fewer
HOPEFUL = 40.0  # nats by which the first step of a search may lie behind the set that it is to replace
PLAIN = 5.0  # nats that more unknowns, or more names, have to bring: less is no reason to accuse a machine
FEW = 12  # columns up to which an effect is a plain one: four values a leg
SAFE = 40.0  # nats by Wald's statistic from which dropping an atom is not worth a try
FREED = 10.0  # nats beyond its odds that an atom may bring by going: variances of others that it held up
FAR = 8.0 * TEMPER  # nats below the best from which a set weighs nothing beside it: its score need not be exact
PLAINLY = 60.0  # nats that another memory of the noise brings from which swaps wait: no swap brings nearly as much


def search(scorer: Scorer) -> State:
    """Find the best set of atoms."""
    return best_of(scorer, ends_of(scorer))


def ends_of(scorer: Scorer, start: Sequence[str] = ()) -> list[State]:
    """The sets that adding and dropping lead to.

    What effects explain by themselves, blocks are added to, and the other way round; both at once; and what the noise
    remembers by itself, where that is not far behind: of what effects have taken of a wander little is left to see.

    Args:
        scorer: of the system.
        start: atoms to start from.

    Returns:
        The ends of the ways.
    """
    first = scorer.score(start, WHITE)
    ends = [climb(scorer, climb(scorer, first, opening)) for opening in (is_effect, is_block, is_any)]
    alone = scorer.score(start, scorer.best_memory(first)[0])
    return [*ends, climb(scorer, alone)] if alone.total > max(end.total for end in ends) - HOPEFUL else ends


def best_of(scorer: Scorer, ends: Sequence[State]) -> State:
    """The best set that swaps lead to from some ends: one far behind may be a swap from what no other comes to."""
    different = {(end.keys, end.memory): end for end in ends}.values()
    return refilled(scorer, max((improve(scorer, end) for end in different), key=lambda state: state.total))


def climb(scorer: Scorer, state: State, allowed: Allowed = is_any) -> State:
    """Add, drop, and let the noise remember, until nothing is gained; swaps are looked for from such ends.

    Args:
        scorer: of the system.
        state: to start from.
        allowed: atoms that may be added.

    Returns:
        The end of the way.
    """
    for _ in range(ROUNDS):
        state = improve(scorer, state, allowed, swaps=False)
        memory, gained = scorer.best_memory(state)
        if memory == state.memory or gained <= 0.0:
            return state
        other = scorer.score(state.keys, memory, state.scales)
        if not other.total > state.total + LEAST:
            return state
        state = other
    return state


def refilled(scorer: Scorer, best: State) -> State:
    """Take each curve of a set out in turn for as many plain effects as it takes: one curve can do several's work.

    Swaps one for one never find those: none of them alone is worth as much. The curve may come back beside them.

    Args:
        scorer: of the system.
        best: a set to which no plain move adds anything.

    Returns:
        The best set found.
    """
    for key in loose(scorer, best):
        atom = scorer.system.atoms[key]
        if key in best.keys and len(atom.columns) > FEW:
            fewer = scorer.score(without(best, key), best.memory, best.scales)
            if not any(gain.nats > SEEN for gain in scorer.screen(fewer, _is_plain)):
                continue
            plain = improve(scorer, fewer, _is_plain, swaps=False)
            if set(plain.keys) <= set(fewer.keys):  # none takes its place: what another curve can do, a swap has tried
                continue
            other = improve(scorer, plain, swaps=False)
            if other.total > best.total + LEAST:
                best = improve(scorer, other)
    return _asked_of_tracker(scorer, best)


def _asked_of_tracker(scorer: Scorer, best: State) -> State:
    """Take each effect of the machine out in turn for all that the tracker may have done instead.

    A machine that is corrected for what the tracker did is worse off than before, and it may have done two things at
    once, which no swap one for one finds.
    """
    for key in loose(scorer, best):
        effect = scorer.system.atoms[key].effect
        if key in best.keys and effect is not None and effect.stage != "metrology":
            fewer = scorer.score(without(best, key), best.memory, best.scales)
            other = improve(scorer, fewer, is_metrology, swaps=False)
            if other.total > best.total + LEAST:
                best = improve(scorer, other)
    return best


def _is_plain(atom: Atom) -> bool:
    return atom.effect is not None and len(atom.columns) <= FEW


def improve(scorer: Scorer, state: State, allowed: Allowed = is_any, *, swaps: bool = True) -> State:
    """Move to better states until none is found.

    Args:
        scorer: of the system.
        state: to start from.
        allowed: atoms that may be added.
        swaps: look for swaps and memories of the noise where adding and dropping bring little.

    Returns:
        A local maximum; the best so far where more sets were screened than any search needs.
    """
    for _ in range(ROUNDS):
        best = max(_plain_moves(scorer, state, allowed), key=lambda other: other.total, default=state)
        if swaps and best.total < state.total + SLOW_BELOW and scorer.looked_at < SCREENS:
            slow = _slow_moves(scorer, state, allowed)
            best = max([best, *slow], key=lambda other: other.total)
            if not best.total > state.total + LEAST:
                best = max([best, *_beyond(scorer, state, slow, allowed)], key=lambda other: other.total)
        if not best.total > state.total + LEAST:
            return state
        state = best
    return state


def _beyond(scorer: Scorer, state: State, moves: Sequence[State], allowed: Allowed) -> list[State]:
    """Where plain moves lead from swaps that lose a little: what went may have kept out more than what came."""
    near = sorted((other for other in moves if other.total > state.total - SLOW_BELOW), key=lambda other: -other.total)
    return [improve(scorer, other, allowed, swaps=False) for other in near[:PAST]]


def plainest(scorer: Scorer, best: State) -> State:
    """Of the sets that do nearly as well as the best, the one that says least.

    Args:
        scorer: that has scored them.
        best: the best set.

    Returns:
        The set with the fewest parts, a name before an unknown; of these the one with the fewest curves, for what bends
        to anything says little; then the best, what the model has by a nat before what it has not: of two that do alike
        each would be the better one where it is linearised at the other.
    """

    def plain(state: State) -> tuple[float, int, float]:
        return _parts(scorer, state), _bends(scorer, state), -state.total - SEEN * is_told(scorer, state)

    near = [state for state in scorer.scored.values() if state.total > best.total - PLAIN]
    first = min([best, *near], key=plain)
    return scorer.score(first.keys, first.memory)


def is_told(scorer: Scorer, state: State) -> bool:
    """Whether the model has every effect of a set: only such have values, words and commands."""
    return all(scorer.system.atoms[key].shape is None for key in state.keys)


def _parts(scorer: Scorer, state: State) -> float:
    """Names and unknowns of a set, memories of the noise that are no tracker's among these; an untested one is more."""
    odd = scorer.system.errs_by_pose(state.memory) or scorer.system.clock.is_fault(state.memory.wander)
    atoms = [scorer.system.atoms[key] for key in loose(scorer, state)]
    unknowns, untested = sum(atom.block is not None for atom in atoms), sum(not atom.tested for atom in atoms)
    return len(atoms) + 0.5 * unknowns + 0.25 * untested + 1.5 * odd


def _bends(scorer: Scorer, state: State) -> int:
    """Effects of a set that are curves of many values."""
    return sum(len(scorer.system.atoms[key].columns) > FEW for key in loose(scorer, state))


def without(state: State, *keys: str) -> tuple[str, ...]:
    """The keys of a state less some."""
    return tuple(key for key in state.keys if key not in keys)


def loose(scorer: Scorer, state: State) -> tuple[str, ...]:
    """The keys of a state that may be dropped: all but those of the model as given."""
    return without(state, *scorer.given)


def _wanders(atom: Atom) -> bool:
    """Whether an atom is something that changes in the course of the run, as the tracker's wander does."""
    if atom.effect is not None:
        return atom.effect.card is not None and atom.effect.card.telling == "time"
    return atom.block is not None and "time" in atom.block.on


def added(scorer: Scorer, state: State, gain: Gain, least: float = -np.inf) -> State:
    """A state with what the screen proposes, its variances learned on from there; `least` as in `Scorer.score`."""
    return scorer.score((*state.keys, gain.key), state.memory, {**state.scales, gain.key: gain.scales}, least)


def _plain_moves(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """One more atom, one less."""
    found = [gain for gain in scorer.screen(state, allowed) if gain.nats > SEEN]
    lead = found[:TRIED]
    lead += [gain for gain in found if is_effect(scorer.system.atoms[gain.key]) and gain not in lead][:EFFECTS_TRIED]
    moves = list[State]()
    for gain in lead:
        moves.append(added(scorer, state, gain, _least(state, moves)))
    # An atom that goes brings back little more than its odds: it is not tried where one that comes brings more.
    most = max((other.total for other in moves), default=-np.inf) - state.total - FREED
    may_go = [key for key in loose(scorer, state) if scorer.system.atoms[key].odds > most]
    weak = [key for key in may_go if state.worth(key) < SAFE]
    for key in weak:
        moves.append(scorer.score(without(state, key), state.memory, state.scales, _least(state, moves)))
    return moves


def _least(state: State, moves: Sequence[State]) -> float:
    """Total from which one more move from a state is of any interest beside others."""
    return max([state.total, *(other.total for other in moves)]) - FAR


def _remembering(scorer: Scorer, state: State, key: str) -> State:
    """Another memory of the noise in place of an atom that changes in the course of the run.

    A wander beside a jump that imitates it says little more, and the jump without it too much: one has to go for the
    other.
    """
    return _again_remembering(scorer, scorer.score(without(state, key), state.memory, state.scales))


def _again_remembering(scorer: Scorer, state: State) -> State:
    """The same atoms with the memory of the noise that suits them."""
    return scorer.score(state.keys, scorer.best_memory(state)[0], state.scales)


def _less_remembering(scorer: Scorer, white: State, allowed: Allowed) -> list[State]:
    """What does most where nothing is remembered, and beside it what is left to remember.

    A slow wander follows all that changes slowly, and leaves nothing for what really did.

    Args:
        scorer: of the system.
        white: a set without a memory of the noise.
        allowed: atoms that may be added.
    """
    leaders = scorer.screen(white, lambda atom: allowed(atom) and _wanders(atom))[:1]
    return [_again_remembering(scorer, added(scorer, white, gain)) for gain in leaders if gain.nats > SEEN]


def _slow_moves(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """Another memory of the noise, and swaps of atoms, or of the memory, for others."""
    moves: list[State] = []
    memory, gained = scorer.best_memory(state)
    if gained > 0.0 and memory != state.memory:
        moves.append(scorer.score(state.keys, memory, state.scales))
        if moves[0].total > state.total + PLAINLY:
            return moves
    may_go = loose(scorer, state)
    less = list[tuple[State, set[str] | None]]()
    for key, others in scorer.replacements(state, may_go, allowed, NEAR + MISJUDGED).items():
        if others:
            less.append((scorer.score(without(state, key), state.memory, state.scales), others))
    if state.memory != WHITE:
        moves.append(scorer.score(state.keys, WHITE, state.scales))
        less.append((moves[-1], None))
        moves += _less_remembering(scorer, moves[-1], allowed)
    else:
        moves += [_remembering(scorer, state, key) for key in may_go if _wanders(scorer.system.atoms[key])]
    for fewer, few in less:
        moves += _swapped(scorer, state, fewer, partial(_is_among, few, allowed))
    return moves


def _is_among(keys: set[str] | None, allowed: Allowed, atom: Atom) -> bool:
    return allowed(atom) and (keys is None or atom.key in keys)


def _swapped(scorer: Scorer, state: State, fewer: State, allowed: Allowed) -> list[State]:
    """The atoms that do best beside fewer than a state's."""
    names = {key: scorer.system.atoms[key].name for key in state.keys}
    gone = {names[key] for key in set(state.keys) - set(fewer.keys)}
    found = [
        (gain, scorer.system.atoms[gain.key].name)
        for gain in scorer.screen(fewer, lambda atom: allowed(atom) or atom.name in gone)
    ]
    # The screen holds the others' variances, so what it says of the one that went is what to compare with.
    usual = max((gain.nats for gain, name in found if name in gone), default=state.total - fewer.total)
    near = [gain for gain, name in found if name not in gone and gain.nats > max(usual - NEAR, SEEN)]
    return [added(scorer, fewer, gain, state.total - FAR) for gain in near[:SWAPS]]
