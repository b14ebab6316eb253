"""Values at which a law of one variable may jump."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from ptt.dependence.contexts import context_views
from ptt.run.problem import Problem

HEIGHTS = 64  # values at which a law along one variable may jump, at equal shares of the rows
# Share of the rows and number of rows below and above any jump: one or two may be gross errors
END_SHARE, LEAST_END = 0.05, 3
BROKEN_ROWS = 4  # rows as many as beams may break one after the other
MOST_EVENTS = 3  # separate events in one run, at most: what happens more often has one recurring cause

# Variable, its values at which the law jumps, and which rows have the jump, (n,) or (n, k).
Jump = tuple[str, tuple[float, ...], np.ndarray]


def heights_of(visited: np.ndarray) -> np.ndarray:
    """Midpoints between neighbouring values of a variable, with enough rows on either side of each.

    Args:
        visited: values of the rows that count, (m,).

    Returns:
        At most `HEIGHTS` of them, ascending.
    """
    order = np.sort(visited)
    edge = max(int(END_SHARE * len(order)), LEAST_END)
    inner = np.unique(order[edge - 1 : len(order) - edge + 1])
    some = np.linspace(0, max(len(inner) - 2, 0), min(HEIGHTS, max(len(inner) - 1, 0))).round().astype(int)
    return np.asarray(0.5 * (inner[1:] + inner[:-1])[some])


def passed_again(problem: Problem) -> Iterator[Jump]:
    """Jumps over temperature and a user's own columns, at values that are passed to and fro.

    Args:
        problem: n rows.

    Yields:
        The variable, the value, and the rows above it, (n,) bool.
    """
    for on, values in context_views(problem).items():
        if on == "temperature" or on in problem.table.watched:
            for value in heights_of(values[problem.used]):
                above = values > value
                if _is_passed_again(above[problem.used]):
                    yield on, (float(value),), above


def sides_of(problem: Problem, load: str, values: np.ndarray) -> Iterator[Jump]:
    """The jump of what has play and bears on one side or the other, by the sign of a joint's load.

    Args:
        problem: n rows.
        load: name of the load.
        values: of the load, (n,).

    Yields:
        The load, zero, and half of the jump on either side of it, (n,); nothing where too few rows are on one side.
    """
    above = values > 0.0
    fewer = min(above[problem.used].sum(), (~above[problem.used]).sum())
    if fewer >= max(int(END_SHARE * problem.used.sum()), LEAST_END):
        yield load, (0.0,), above - 0.5


def spells_of(problem: Problem, moments: Sequence[float]) -> Iterator[Jump]:
    """Jumps over time: something that began at one moment and ended at another, or many events with one cause.

    That one knock exactly takes back another is no coincidence: whatever it was came and went, and may come again. More
    than `MOST_EVENTS` events in one run are no separate ones either. Rows between moments that are only a few rows
    apart are broken beams.

    Args:
        problem: n rows.
        moments: at which something seems to have happened, by the clock, ascending.

    Yields:
        'time', the moments, and the rows in between, (n,), or after each moment, (n, k) bool.
    """
    clock, read = problem.view.clock.numpy(), problem.used
    for first, last in combinations(moments, 2):
        between = (clock > first) & (clock <= last)
        if (between & read).sum() > BROKEN_ROWS:
            yield "time", (first, last), between
    after = (clock[read, None] > np.array(moments)).sum(axis=0)
    close, beside = -np.diff(after) <= BROKEN_ROWS, np.zeros(len(moments), dtype=bool)
    beside[1:] |= close
    beside[:-1] |= close
    apart = [moment for moment, near in zip(moments, beside, strict=True) if not near]
    if len(apart) > MOST_EVENTS:
        yield "time", tuple(apart), clock[:, None] > np.array(apart)


def switches_of(problem: Problem, moments: Sequence[float]) -> Iterator[Jump]:
    """The levels over time of something that switches at each of some moments; it may do so before the run begins.

    Args:
        problem: n rows.
        moments: by the clock, ascending.

    Yields:
        'time', the moments, and the rows of each level, (n, k + 1) bool; nothing where there are no moments.
    """
    if moments:
        level = np.searchsorted(np.array(moments), problem.view.clock.numpy())
        yield "time", tuple(moments), level[:, None] == np.arange(len(moments) + 1)


def _is_passed_again(passed: np.ndarray) -> bool:
    """Whether a value is passed to and fro, (n,) bool in travel order: passed once, it is the same as a moment."""
    before, above = np.arange(len(passed) + 1), np.concatenate([[0], np.cumsum(passed)])
    unlike = above + (len(passed) - before) - (above[-1] - above)  # rows that contradict a step up at each moment
    return bool(min(unlike.min(), len(passed) - unlike.max()) >= max(int(END_SHARE * len(passed)), LEAST_END))
