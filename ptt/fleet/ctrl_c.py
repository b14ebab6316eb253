"""Holding back Ctrl-C while processes are started or ended."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back() -> Iterator[list[int]]:
    """Hold back SIGINT while the body runs: a cluster that is half started or half closed fails with long tracebacks.

    A terminal sends Ctrl-C to every process that it runs. Processes that are started in the body inherit a mask that
    blocks it, so that only the process which started them ends them.

    Yields:
        A list that collects the signals held back; the caller has to act on them.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # no other thread is interrupted
        yield came
        return
    before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    masked = hasattr(signal, "pthread_sigmask")
    if masked:
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()  # its start unblocks SIGINT in this thread: start it before blocking
    old = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else set()
    try:
        yield came
    finally:
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, old)
        signal.signal(signal.SIGINT, before)
