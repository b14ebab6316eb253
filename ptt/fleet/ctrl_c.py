"""Ctrl-C while processes start or end: it waits, and they never get it."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back() -> Iterator[list[int]]:
    """Let what is within be done whole; a cluster that is half started or half closed cannot be stopped in one line.

    A terminal sends Ctrl-C to every process that it runs. Those that are started within inherit that they do not
    listen, so that only the one which started them ends them.

    Yields:
        The signals that came meanwhile, for whoever is to obey them then.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # no other thread is interrupted
        yield came
        return
    before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    masked = hasattr(signal, "pthread_sigmask")
    if masked:
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()  # started later by another thread, it would let the signal into that again
    old = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else set()
    try:
        yield came
    finally:
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, old)
        signal.signal(signal.SIGINT, before)
