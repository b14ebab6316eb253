"""Bursts: several broken beams in succession, which a search may mistake for events, a wander or an unknown."""

from collections.abc import Iterator

import numpy as np

from ptt.diagnosis.evidence.atoms import is_effect
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.state import without
from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.noise.gross import are_exceptions, stand_out
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.search.turn import robustly_left
from ptt.diagnosis.unknown.jumps import BROKEN_ROWS
from ptt.run.problem import Problem

CROWDED_ROWS = 8  # rows within which two events happen by chance in one run of a thousand
LOST_ERROR = 30.0  # times the median error, by which rows are off that were paired with the readings of others
MOSTLY = 0.5  # share of the rows from the first of them to the last
MOST_BROKEN_SHARE = 0.04  # share of the rows that may be broken beams taken for an event; at least `BROKEN_ROWS` may


def lost_rows(problem: Problem) -> np.ndarray:
    """A few rows in succession that are so far from where the drawing has them that no machine errs so, (n,) bool.

    Args:
        problem: n rows.

    Returns:
        None where only some are that far, as a search leaves such out by itself, where many are, or where they lie
        apart: then they may have a cause in common. Nor where a run begins or ends with them: it may have slipped.
    """
    off = np.linalg.norm(problem.measured - problem.view.p.numpy(), axis=1)
    lost = problem.used & (off > LOST_ERROR * np.median(off[problem.used]))
    if not lost.any() or not are_exceptions(lost, problem.used):
        return np.zeros_like(lost)
    first, last = np.flatnonzero(lost)[[0, -1]]
    in_succession = lost.sum() >= max(BROKEN_ROWS, MOSTLY * problem.used[first : last + 1].sum())
    beside = np.flatnonzero(problem.used & (problem.table.run == problem.table.run[first]))
    within = beside[0] < first and problem.table.run[last] == problem.table.run[first] and last < beside[-1]
    return lost if in_succession and within else np.zeros_like(lost)


def broken_beams(found: Found) -> np.ndarray:
    """Rows that may be gross errors which the search took for events, a wander or an unknown.

    A knock of the tracker has six free numbers and a slip of the sliders three, so two of them close together explain
    any two or three readings; so does a wander over a few rows, or a curve that bends enough. Under a set without
    these, such readings are all that is far off. Whether they are gross errors, a search without them decides.

    Args:
        found: the best explanation.

    Returns:
        (n,) bool; none where effects and white noise explain all, or where many rows are far off.
    """
    system, state, rows = rows_of(found.system), found.state, np.zeros_like(found.gross)
    crowd = crowded_moments(found)
    if not crowd and state.memory.wander is None and not holds_unknown(system, state.keys, state.memory):
        return rows
    for keys in _less(found, crowd):
        left = robustly_left(system, found.scorer.score(keys, WHITE, state.variances))
        far = stand_out(left, np.ones(len(left), dtype=bool), least=0.0)
        if 0 < far.sum() <= max(BROKEN_ROWS, MOST_BROKEN_SHARE * len(left)):
            rows[system.rows[far]] = True
            break
    return rows


def _less(found: Found, crowd: list[str]) -> Iterator[tuple[str, ...]]:
    """Sets without the crowded events, and with one of them kept, which may be real and next to a broken beam.

    The keys of each with its unknowns come first, then without.
    """
    for kept in (None, *crowd):
        less = without(found.state, *(key for key in crowd if key != kept))
        yield less
        yield tuple(key for key in less if is_effect(found.system.atoms[key]))


def crowded_moments(found: Found) -> list[str]:
    """Events of an explanation within a few rows of another one.

    Args:
        found: an explanation.

    Returns:
        Their keys.
    """
    atoms, time = found.system.atoms, found.system.clock.time
    moments = {key: moment for key in found.state.keys if (moment := atoms[key].moment) is not None}
    at = {key: int(np.searchsorted(time, moment)) for key, moment in moments.items()}
    return [key for key in at if any(other != key and abs(at[key] - at[other]) <= CROWDED_ROWS for other in at)]
