"""Sessions written down beside the page: a disk that takes its time keeps nobody waiting for a picture."""

import asyncio
from collections.abc import Callable

from ptt.errors import InputError
from ptt.show.studio.session import Session
from ptt.show.studio.store import Place


class Keeper:
    """Writes the newest state of one session; states that came while it wrote are passed over."""

    def __init__(self, place: Place, failed: Callable[[str], None]) -> None:
        """Write nothing yet.

        Args:
            place: its folder.
            failed: told why it cannot be kept.
        """
        self.place, self.failed = place, failed
        self._next: Session | None = None
        self._task: asyncio.Task[None] | None = None

    def keep(self, session: Session) -> None:
        """Have a session written down, soon; needs a running loop."""
        self._next = session
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._write())

    async def kept(self) -> None:
        """Wait until it is on the disk."""
        if self._task is not None:
            await asyncio.shield(self._task)

    def close(self) -> None:
        """Write what is not written yet, now."""
        if self._next is not None:
            self._save(self._next)

    async def _write(self) -> None:
        while self._next is not None:
            session, self._next = self._next, None
            if words := await asyncio.to_thread(self._save, session):
                self.failed(words)

    def _save(self, session: Session) -> str:
        """Why it could not be written; '' where it was."""
        try:
            self.place.save(session)
        except InputError as error:
            return f"this session cannot be kept on disk: {error}"
        return ""
