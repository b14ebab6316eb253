"""A pool of worker processes for jobs, shared by all sessions."""

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
from ptt.show.studio.worker import serve

POLL = 0.02  # s between two looks at a connection
IDLE = 120.0  # s without work after which a process is ended
SHORT = 2.0  # s after which a job counts as long: another process is then started in reserve
PATIENCE = 20.0  # s that a patient job waits for a free process before another is started
LEAVE = 0.5  # s that a cancelled job has to stop by itself: starting another process takes five times as long
LEAST_WORKERS, MOST_WORKERS = 2, 4  # enough for a diagnosis beside a short job; with more each becomes slow
KEPT = 1.2 * 2**30  # bytes, twice the usual size: a larger process is ended after its job


class WorkerProcess:
    """One worker process; for each job it changes to the folder of the job's session."""

    def __init__(self) -> None:
        """Start the process, which imports the library before the first job."""
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process: SpawnProcess = context.Process(target=serve, args=(other,))
        self.process.start()
        other.close()
        self.since = time.monotonic()

    async def answer(self, folder: Path, job: str, arguments: Sequence[Any], tell: Progress | None) -> tuple[Any, ...]:
        """Run a job; its answer as a kind ('done', 'question', 'setup', 'failed', 'left', 'lost') and contents."""
        try:
            self.connection.send((str(folder), job, arguments))
            return await self._receive(tell)
        except (EOFError, OSError):
            return ("lost",)

    async def leaves(self) -> bool:
        """Ask the process to stop its job; whether it did so in time and can be given another."""
        try:
            self.connection.send(None)
            await asyncio.wait_for(self._receive(None), LEAVE)
        except (EOFError, OSError, TimeoutError, asyncio.CancelledError):
            return False
        return True

    async def _receive(self, tell: Progress | None) -> tuple[Any, ...]:
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
        """Whether the process holds more memory than `KEPT`; False where that cannot be read."""
        try:
            pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        except (OSError, ValueError, IndexError):
            return False
        return pages * os.sysconf("SC_PAGE_SIZE") > KEPT

    def kill(self) -> None:
        """Kill the process, and those that it has started."""
        if self.process.pid is not None and hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, signal.SIGKILL)  # `serve` makes it the leader of a group
        self.process.kill()
        self.process.join()
        self.connection.close()


class Pool:
    """A pool of worker processes, started on demand; further jobs wait for a free one."""

    def __init__(self, most: int | None = None, idle: float = IDLE) -> None:
        """Start nothing yet.

        Args:
            most: most processes at once; None for the number of cores, within `LEAST_WORKERS` and `MOST_WORKERS`.
            idle: time without work after which a process is ended, s.
        """
        self.most = most or max(LEAST_WORKERS, min(MOST_WORKERS, os.cpu_count() or LEAST_WORKERS))
        self.idle = idle
        self._free: list[WorkerProcess] = []
        self._all: set[WorkerProcess] = set()
        self._closed = False
        self._room = asyncio.Semaphore(self.most)
        atexit.register(self.close)

    def warm(self) -> None:
        """Start a first process ahead of the first job."""
        if not self._all:
            self._free.append(self._started())
            self._trim_later()

    async def run(
        self, folder: Path, job: str, arguments: Sequence[Any], tell: Progress | None = None, patient: bool = False
    ) -> Any:
        """Run a job; where the task is cancelled the job stops by itself, else its process is killed.

        Args:
            folder: folder to work in.
            job: name of a function of `ptt.show.studio.jobs`.
            arguments: its arguments, all picklable.
            tell: told what is done, how much of how much.
            patient: whether to wait up to `PATIENCE` for a free process before another is started.

        Returns:
            The result of the job.

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
                    self._start_spare()  # in its place
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
        worker = WorkerProcess()
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
        """Start a process in reserve if none is free, as a job has turned out to be long."""
        if not self._free:
            self._start_spare()

    def _start_spare(self) -> None:
        """Start one more process, if the pool may have one, before a job needs it."""
        if len(self._all) < self.most and not self._closed:
            self._free.insert(0, self._started())  # taken last: the others have finished starting
            self._trim_later()

    def _end(self, worker: WorkerProcess) -> None:
        self._all.discard(worker)
        worker.kill()

    def _trim_later(self) -> None:
        with suppress(RuntimeError):  # there is no running loop while the server shuts down
            asyncio.get_running_loop().call_later(self.idle + 1.0, self._trim)

    def _trim(self) -> None:
        """End processes that have had no work for a while."""
        for worker in [worker for worker in self._free if time.monotonic() - worker.since > self.idle]:
            self._free.remove(worker)
            self._end(worker)
