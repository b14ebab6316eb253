"""Writing a session to disk in the background, so that the page does not wait for it."""

import asyncio
from collections import deque
from collections.abc import Callable
from threading import Lock

from ptt.errors import PttError
from ptt.show.studio.session import Session
from ptt.show.studio.store import SessionFolder


class SessionWriter:
    """Writes the latest state of one session; states that are superseded while it writes are skipped."""

    def __init__(self, place: SessionFolder, failed: Callable[[str], None]) -> None:
        """Write nothing yet.

        Args:
            place: folder of the session.
            failed: called with the reason where it cannot be written.
        """
        self.place, self.failed = place, failed
        self._waiting: deque[Session] = deque(maxlen=1)
        self._turn = Lock()
        self._task: asyncio.Task[None] | None = None
        self._words = ""

    def keep(self, session: Session) -> None:
        """Schedule a state to be written; needs a running event loop."""
        self._waiting.append(session)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._write())

    async def kept(self) -> None:
        """Wait until all that was scheduled is on disk."""
        if self._task is not None:
            await asyncio.shield(self._task)

    def close(self) -> str:
        """Write what is still scheduled, now; returns why the last write failed, '' where it did not."""
        self._save()
        return self._words

    async def _write(self) -> None:
        while self._waiting:
            if words := await asyncio.to_thread(self._save):
                self.failed(words)

    def _save(self) -> str:
        """Write the latest state, after any write in progress, so that no older state overwrites a newer one."""
        with self._turn:
            if not self._waiting:  # the write that was waited for has taken it
                return self._words
            session, self._words = self._waiting.pop(), ""
            try:
                self.place.save(session)
            except PttError as error:
                self._words = f"this session cannot be kept on disk: {error}"
            return self._words
