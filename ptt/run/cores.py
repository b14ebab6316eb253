"""Parallel map over processes, one per core."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import current_process, get_all_start_methods, get_context
from typing import Any, TypeVar

MOST_WORKERS = 4
_shared: list[Any] = []

Item = TypeVar("Item")
Part = TypeVar("Part")


def map_cores(work: Callable[[Item], Part], items: Sequence[Item]) -> Iterator[Part]:
    """Do the work on every item.

    Args:
        work: function of an item.
        items: m items; forked workers share them, and the data of `work`, without a copy.

    Yields:
        The results, in order.
    """
    workers = min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1, MOST_WORKERS, len(items))
    if workers < 2 or "fork" not in get_all_start_methods() or current_process().daemon:  # a daemon has no children
        yield from map(work, items)
        return
    # Forked workers see the whole run without a copy of it; forward derivatives are not safe in threads.
    _shared[:] = [work, items]
    try:
        with ProcessPoolExecutor(workers, get_context("fork"), _alone) as pool:
            yield from pool.map(_work_on, range(len(items)))
    finally:
        _shared.clear()


def _alone() -> None:
    """One thread for each worker: together they are as many as there are cores."""
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


def _work_on(index: int) -> Any:
    work, items = _shared
    return work(items[index])
