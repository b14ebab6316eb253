"""Search: the set of atoms with the highest score, by adding, dropping and swapping."""

from collections.abc import Sequence

from ptt.diagnosis.atoms import Atom, causes, is_any, is_block, is_effect, is_metrology
from ptt.diagnosis.memory import WHITE
from ptt.diagnosis.moves import NEAR, SEEN, TRIED, added, loose, plain_moves, slow_moves, without, worth_a_try
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.screen import Allowed
from ptt.diagnosis.state import State
from ptt.diagnosis.witness import drifts

ROUNDS = 16
LEAST = 0.3  # nats that a move has to gain
SLOW_BELOW = 8.0  # nats: swaps are looked for only where the plain moves bring less, and gone past if they lose less
PAST = 2  # swaps that lose a little from which plain moves are tried
SCREENS = 150  # sets screened from which swaps are looked for no more: a machine with a few faults asks for far fewer
HOPEFUL = 40.0  # nats by which the first step of a search may lie behind the set that it is to replace
PLAIN = 5.0  # nats that more unknowns, or more names, have to bring: less is no reason to accuse a machine
FEW = 12  # columns up to which an effect is a plain one: four values a leg


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
    return [*ends, *remembering(scorer, max(end.total for end in ends), start)]


def remembering(scorer: Scorer, best: float, start: Sequence[str] = ()) -> list[State]:
    """The set that what the noise remembers by itself leads to; none where that is far behind the best so far.

    Args:
        scorer: of the system.
        best: total of the best set so far.
        start: atoms to start from.
    """
    alone = scorer.score(start, scorer.best_memory(scorer.score(start, WHITE))[0])
    return [climb(scorer, alone)] if alone.total > best - HOPEFUL else []


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
    """Ask what plain effects do in the place of one that can do several's work, and beside it where it is a curve.

    Args:
        scorer: of the system.
        best: a set to which no plain move adds anything.

    Returns:
        The best set found.
    """
    for key in loose(scorer, best):
        for other in (_instead_of, _beside):
            if key in best.keys and len(scorer.system.atoms[key].columns) > FEW:
                best = other(scorer, best, key)
        if key in best.keys:
            best = _commoner(scorer, best, key)
    return _asked_of_tracker(scorer, best)


def _instead_of(scorer: Scorer, best: State, key: str) -> State:
    """A set with as many plain effects as it takes in the place of a curve, which may come back beside them.

    Swaps one for one never find those: none of them alone is worth as much.
    """
    fewer = scorer.score(without(best, key), best.memory, best.scales)
    if not worth_a_try(scorer, fewer, is_plain):
        return best
    plain = improve(scorer, fewer, is_plain, swaps=False)
    if set(plain.keys) <= set(fewer.keys):  # none takes its place: what another curve can do, a swap has tried
        return best
    other = improve(scorer, plain, swaps=False)
    return improve(scorer, other) if other.total > best.total + LEAST else best


def _beside(scorer: Scorer, best: State, key: str) -> State:
    """A set with plain effects that take from a curve what is theirs; with those alone whose slope and level it has.

    The screen holds the curve as wide as it is. That the rest of it is narrower once its slope has a name, only an
    exact score tells.
    """
    near = [gain for gain in scorer.screen(best, is_plain) if gain.nats > SEEN - NEAR]
    tried = [added(scorer, best, gain) for gain in near[:TRIED]]
    lenders = _lenders(scorer, best, key)
    if lenders:
        tried.append(scorer.score((*without(best, key), *lenders), best.memory, best.scales))
    other = max(tried, key=lambda state: state.total, default=best)
    return improve(scorer, other) if other.total > best.total + LEAST else best


def _commoner(scorer: Scorer, best: State, key: str) -> State:
    """A set with the commoner causes that an effect looks like together in its place, as far as they are needed.

    None of them alone is worth as much, and what comes first without the effect may be yet another.
    """
    there = commoner(scorer, best, key)
    if there is None:
        return best
    other = improve(scorer, there, is_plain, swaps=False)
    return improve(scorer, other) if other.total > best.total + LEAST else best


def commoner(scorer: Scorer, state: State, key: str) -> State | None:
    """A set with all the commoner causes that an effect of it looks like together in its place.

    Args:
        scorer: of the system.
        state: a set.
        key: of the effect's atom.

    Returns:
        The set; None where the effect looks like itself alone, or where one of these may not stand beside the others.
    """
    effect = scorer.system.atoms[key].effect
    if effect is None or not effect.stands_for:
        return None
    rest = without(state, key)
    names = set(effect.stands_for) - {scorer.system.atoms[other].name for other in rest}
    coming = _coming(scorer, rest, names)
    return scorer.score((*rest, *coming), state.memory, state.scales) if 0 < len(names) == len(coming) else None


def _lenders(scorer: Scorer, state: State, key: str) -> list[str]:
    """Atoms of the effects beyond a set whose own cause slope and level of one of its curves are."""
    effect = scorer.system.atoms[key].effect
    names = {name for parameter in effect.parameters for name in parameter.lent} if effect is not None else set()
    return _coming(scorer, without(state, key), names)


