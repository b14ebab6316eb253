"""Moves between sets of atoms: add one, drop one, swap one, or change the memory of the noise."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_effect, is_timely
from ptt.diagnosis.evidence.probability import TEMPER
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Allowed, Gain
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.swap import replacements
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
    """Keys of a set's atoms that may be dropped: all but those of the model as given."""
    return without(state, *scorer.given)


def added(scorer: Scorer, state: State, gain: Gain, least: float = -np.inf) -> State:
    """The set with an atom that the screen proposes, scored exactly; `least` as in `Scorer.score`."""
    return scorer.score((*state.keys, gain.key), state.memory, {**state.variances, gain.key: gain.variances}, least)


def plain_moves(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """Sets with one atom added or dropped, as far as they may be the best of these."""
    moves = _more(scorer, state, allowed)
    # Dropping an atom gains little more than its odds, so it is not tried where an addition gains more. From a set that
    # physics excludes, any atom may be dropped.
    most = max((other.total for other in moves), default=-np.inf)
    odds = {key: scorer.system.atoms[key].odds + SCREEN_ERROR for key in droppable(scorer, state)}
    may_go = [key for key in odds if state.total + odds[key] >= most]
    if np.isfinite(state.total):
        may_go = [key for key in may_go if state.worth(key) < odds[key]]
    return moves + _less(scorer, state, may_go, moves)


def _more(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """Sets with one atom added: leaders of the screen, as long as one may beat those before it."""
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
    """Sets with one of some atoms dropped."""
    found = list[State]()
    for key in gone:
        least = _least(state, [*moves, *found])
        found.append(scorer.less(state, key, least=least))
    return found


def worth_a_try(scorer: Scorer, state: State, allowed: Allowed) -> list[Gain]:
    """Gains of atoms that are worth an exact score; of all atoms beside a set that physics excludes.

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
    """Score from which a further move is of interest beside the set and other moves."""
    return max([state.total, *(other.total for other in moves)]) - FAR_BELOW


def with_memory_instead(scorer: Scorer, state: State, key: str) -> State:
    """The set with the best memory of the noise in the place of an atom that changes with time.

    A wander beside a jump that imitates it gains little, and so does dropping the jump: both have to change at once.

    Args:
        scorer: of the system.
        state: a set.
        key: of the atom that goes.
    """
    return _with_best_memory(scorer, scorer.less(state, key))


def _with_best_memory(scorer: Scorer, state: State) -> State:
    """The same atoms with the best memory of the noise for them."""
    return scorer.score(state.keys, scorer.best_memory(state)[0], state.variances)


def _from_white(scorer: Scorer, white: State, allowed: Allowed) -> list[State]:
    """The atom changing with time that gains most under white noise, with the best memory of the noise beside it.

    A slow wander absorbs all slow changes and leaves nothing for the effect that caused them.
    """
    leaders = scorer.screen(white, lambda atom: allowed(atom) and is_timely(atom))[:1]
    return [_with_best_memory(scorer, added(scorer, white, gain)) for gain in leaders if gain.nats > SEEN_NATS]


def slow_moves(scorer: Scorer, state: State, allowed: Allowed) -> list[State]:
    """Sets with another memory of the noise, and with atoms or the memory swapped for others."""
    moves: list[State] = []
    memory, gained = scorer.best_memory(state)
    if gained > 0.0 and memory != state.memory:
        moves.append(scorer.score(state.keys, memory, state.variances))
        if moves[0].total > state.total + MEMORY_FIRST:
            return moves
    may_go = droppable(scorer, state)
    less = list[tuple[State, set[str] | None]]()
    for key, others in replacements(scorer, state, may_go, allowed, SCREEN_ERROR).items():
        if others:
            less.append((scorer.less(state, key), others))
    if state.memory != WHITE:
        moves.append(scorer.score(state.keys, WHITE, state.variances))
        less.append((moves[-1], None))
        moves += _from_white(scorer, moves[-1], allowed)
    else:
        moves += [with_memory_instead(scorer, state, key) for key in may_go if is_timely(scorer.system.atoms[key])]
    for fewer, few in less:
        moves += _swapped(scorer, state, fewer, partial(_is_among, few, allowed))
    return moves


def _is_among(keys: set[str] | None, allowed: Allowed, atom: Atom) -> bool:
    return allowed(atom) and (keys is None or atom.key in keys)


def _swapped(scorer: Scorer, state: State, fewer: State, allowed: Allowed) -> list[State]:
    """Sets with the best atoms added to a set from which one was dropped."""
    names = {key: scorer.system.atoms[key].name for key in state.keys}
    gone = {names[key] for key in set(state.keys) - set(fewer.keys)}
    found = [
        (gain, scorer.system.atoms[gain.key].name)
        for gain in scorer.screen(fewer, lambda atom: allowed(atom) or atom.name in gone)
    ]
    # The screen holds the others' variances, so gains are compared with the screened gain of the atom that was dropped,
    # plus the nats of its form, which no screen contains.
    form = sum(state.forms.get(key, 0.0) for key in set(state.keys) - set(fewer.keys))
    usual = max((gain.nats + form for gain, name in found if name in gone), default=state.total - fewer.total)
    near = [gain for gain, name in found if name not in gone and gain.nats > max(usual - SCREEN_ERROR, SEEN_NATS)]
    return [added(scorer, fewer, gain, state.total - FAR_BELOW) for gain in near[:SWAPS_TRIED]]
