"""Search for the set of atoms with the highest score from several starts, by adding, dropping and swapping."""

from collections.abc import Sequence

from ptt.diagnosis.evidence.atoms import is_any, is_block, is_effect
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.improve import HOPEFUL_NATS, climb, improve
from ptt.diagnosis.search.instead import refilled


def search(scorer: Scorer) -> State:
    """Find the best set of atoms."""
    return best_of(scorer, ends_of(scorer))


def ends_of(scorer: Scorer, start: Sequence[str] = ()) -> list[State]:
    """Local maxima reached by adding and dropping from four kinds of start.

    Effects first and then blocks, blocks first and then effects, both at once; and a memory of the noise first, unless
    it is far behind: once effects have absorbed a wander, little of it is left to be seen.

    Args:
        scorer: of the system.
        start: keys of atoms to start from.

    Returns:
        The local maxima.
    """
    first = scorer.score(start, WHITE)
    ends = [climb(scorer, climb(scorer, first, opening)) for opening in (is_effect, is_block, is_any)]
    return [*ends, *remembering(scorer, max(end.total for end in ends), start)]


def remembering(scorer: Scorer, best: float, start: Sequence[str] = ()) -> list[State]:
    """The local maximum from the best memory of the noise alone; none where that is far behind the best so far.

    Args:
        scorer: of the system.
        best: total of the best set so far.
        start: atoms to start from.
    """
    alone = scorer.score(start, scorer.best_memory(scorer.score(start, WHITE))[0])
    return [climb(scorer, alone)] if alone.total > best - HOPEFUL_NATS else []


def best_of(scorer: Scorer, ends: Sequence[State]) -> State:
    """The best set reached by swaps from some local maxima, each of which is tried, and then by `refilled`."""
    different = {(end.keys, end.memory): end for end in ends}.values()
    return refilled(scorer, max((improve(scorer, end) for end in different), key=lambda state: state.total))