def _coming(scorer: Scorer, keys: Sequence[str], names: set[str]) -> list[str]:
    """An atom of each effect of some names that may come beside a set and the others."""
    found = list[str]()
    for name in sorted(names):
        may_come = scorer.opens([*keys, *found])
        found += [key for key, atom in scorer.system.atoms.items() if atom.name == name and may_come(atom)][:1]
    return found


def _asked_of_tracker(scorer: Scorer, best: State) -> State:
    """Take each effect of the machine out in turn for all that the tracker may have done instead, and the other way.

    A machine that is corrected for what the tracker did is worse off than before, and so is one that is not for what
    it did itself. Either may have done two things at once, which no swap one for one finds.
    """
    for key in loose(scorer, best):
        atom = scorer.system.atoms[key]
        if key in best.keys and atom.effect is not None:
            fewer = scorer.score(without(best, key), best.memory, best.scales)
            other = improve(scorer, fewer, _is_of_machine if is_metrology(atom) else is_metrology, swaps=False)
            if other.total > best.total + LEAST:
                best = improve(scorer, other)
    return best


def _is_of_machine(atom: Atom) -> bool:
    return is_plain(atom) and not is_metrology(atom)


def is_plain(atom: Atom) -> bool:
    """Whether an atom is an effect of a few values, no curve that bends to anything."""
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
        best = max(plain_moves(scorer, state, allowed), key=lambda other: other.total, default=state)
        if swaps and best.total < state.total + SLOW_BELOW and scorer.looked_at < SCREENS:
            slow = slow_moves(scorer, state, allowed)
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


def plainest(scorer: Scorer, best: State, *, nothing: bool = True) -> State:
    """Of the sets that do nearly as well as the best, the one that says least.

    Args:
        scorer: that has scored them.
        best: the best set.
        nothing: whether a set may say nothing at all though another is likelier.

    Returns:
        The set with the fewest parts, a name before an unknown; of these the one with the fewest curves, for what bends
        to anything says little, and of a few rows no more than an unknown does; then the one with the fewest unknowns
        that follow the time, which is no cause: what goes with it says more; then the best, what the model has by a
        nat before what it has not: of two that do alike each would be the better one, linearised at the other.
    """

    def plain(state: State) -> tuple[float, int, int, float]:
        least = -state.total - SEEN * is_told(scorer, state)
        return _parts(scorer, state), _bends(scorer, state), _timed(scorer, state), least

    near = [state for state in scorer.scored.values() if state.total > best.total - PLAIN]
    first = min([best, *(state for state in near if nothing or _parts(scorer, state))], key=plain)
    first = max([first, *(state for state in near if _drifts_instead(scorer, state, first))], key=lambda one: one.total)
    return scorer.score(first.keys, first.memory)


def _drifts_instead(scorer: Scorer, state: State, first: State) -> bool:
    """Whether a set has a drift of the tracker where another has a wander that outlasts the run: a drift unnamed."""
    wander, atoms = first.memory.wander, scorer.system.atoms
    if wander is None or wander.constant <= scorer.system.clock.lasts.max() or state.memory.wander is not None:
        return False
    more = [atoms[key].effect for key in set(state.keys) - set(first.keys)]
    return set(first.keys) < set(state.keys) and all(effect is not None and drifts(effect) for effect in more)


def is_told(scorer: Scorer, state: State) -> bool:
    """Whether the model has every effect of a set: only such have values, words and commands."""
    return all(scorer.system.atoms[key].shape is None for key in state.keys)


def _parts(scorer: Scorer, state: State) -> float:
    """Names and unknowns of a set, memories of the noise that are no tracker's among these; an untested one is more.

    A curve of many values is as much as an unknown, and what looks like several commoner causes as much as these.
    """
    odd = scorer.system.errs_by_pose(state.memory) or scorer.system.clock.is_fault(state.memory.wander)
    atoms = [scorer.system.atoms[key] for key in loose(scorer, state)]
    unknowns, untested = sum(atom.block is not None for atom in atoms), sum(not atom.tested for atom in atoms)
    names = sum(1 if atom.effect is None else causes(atom.effect) for atom in atoms)
    return names + 0.5 * (unknowns + _curves(scorer, state)) + 0.25 * untested + 1.5 * odd


def _bends(scorer: Scorer, state: State) -> int:
    """Curves and unknowns of a set."""
    unknowns = sum(scorer.system.atoms[key].block is not None for key in loose(scorer, state))
    return _curves(scorer, state) + unknowns


def _timed(scorer: Scorer, state: State) -> int:
    """Unknowns of a set that follow the time."""
    blocks = [scorer.system.atoms[key].block for key in state.keys]
    return sum(block is not None and "time" in block.on for block in blocks)


def _curves(scorer: Scorer, state: State) -> int:
    """Effects of a set that are curves of many values."""
    atoms = [scorer.system.atoms[key] for key in loose(scorer, state)]
    return sum(atom.effect is not None and len(atom.columns) > FEW for atom in atoms)
