"""Chunks of a long run: stretches of rows with the state in which the joints entered them, so that sums add up.

Rows take a few hundred bytes each and are kept in memory; columns of the linearised problem take thousands and exist
only for one chunk at a time. To map and reduce on a cluster, `enter` the chunks once (a quick scan of the commands that
needs no parameters), send each with its entry state to a worker, and add the results.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np
import torch

from ptt.effects.memory import entry_after
from ptt.run.cores import map_cores
from ptt.run.problem import Problem
from ptt.run.table import take_rows
from ptt.run.turns import Entry
from ptt.run.view import View

CHUNK = 20_000  # rows of a chunk: columns of all candidates take some 100 MB
# rows kept beside a block: the slope of a spline feels a knot k rows away by 0.27^k, rounding from 30 on
NEIGHBOUR_ROWS = 200
LONG = 50_000  # rows beyond which columns of all rows at once take too much memory
SAMPLE_ROWS = 8_000  # rows of the sample on which shapes and paths of a long run are found
STRETCH_ROWS = 400  # rows of each stretch of that sample
EDGE_ROWS = 5  # rows about each joint's lowest and highest position, so that the sample covers the range of all rows
GOLDEN = 0.618034  # golden ratio less one: spreads stretches evenly over any cycle that the run may repeat

Part = TypeVar("Part")
Own = TypeVar("Own")
Stretch = tuple[int, int]  # first row, and the row after the last


def stretches(rows: int, size: int = CHUNK) -> list[Stretch]:
    """Cut rows into chunks of about the same size.

    Args:
        rows: n.
        size: rows of a chunk, at most.

    Returns:
        The chunks in order.
    """
    ends = np.linspace(0, rows, -(-rows // size) + 1).round().astype(int).tolist()
    return list(pairwise(ends))


def enter(view: View, cuts: Sequence[int]) -> list[Entry | None]:
    """Entry states of the joints at some rows, by one scan over the travel.

    Args:
        view: n rows.
        cuts: row numbers, ascending.

    Returns:
        The entry of each; None where a run starts there.
    """
    entries: list[Entry | None] = []
    entry, start = next((entry for entry in view.entries if entry.row == 0), None), 0
    for cut in cuts:
        if cut > start:
            entry = entry_after(_part_of_view(view, np.arange(start, cut), (entry,)))
            start = cut
        entries.append(None if cut >= view.rows or bool(view.starts[cut]) else entry)
    return entries


def take(problem: Problem, kept: Sequence[Stretch]) -> Problem:
    """Some stretches of a problem as a problem of its own, with their entry states.

    Args:
        problem: n rows.
        kept: stretches, ascending.

    Returns:
        The rows of the stretches, concatenated.
    """
    entries = enter(problem.view, [first for first, _ in kept])
    return take_entered(problem, kept, entries)


def sample_stretches(problem: Problem, rows: int = SAMPLE_ROWS, stretch: int = STRETCH_ROWS) -> list[Stretch]:
    """Stretches of travel spread over a run, its ends and the ends of each joint's range among them.

    Args:
        problem: n rows.
        rows: how many rows about.
        stretch: rows of each stretch.

    Returns:
        Stretches in rising order, apart from each other.
    """
    total = problem.table.rows
    count = max(2, rows // stretch)
    if total <= rows:
        return [(0, total)]
    room = total / count - stretch
    first = [round(i * total / count + room * (i * GOLDEN % 1.0)) for i in range(count)]
    first[0], first[-1] = 0, total - stretch
    q = problem.view.q.numpy()
    ends = [*q.argmin(axis=0).tolist(), *q.argmax(axis=0).tolist()]
    taken = np.zeros(total, dtype=bool)
    for start, stop in [(s, s + stretch) for s in first] + [(e - EDGE_ROWS, e + EDGE_ROWS + 1) for e in ends]:
        taken[max(start, 0) : stop] = True
    edges = np.flatnonzero(np.diff(np.concatenate([[0], taken.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def sampled_if_long(problem: Problem) -> Problem:
    """The problem, or a sample of stretches of it where columns of all rows would not fit into memory."""
    return take(problem, sample_stretches(problem, SAMPLE_ROWS)) if problem.table.rows > LONG else problem


def numbers(problem: Problem) -> np.ndarray:
    """Row numbers of a problem's rows in the whole run, (m,) int."""
    return problem.view.row_numbers.numpy().astype(int)


def cut(problem: Problem, size: int = CHUNK) -> list[Callable[[], Problem]]:
    """Cut a problem into chunks, each made when it is asked for.

    Args:
        problem: n rows.
        size: rows of a chunk.

    Returns:
        Makers of the chunks, in order.
    """
    parts = stretches(problem.table.rows, size)
    entries = enter(problem.view, [first for first, _ in parts])

    return [partial(take_entered, problem, [part], [entry]) for part, entry in zip(parts, entries, strict=True)]


def view_chunks(view: View, size: int = CHUNK) -> Iterator[View]:
    """Cut a view into chunks, each with its entry state.

    Args:
        view: n rows.
        size: rows of a chunk.

    Yields:
        The chunks, in order.
    """
    parts = stretches(view.rows, size)
    for (first, last), entry in zip(parts, enter(view, [first for first, _ in parts]), strict=True):
        yield _part_of_view(view, np.arange(first, last), (entry,))


def map_chunks(work: Callable[[Problem], Part], chunks: Sequence[Callable[[], Problem]]) -> Iterator[Part]:
    """Map a function over chunks, as many at once as there are cores.

    Args:
        work: from a chunk to what is wanted of it.
        chunks: their makers.

    Yields:
        The results, in order.
    """
    yield from map_cores(partial(_made, work), chunks)


def _made(work: Callable[[Problem], Part], make: Callable[[], Problem]) -> Part:
    return work(make())


def map_beside(
    work: Callable[[Problem, Own], Part], chunks: Sequence[Callable[[], Problem]], each: Sequence[Own]
) -> Iterator[Part]:
    """Map a function over chunks and a value for each, as many at once as there are cores.

    Args:
        work: from a chunk and what belongs to it to what is wanted of them.
        chunks: their makers.
        each: what belongs to each of them.

    Yields:
        The results, in order.
    """
    yield from map_cores(partial(_made_beside, work), list(zip(chunks, each, strict=True)))


def _made_beside(work: Callable[[Problem, Own], Part], pair: tuple[Callable[[], Problem], Own]) -> Part:
    make, own = pair
    return work(make(), own)


def take_entered(problem: Problem, kept: Sequence[Stretch], entries: Sequence[Entry | None]) -> Problem:
    """Some stretches of a problem whose entries are known, as a problem of its own.

    Args:
        problem: n rows.
        kept: stretches in rising order.
        entries: how the joints came to each; None where a run starts there.

    Returns:
        The rows of the stretches, one behind the other.
    """
    rows = np.concatenate([np.arange(first, last) for first, last in kept])
    return replace(
        problem,
        table=take_rows(problem.table, rows),
        view=_part_of_view(problem.view, rows, entries, np.cumsum([0, *(last - first for first, last in kept)])),
        measured=problem.measured[rows],
        used=problem.used[rows],
        frame=problem.frame[rows],
        mount=problem.mount[rows],
    )


def _part_of_view(
    view: View, rows: np.ndarray, entries: Sequence[Entry | None], places: Sequence[int] | np.ndarray = (0,)
) -> View:
    entered = tuple(
        replace(entry, row=int(place)) for entry, place in zip(entries, places, strict=False) if entry is not None
    )
    return replace(view.of_rows(torch.as_tensor(rows)), entries=entered)
