"""Moves from one set of atoms to others: one more, one less, one for another, another memory of the noise."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_effect
from ptt.diagnosis.evidence.probability import TEMPER
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Allowed, Gain
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import WHITE

SEEN_NATS = 1.0  # nats by the screen from which an atom is worth an exact score
TRIED, EFFECTS_TRIED = 3, 2  # leaders of the screen that are scored exactly, and further effects beside them
# Nats by which the screen may be off, as it does not learn the variances anew: 15 lost sizes of the drawing
SCREEN_ERROR = 20.0
SWAPS_TRIED = 3  # atoms scored exactly in the place of each that goes
SCREEN_FACTOR = 1.5  # times the screen's gain that an atom may bring: in 93 choices of a real arm it lost no best one
LEAST_NATS = 0.3  # nats that a move has to gain
# Nats below the best from which a set has no weight in any probability, so its score need not be exact
FAR_BELOW = 8.0 * TEMPER
MEMORY_FIRST = 60.0  # nats gained by another memory of the noise from which swaps wait: no swap gains nearly as much


def droppable(scorer: Scorer, state: State) -> tuple[str, ...]:
    """The keys of a state that may be dropped: all but those of the model as given."""
    return without(state, *scorer.given)


def _wanders(atom: Atom) -> bool:
    """Whether an atom is something that changes in the course of the run, as the tracker's wander does."""
    if atom.effect is not None:
        return atom.effect.card is not None and atom.effect.card.telling == "time"
    return atom.block is not None and "time" in atom.block.on


def added(scorer: Scorer, state: State, gain: Gain, least: float = -np.inf) -> State:
    """A state with what the screen proposes, its variances learned on from there; `least` as in `Scorer.score`."""
    return scorer.score((*state.keys, gain.key), state.memory, {**state.variances, gain.key: gain.variances}, least)


def plain_moves(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """One more atom, one less; what hardly makes a set likelier only where nothing else does."""
    moves = _more(scorer, state, allowed)
    # An atom that goes brings back little more than its odds: it is not tried where one that comes brings more.
    # From a set that cannot be, and stays so whatever comes, any may go.
    most = max((other.total for other in moves), default=-np.inf)
    odds = {key: scorer.system.atoms[key].odds + SCREEN_ERROR for key in droppable(scorer, state)}
    may_go = [key for key in odds if state.total + odds[key] >= most]
    if np.isfinite(state.total):
        may_go = [key for key in may_go if state.worth(key) < odds[key]]
    return moves + _less(scorer, state, may_go, moves)


def _more(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """One more atom: leaders of the screen, as long as they may do better than those before them."""
    found = worth_a_try(scorer, state, allowed)
    lead = found[:TRIED]
    lead += [gain for gain in found if is_effect(scorer.system.atoms[gain.key]) and gain not in lead][:EFFECTS_TRIED]
    moves = list[State]()
    for gain in lead:
        ahead = max((other.total for other in moves), default=-np.inf)
        if not np.isfinite(state.total) or ahead < state.total + SCREEN_FACTOR * gain.nats + SCREEN_ERROR:
            moves.append(added(scorer, state, gain, _least(state, moves)))
    return moves


def _less(scorer: Scorer, state: State, gone: Sequence[str], moves: Sequence[State]) -> list[State]:
    """One atom less, for each that may go."""
    found = list[State]()
    for key in gone:
        least = _least(state, [*moves, *found])
        found.append(scorer.score(without(state, key), state.memory, state.variances, least))
    return found


def worth_a_try(scorer: Scorer, state: State, allowed: Allowed) -> list[Gain]:
    """What the screen says of atoms that a set may ask for; from one that cannot be, anything may be the way out.

    Args:
        scorer: of the system.
        state: the set.
        allowed: atoms that may be added.

    Returns:
        Best first.
    """
    least = SEEN_NATS if np.isfinite(state.total) else -np.inf
    return [gain for gain in scorer.screen(state, allowed) if gain.nats > least]


def _least(state: State, moves: Sequence[State]) -> float:
    """Total from which one more move from a state is of any interest beside others."""
    return max([state.total, *(other.total for other in moves)]) - FAR_BELOW


def remember_instead(scorer: Scorer, state: State, key: str) -> State:
    """Another memory of the noise in place of an atom that changes in the course of the run.

    A wander beside a jump that imitates it says little more, and the jump without it too much: one has to go for the
    other.

    Args:
        scorer: of the system.
        state: a set.
        key: of the atom that goes.
    """
    return _again_remembering(scorer, scorer.score(without(state, key), state.memory, state.variances))


def _again_remembering(scorer: Scorer, state: State) -> State:
    """The same atoms with the memory of the noise that suits them."""
    return scorer.score(state.keys, scorer.best_memory(state)[0], state.variances)


def _less_remembering(scorer: Scorer, white: State, allowed: Allowed) -> list[State]:
    """What does most where nothing is remembered, and beside it what is left to remember.

    A slow wander follows all that changes slowly, and leaves nothing for what really did.

    Args:
        scorer: of the system.
        white: a set without a memory of the noise.
        allowed: atoms that may be added.
    """
    leaders = scorer.screen(white, lambda atom: allowed(atom) and _wanders(atom))[:1]
    return [_again_remembering(scorer, added(scorer, white, gain)) for gain in leaders if gain.nats > SEEN_NATS]


def slow_moves(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """Another memory of the noise, and swaps of atoms, or of the memory, for others."""
    moves: list[State] = []
    memory, gained = scorer.best_memory(state)
    if gained > 0.0 and memory != state.memory:
        moves.append(scorer.score(state.keys, memory, state.variances))
        if moves[0].total > state.total + MEMORY_FIRST:
            return moves
    may_go = droppable(scorer, state)
    less = list[tuple[State, set[str] | None]]()
    for key, others in scorer.replacements(state, may_go, allowed, SCREEN_ERROR).items():
        if others:
            less.append((scorer.score(without(state, key), state.memory, state.variances), others))
    if state.memory != WHITE:
        moves.append(scorer.score(state.keys, WHITE, state.variances))
        less.append((moves[-1], None))
        moves += _less_remembering(scorer, moves[-1], allowed)
    else:
        moves += [remember_instead(scorer, state, key) for key in may_go if _wanders(scorer.system.atoms[key])]
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
    # The screen holds the others' variances, so what it says of the one that went is what to compare with, but for what
    # no screen knows of that.
    form = sum(state.forms.get(key, 0.0) for key in set(state.keys) - set(fewer.keys))
    usual = max((gain.nats + form for gain, name in found if name in gone), default=state.total - fewer.total)
    near = [gain for gain, name in found if name not in gone and gain.nats > max(usual - SCREEN_ERROR, SEEN_NATS)]
    return [added(scorer, fewer, gain, state.total - FAR_BELOW) for gain in near[:SWAPS_TRIED]]
