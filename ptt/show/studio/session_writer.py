"""Sessions written to disk beside the page, which does not wait for the disk."""

import asyncio
from collections import deque
from collections.abc import Callable
from threading import Lock

from ptt.errors import PttError
from ptt.show.studio.session import Session
from ptt.show.studio.store import SessionFolder


class SessionWriter:
    """Writes the newest state of one session; states that came while it wrote are passed over."""

    def __init__(self, place: SessionFolder, failed: Callable[[str], None]) -> None:
        """Write nothing yet.

        Args:
            place: its folder.
            failed: told why it cannot be kept.
        """
        self.place, self.failed = place, failed
        self._waiting: deque[Session] = deque(maxlen=1)
        self._turn = Lock()
        self._task: asyncio.Task[None] | None = None
        self._words = ""

    def keep(self, session: Session) -> None:
        """Have a session written down, soon; needs a running loop."""
        self._waiting.append(session)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._write())

    async def kept(self) -> None:
        """Wait until it is on the disk."""
        if self._task is not None:
            await asyncio.shield(self._task)

    def close(self) -> str:
        """Write what is not written yet, now; why that, or what was being written, could not be, '' where it was."""
        self._save()
        return self._words

    async def _write(self) -> None:
        while self._waiting:
            if words := await asyncio.to_thread(self._save):
                self.failed(words)

    def _save(self) -> str:
        """Write the newest state; one that is being written comes to its end first, so none follows a newer one."""
        with self._turn:
            if not self._waiting:  # written by who came before
                return self._words
            session, self._words = self._waiting.pop(), ""
            try:
                self.place.save(session)
            except PttError as error:
                self._words = f"this session cannot be kept on disk: {error}"
            return self._words
