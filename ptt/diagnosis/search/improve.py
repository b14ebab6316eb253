"""Local search: move from a set of atoms to better ones until none is found."""

from collections.abc import Sequence

from ptt.diagnosis.evidence.atoms import is_any
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Allowed
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.search.moves import LEAST_NATS, plain_moves, slow_moves

MOST_MOVES = 16  # moves of one ascent
SLOW_BELOW = 8.0  # nats: swaps are tried only where the plain moves gain less, and pursued if they lose less
SWAPS_PURSUED = 2  # swaps losing a little from which plain moves are tried
MOST_SCREENS = 150  # screened sets beyond which no swaps are tried: a machine with a few faults needs far fewer
HOPEFUL_NATS = 40.0  # nats by which the first step of a search may lie behind the set that it is to replace


def climb(scorer: Scorer, state: State, allowed: Allowed = is_any) -> State:
    """Add and drop atoms and change the memory of the noise until nothing is gained; no swaps.

    Args:
        scorer: of the system.
        state: to start from.
        allowed: atoms that may be added.

    Returns:
        A local maximum.
    """
    for _ in range(MOST_MOVES):
        state = improve(scorer, state, allowed, swaps=False)
        memory, gained = scorer.best_memory(state)
        if memory == state.memory or gained <= 0.0:
            return state
        other = scorer.score(state.keys, memory, state.variances)
        if not other.total > state.total + LEAST_NATS:
            return state
        state = other
    return state


def improve(scorer: Scorer, state: State, allowed: Allowed = is_any, *, swaps: bool = True) -> State:
    """Move to better states until none is found.

    Args:
        scorer: of the system.
        state: to start from.
        allowed: atoms that may be added.
        swaps: try swaps and memories of the noise where adding and dropping gain little.

    Returns:
        A local maximum; the best set so far where `MOST_SCREENS` were reached.
    """
    for _ in range(MOST_MOVES):
        best = max(plain_moves(scorer, state, allowed), key=lambda other: other.total, default=state)
        if swaps and best.total < state.total + SLOW_BELOW and scorer.screened_count < MOST_SCREENS:
            slow = slow_moves(scorer, state, allowed)
            best = max([best, *slow], key=lambda other: other.total)
            if not best.total > state.total + LEAST_NATS:
                best = max([best, *_beyond(scorer, state, slow, allowed)], key=lambda other: other.total)
        if not best.total > state.total + LEAST_NATS:
            return state
        state = best
    return state


def _beyond(scorer: Scorer, state: State, moves: Sequence[State], allowed: Allowed) -> list[State]:
    """Local maxima reached from swaps that lose a little: the atom that went may have kept out others."""
    near = sorted((other for other in moves if other.total > state.total - SLOW_BELOW), key=lambda other: -other.total)
    return [improve(scorer, other, allowed, swaps=False) for other in near[:SWAPS_PURSUED]]
