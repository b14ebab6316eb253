"""What is being done for one session: one job after the other, those nobody asked for give way."""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ptt.show.studio.outcomes import JobCancelledError, JobFailedError
from ptt.show.studio.pool import Pool

How = Literal["asked", "quiet", "unasked", "aside", "spare"]


@dataclass(frozen=True)
class Busy:
    """What is being done: words, how much of how much (0 of 0 where nobody knows), since when.

    `yields` says that nobody asked for it: it gives way to whatever a person asks for.
    """

    words: str
    done: int = 0
    of: int = 0
    since: float = 0.0
    yields: bool = False


class JobRunner:
    """Jobs of one session, what of them is shown, and what went wrong with the last."""

    def __init__(self, folder: Path, pool: Pool) -> None:
        """Begin idle.

        Args:
            folder: of the session's files.
            pool: what calculates.
        """
        self.folder, self.pool = folder, pool
        self.trouble = ""
        self.busy: Busy | None = None
        self._one = asyncio.Lock()
        self._tasks: dict[asyncio.Task[Any], bool] = {}  # -> whether it gives way
        self._epoch = 0

    def tell(self, topic: str) -> None:
        """Tell the views of 'busy'."""
        raise NotImplementedError

    @property
    def idle(self) -> bool:
        """Whether nothing that a person asked for is going on."""
        return self.busy is None or self.busy.yields

    def cancel(self) -> None:
        """Stop what is running and what waits."""
        self._epoch += 1
        for task in self._tasks:
            task.cancel()

    async def work(self, words: str, job: str, *arguments: Any, how: How = "asked") -> Any:
        """Do a job off the page.

        Args:
            words: what is done, for the person.
            job: name of the job.
            *arguments: what it takes.
            how: 'asked' by a person, 'quiet' and short, 'unasked' and giving way, or 'aside': reads no file of the
                session, so that it need not wait for anything; 'spare' is the same of what nobody waits for.

        Returns:
            Its result; None where it was stopped or failed, which is shown.
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
        if how != "spare":  # nobody means it who stops what goes on
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
