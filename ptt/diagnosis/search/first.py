"""First steps of a search: isolated rows set aside, and the search from an empty set."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import is_effect, is_sudden
from ptt.diagnosis.evidence.memories import FAR_BEHIND
from ptt.diagnosis.evidence.noise_level import stated_noise, visit_left, wanders_beyond
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.noise.gross import gross_errors, places_of
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.excess import NOISE_EXCESS
from ptt.diagnosis.search.improve import climb
from ptt.diagnosis.search.moves import droppable, with_memory_instead
from ptt.diagnosis.search.search import best_of, ends_of, remembering
from ptt.diagnosis.search.shapes import with_moments
from ptt.diagnosis.search.turn import best_moments, gross_beside, in_company
from ptt.effects import Effect
from ptt.fitting.linear import Linear, few_shapes
from ptt.run.problem import Problem

NEIGHBOURS = (1, 1, 0, 1, 1)  # convolution kernel: two rows before and after one, itself left out


def sift(linear: Linear, problem: Problem) -> np.ndarray:
    """Isolated rows that neither the model nor all effects together explain, (n,) bool."""
    saturated = few_shapes(linear.trials, linear.simple)
    return gross_errors(linear.columns, linear.values, linear.rows, linear.simple, saturated, places_of(problem))


def sift_again(scorer: Scorer, candidates: Sequence[Effect], gross: np.ndarray) -> np.ndarray:
    """Isolated rows far from what named effects explain: lasting effects first, then sudden ones as well.

    A flexible law would fit such a row and hide it, and so would two events just before and after it. Where several are
    next to each other, or belong to one place, it may be unknown physics: then all stay until unknowns were tried.

    Args:
        scorer: of the system, nothing scored yet.
        candidates: effects that may be missing.
        gross: rows left out so far, (n,) bool.

    Returns:
        The given rows and these, (n,) bool.
    """
    nothing = scorer.score((), WHITE)
    lasting = climb(scorer, nothing, lambda atom: is_effect(atom) and not is_sudden(atom))
    lone = _with_isolated_rows(scorer, lasting, gross, robust=True)
    if not np.array_equal(lone, gross):
        return lone
    named = climb(scorer, nothing, is_effect)
    scorer, dates = dated(scorer, named, candidates)
    if dates is not None:  # moments to the row: rows between a coarse moment and the true one would look like that
        named = climb(scorer, scorer.score(dates, WHITE), is_effect)
    return _with_isolated_rows(scorer, named, gross)


def _with_isolated_rows(scorer: Scorer, state: State, gross: np.ndarray, *, robust: bool = False) -> np.ndarray:
    """Rows left out so far, and rows far from a set if all of them are isolated, (n,) bool."""
    system = rows_of(scorer.system)
    white = scorer.score(state.keys, WHITE)
    far = gross_beside(system, white, gross, robust=robust) & ~gross
    company = (np.convolve(far, NEIGHBOURS, "same") > 0) | in_company(system, scorer.score((), WHITE))
    return gross if (far & company).any() else gross | far


def search_first(scorer: Scorer, candidates: Sequence[Effect]) -> tuple[Scorer, State]:
    """The best set from an empty start, with sudden effects placed to the row before swaps are tried.

    The moments tried at first are so far apart that curves would make up for the rows in between, and stay.

    Args:
        scorer: of the system.
        candidates: effects that may be missing.

    Returns:
        A scorer that knows the moments, and the set.
    """
    ends = ends_of(scorer)
    first = max(ends, key=lambda end: (_searches_moments(scorer, end), end.total))
    scorer, lasting = dated(scorer, first, candidates)
    if lasting is not None:
        ends += ends_of(scorer, lasting)
    return scorer, best_of(scorer, ends)


def beside_names(scorer: Scorer, state: State, problem: Problem) -> State:
    """The best set grown from named effects, unknowns and memories of the noise tried beside them or in their place.

    Args:
        scorer: of a system that is linearised at the names.
        state: the names.
        problem: the readings.

    Returns:
        The set; the first one found where named effects do not suffice.
    """
    best = climb(scorer, state)
    if not names_suffice(scorer, best, problem):
        return best
    # Names were found before memories of the noise, so each that is not worth very much may stand in for one.
    weak = [key for key in droppable(scorer, best) if best.worth(key) < FAR_BEHIND]
    others = [climb(scorer, with_memory_instead(scorer, best, key)) for key in weak]
    return best_of(scorer, [best, *remembering(scorer, best.total), *(end for end in others if end.total > best.total)])


def names_suffice(scorer: Scorer, state: State, problem: Problem) -> bool:
    """Whether a set has no unknown, no wander beyond a tracker's, and leaves no more than twice the stated noise.

    Args:
        scorer: of the system.
        state: the set.
        problem: the readings.
    """
    system = scorer.system
    if holds_unknown(system, state.keys, state.memory):
        return False
    if wanders_beyond(system, state):
        return False
    stated = stated_noise(problem, system, state)
    return stated is None or visit_left(system, state).total <= NOISE_EXCESS * stated.total


def dated(scorer: Scorer, state: State, candidates: Sequence[Effect]) -> tuple[Scorer, list[str] | None]:
    """A scorer with moments to the row, and a set's lasting effects; None where no moment was searched in it."""
    if not _searches_moments(scorer, state):
        return scorer, None
    scorer = with_moments(scorer, best_moments(scorer, state, droppable(scorer, state), candidates))
    atoms = scorer.system.atoms
    return scorer, [key for key in state.keys if is_effect(atoms[key]) and not is_sudden(atoms[key])]


def _searches_moments(scorer: Scorer, state: State) -> bool:
    """Whether a set has a sudden effect that is not in the model yet."""
    system = scorer.system
    return any(is_sudden(system.atoms[key]) and system.atoms[key].shape is not None for key in state.keys)
