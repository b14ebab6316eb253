"""Threads: what is calculated here is calculated on one, whatever the process has loaded and lets calculate."""

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
THREADS, ONE = "OMP_NUM_THREADS", "1"  # arrays are small: on shared cores threads wait for each other up to fifty times
# Threads of numpy's linear algebra would share sums out, and the last digits would change with their number.
SUMS = "OPENBLAS_NUM_THREADS"


def set_threads() -> None:
    """One thread for torch where nobody asked for more, and one for numpy's linear algebra whatever was asked for.

    Heard by libraries that are loaded from now on.
    """
    os.environ.setdefault(THREADS, ONE)
    os.environ[SUMS] = ONE


@contextmanager
def one_thread() -> Iterator[None]:
    """The same for as long as it lasts, also for libraries that are loaded; the process then stays as it was.

    Entered by several at once it ends with the last of them.
    """
    with _lock:
        if not _inside:
            _undo.append(_limit())
        _inside.append(None)
    try:
        yield
    finally:
        with _lock:
            _inside.pop()
            if not _inside:
                _undo.pop()()


def on_one_thread(function: Callable[P, T]) -> Callable[P, T]:
    """The function, run on one thread."""

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> T:
        with one_thread():
            return function(*args, **kwargs)

    return alone


def _limit() -> Callable[[], None]:
    """Set the environment and the pools of threads of what is loaded; what sets both back."""
    given = {name: os.environ.get(name) for name in (THREADS, SUMS)}
    undo = _limit_pools() if "numpy" in sys.modules else None
    set_threads()

    def back() -> None:
        for name, value in given.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
        if undo is not None:
            undo()

    return back


def _limit_pools() -> Callable[[], None]:
    from threadpoolctl import threadpool_limits

    pools = {"blas": 1} if THREADS in os.environ else {"blas": 1, "openmp": 1}
    return threadpool_limits(limits=pools).restore_original_limits


_lock = threading.Lock()
_inside: list[None] = []  # one for each that is in it
_undo: list[Callable[[], None]] = []
