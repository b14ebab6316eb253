"""Processes that calculate, shared by all sessions: a few at most, and none kept for long without work."""

import asyncio
import atexit
import multiprocessing
import os
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.outcomes import JobFailedError, QuestionError, SetupFoundError
from ptt.show.studio.verbs import Run
from ptt.show.studio.worker import serve

POLL = 0.02  # s
IDLE = 120.0  # s without work after which a process is given back
SHORT = 2.0  # s that a job may take that nobody stops
PATIENCE = 20.0  # s that what nobody waits for stands back
LEAVE = 0.5  # s that a job has to leave off by itself: to begin another process takes five times as long
LEAST_WORKERS, MOST_WORKERS = 2, 4  # a diagnosis beside a quick look; more than this and each of them gets slow
KEPT = 1.2 * 2**30  # bytes: a process that has grown beyond twice its usual size is not kept


class WorkerProcess:
    """One process; it works in the folder of whichever session a job belongs to."""

    def __init__(self, verb: Run | None) -> None:
        """Start it, so that it has loaded the library when a job comes.

        Args:
            verb: how verbs of the command line are run there.
        """
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process: SpawnProcess = context.Process(target=serve, args=(other, verb))
        self.process.start()
        other.close()
        self.since = time.monotonic()

    async def answer(self, folder: Path, job: str, arguments: Sequence[Any], tell: Progress | None) -> tuple[Any, ...]:
        """What a job comes to: its kind and content."""
        try:
            self.connection.send((str(folder), job, arguments))
            return await self._heard(tell)
        except (EOFError, OSError):
            return ("lost",)

    async def leaves(self) -> bool:
        """Whether it leaves off what it is doing when it is asked to, and can be given another job."""
        try:
            self.connection.send(None)
            await asyncio.wait_for(self._heard(None), LEAVE)
        except (EOFError, OSError, TimeoutError, asyncio.CancelledError):
            return False
        return True

    async def _heard(self, tell: Progress | None) -> tuple[Any, ...]:
        while True:
            while not self.connection.poll():
                await asyncio.sleep(POLL)
            kind, *content = self.connection.recv()
            if kind != "progress":
                return kind, *content
            if tell is not None:
                tell(*content)

    @property
    def large(self) -> bool:
        """Whether it holds more memory than is worth keeping."""
        try:
            pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        except (OSError, ValueError, IndexError):
            return False
        return pages * os.sysconf("SC_PAGE_SIZE") > KEPT

    def kill(self) -> None:
        """End it, and what it has started."""
        if self.process.pid is not None and hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, signal.SIGKILL)  # its own group, once it has made one
        self.process.kill()
        self.process.join()
        self.connection.close()


class Pool:
    """As many processes as cores, within bounds; jobs beyond that wait their turn."""

    def __init__(self, most: int | None = None, idle: float = IDLE, verb: Run | None = None) -> None:
        """Start nothing yet.

        Args:
            most: processes at once; None takes as many as there are cores, within bounds.
            idle: seconds without work after which a process is given back.
            verb: how verbs of the command line are run, a function that another process can import.
        """
        self.most = most or max(LEAST_WORKERS, min(MOST_WORKERS, os.cpu_count() or LEAST_WORKERS))
        self.idle, self.verb = idle, verb
        self._free: list[WorkerProcess] = []
        self._all: set[WorkerProcess] = set()
        self._closed = False
        self._room = asyncio.Semaphore(self.most)
        atexit.register(self.close)

    def warm(self) -> None:
        """Have one process ready before the first job comes."""
        if not self._all:
            self._free.append(self._started())
            self._trim_later()

    async def run(
        self, folder: Path, job: str, arguments: Sequence[Any], tell: Progress | None = None, patient: bool = False
    ) -> Any:
        """Do a job; where the task is cancelled the job leaves off, or else the process that does it is ended.

        Args:
            folder: to work in.
            job: name of a function of `ptt.show.studio.jobs`.
            arguments: what it takes, all of it picklable.
            tell: told what is done, how much of how much.
            patient: whether it rather waits a while than have another process started, which takes the processor.

        Returns:
            What it returns.

        Raises:
            JobFailedError: it refused or failed.
            QuestionError: it needs an answer.
            SetupFoundError: the set-up looks mistaken.
        """
        until = time.monotonic() + (PATIENCE if patient else 0.0)
        while self._all and not self._free and time.monotonic() < until:
            await asyncio.sleep(POLL)
        if self._room.locked() and tell is not None:
            tell("waiting until other sessions are served", 0, 0)
        async with self._room:
            worker = self._free.pop() if self._free else self._started()
            reserve = asyncio.get_running_loop().call_later(SHORT, self._reserve)
            try:
                kind, *content = await worker.answer(folder, job, arguments, tell)
            except BaseException:
                if await worker.leaves():
                    self._take_back(worker)
                else:
                    self._end(worker)
                    self._ready()  # in its place
                raise
            finally:
                reserve.cancel()
            if kind == "lost":
                self._end(worker)
            else:
                self._take_back(worker)
        if kind == "done":
            return content[0]
        if kind == "question":
            raise QuestionError(*content)
        if kind == "setup":
            raise SetupFoundError(content[0])
        lost = "the calculation ended unexpectedly (out of memory?); try again"
        raise JobFailedError(content[0] if content else lost)

    def close(self) -> None:
        """End all processes."""
        self._closed = True
        for worker in list(self._all):
            self._end(worker)
        self._free.clear()

    def _started(self) -> WorkerProcess:
        worker = WorkerProcess(self.verb)
        self._all.add(worker)
        return worker

    def _take_back(self, worker: WorkerProcess) -> None:
        if worker.large:
            self._end(worker)
            return
        worker.since = time.monotonic()
        self._free.append(worker)
        self._trim_later()

    def _reserve(self) -> None:
        """Have a process free for what is asked for next."""
        if not self._free:
            self._ready()

    def _ready(self) -> None:
        """Start one more, where there may be one: it takes long to begin."""
        if len(self._all) < self.most and not self._closed:
            self._free.insert(0, self._started())  # those that have begun are taken first
            self._trim_later()

    def _end(self, worker: WorkerProcess) -> None:
        self._all.discard(worker)
        worker.kill()

    def _trim_later(self) -> None:
        with suppress(RuntimeError):  # without a loop nobody waits for anything
            asyncio.get_running_loop().call_later(self.idle + 1.0, self._trim)

    def _trim(self) -> None:
        """Give back what has had no work for a while."""
        for worker in [worker for worker in self._free if time.monotonic() - worker.since > self.idle]:
            self._free.remove(worker)
            self._end(worker)
