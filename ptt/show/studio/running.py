"""Running the jobs of one session: one after the other; those that nobody asked for are cancelled for others."""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ptt.show.studio.outcomes import JobCancelledError, JobFailedError
from ptt.show.studio.pool import Pool

# Kinds of jobs:
# 'asked': by a person; shown as busy, cancels 'unasked' ones.
# 'unasked': shown as busy, but cancelled for whatever a person asks for.
# 'quiet': short and not shown.
# 'aside': not shown, and run beside the others, as it needs no file that they use.
# 'spare': as 'aside', for what nobody waits for: it waits for a free process, and Cancel does not stop it.
How = Literal["asked", "quiet", "unasked", "aside", "spare"]


@dataclass(frozen=True)
class Busy:
    """The job that is shown as being done.

    Attributes:
        words: what is done.
        done: how much of it is done.
        of: how much there is; 0 where that is unknown.
        since: when it began, on the monotonic clock, s.
        yields: whether nobody asked for it, so that it is cancelled for whatever a person asks for.
    """

    words: str
    done: int = 0
    of: int = 0
    since: float = 0.0
    yields: bool = False


class JobRunner:
    """Runs the jobs of one session, and keeps what the page shows of them: the present job, the last trouble."""

    def __init__(self, folder: Path, pool: Pool) -> None:
        """Begin idle.

        Args:
            folder: folder of the session's files.
            pool: processes for jobs.
        """
        self.folder, self.pool = folder, pool
        self.trouble = ""
        self.busy: Busy | None = None
        self._one = asyncio.Lock()
        self._tasks: dict[asyncio.Task[Any], bool] = {}  # -> whether it gives way
        self._epoch = 0

    def tell(self, topic: str) -> None:
        """Tell the views that a topic has changed; implemented by the controller."""
        raise NotImplementedError

    @property
    def idle(self) -> bool:
        """Whether no job is shown that a person asked for."""
        return self.busy is None or self.busy.yields

    def cancel(self) -> None:
        """Cancel the jobs that run and wait, except 'spare' ones."""
        self._epoch += 1
        for task in self._tasks:
            task.cancel()

    async def work(self, words: str, job: str, *arguments: Any, how: How = "asked") -> Any:
        """Run a job in another process.

        Args:
            words: what is done, for the person.
            job: name of a function of `ptt.show.studio.jobs`.
            *arguments: its arguments.
            how: kind of job, see `How`.

        Returns:
            Its result; None where it was cancelled or failed, which is shown.
        """
        epoch, shown = self._epoch, how in ("asked", "unasked")
        if how == "asked":
            self.trouble = ""
            for task in [task for task, yields in self._tasks.items() if yields]:
                task.cancel()
        try:
            if how in ("aside", "spare"):
                return await self._do(words, job, arguments, how)
            async with self._one:
                if epoch != self._epoch:
                    raise JobCancelledError("stopped")
                if shown:
                    self._is_busy(Busy(words, since=time.monotonic(), yields=how == "unasked"))
                return await self._do(words, job, arguments, how)
        except JobCancelledError:
            if how == "asked" or epoch != self._epoch:
                self.trouble = f"{words}: stopped"
        except JobFailedError as error:
            self.trouble = str(error)
        finally:
            self._is_busy(None) if shown else self.tell("busy")
        return None

    async def _do(self, words: str, job: str, arguments: Sequence[Any], how: How) -> Any:
        def tell(what: str, done: int, of: int) -> None:
            if how in ("asked", "unasked") and self.busy is not None:
                self._is_busy(
                    replace(self.busy, words=f"{words}: {what}" if what not in ("", words) else words, done=done, of=of)
                )

        task = asyncio.create_task(self.pool.run(self.folder, job, arguments, tell, patient=how == "spare"))
        if how != "spare":
            self._tasks[task] = how == "unasked"
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError:
            task.cancel()
            raise
        finally:
            self._tasks.pop(task, None)
        if task.cancelled():
            raise JobCancelledError("stopped")
        return task.result()

    def _is_busy(self, busy: Busy | None) -> None:
        self.busy = busy
        self.tell("busy")
