"""The controller of one page: it keeps the session, gives jobs to the pool, and tells the views what changed."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from nicegui import Client

from ptt.errors import PttError
from ptt.fitting.chunks import LONG
from ptt.machine import parse_machine
from ptt.show.studio.looks import Look
from ptt.show.studio.outcomes import QuestionError, SetupFoundError
from ptt.show.studio.panels import DrawQueue
from ptt.show.studio.pool import Pool
from ptt.show.studio.results import Source
from ptt.show.studio.running import How, JobRunner
from ptt.show.studio.session import Session
from ptt.show.studio.session_writer import SessionWriter
from ptt.show.studio.steps import START
from ptt.show.studio.store import SessionFolder

DIAGNOSING = "finding what is missing"
TOPICS = ("session", "picked", "busy", "staged", "view")
Listener = Callable[[], None]


@dataclass
class Staged:
    """Files that lie ready until they are opened together: the source, the machine's text, what is wrong with them."""

    source: Source | None = None
    machine: str = ""
    question: QuestionError | None = None
    setup: tuple[dict[str, Any], ...] = ()


class Studio(JobRunner):
    """One session on a page: its steps, its folder, what is being done for it; nothing is shared with another."""

    def __init__(self, place: SessionFolder, pool: Pool) -> None:
        """Take up a session where it was left.

        Args:
            place: its folder.
            pool: what calculates.
        """
        super().__init__(place.files, pool)
        self.place = place
        self.session = place.load()
        self.staged = Staged()
        self.picked: list[int] = []
        self.view = "Load"
        self.go: Callable[[str], object] = lambda view: None  # shows another view, once there is a page
        self._listeners: dict[str, list[Listener]] = {}
        self._turn_of, self._looking = asyncio.Lock(), asyncio.Lock()
        self._keeper = SessionWriter(place, self.fail)

    def attach(self, client: Client) -> None:
        """Show the session on a page, a reloaded one for instance; a page before is forgotten.

        Args:
            client: of the page.
        """
        self.client = client
        self._listeners = {topic: [] for topic in TOPICS}
        self.later = DrawQueue(self)

    def on(self, topic: str, listener: Listener) -> None:
        """Call a view whenever something changes.

        Args:
            topic: one of `TOPICS`.
            listener: of the view.
        """
        self._listeners[topic].append(listener)

    def when(self, view: str, topic: str, listener: Listener) -> None:
        """Call a part of a view whenever something changes: at once where it is seen, else when there is time.

        Args:
            view: its name.
            topic: one of `TOPICS`.
            listener: of the view.
        """
        self.on(topic, lambda: self.later.ask(view, listener))

    def tell(self, topic: str) -> None:
        """Tell the views; a changed session is written down meanwhile."""
        if topic == "session":
            self._keeper.keep(self.session)
        if getattr(self.client, "is_deleted", False):
            return  # nobody looks any more
        # A button that is replaced by its own doing leaves no place to put things in; the page itself stays.
        with self.client:
            if topic == "session":
                self.later.rest()
            for listener in self._listeners[topic]:
                listener()

    def close(self) -> str:
        """Stop what is running; an empty session leaves nothing behind. Why it could not be kept, or ''."""
        self.cancel()
        words = self._keeper.close()
        if self.place.empty and not self.session.ready:
            self.place.remove()
        return words

    def fail(self, words: str) -> None:
        """Show what went wrong; '' takes it away."""
        self.trouble = words
        self.tell("busy")

    def pick(self, rows: list[int]) -> None:
        """Highlight readings in every view."""
        self.picked = rows
        self.tell("picked")

    def stage(self, source: Source | None = None, machine: str = "") -> None:
        """Lay files ready, to be opened together.

        Args:
            source: of the run; None leaves what lies there.
            machine: text of the machine.toml; '' leaves what lies there.
        """
        self.staged = Staged(source or self.staged.source, machine or self.staged.machine)
        self.trouble = ""
        self.tell("staged")
        self.tell("busy")

    async def open(self, source: Source, machine: str, then: Callable[[], object] = lambda: None) -> bool:
        """Read a run and hold it against a machine; what is open or mistaken is shown, and the old session stays.

        Args:
            source: the files.
            machine: text of the machine.toml.
            then: called once it is open, before anything is worked out.

        Returns:
            Whether that went well.
        """
        async with self._turn_of:
            try:
                parse_machine(machine, START)
                fresh = self.session.opened(source, machine)
                look = await self.work(f"reading {source.run}", "look", source, fresh.text)
            except (QuestionError, SetupFoundError) as met:
                question = met if isinstance(met, QuestionError) else None
                self.staged = Staged(source, machine, question, getattr(met, "findings", ()))
                self.tell("staged")
                return False
            except PttError as error:
                self.fail(str(error))
                return False
            if look is None:
                return False
            self.staged, self.picked = Staged(), []
            self.session = fresh.remembering(look=look)
            self.tell("staged")
            self.tell("session")
            with self.client:
                then()
        await self.compare()
        await self.diagnose(unasked=True)
        return True

    def with_source(self, source: Source) -> None:
        """Read the same run with one more effect of one's own; what was found stays."""
        self.session = replace(self.session, source=source)
        self.tell("session")

    async def answer(self, choice: str) -> None:
        """Answer what a file leaves open, and open it."""
        source, asked = self.staged.source, self.staged.question
        if source is not None and asked is not None:
            await self.open(source.answered(asked.about, asked.question, choice), self.staged.machine)

    async def compare(self) -> None:
        """Work out the figures of the active model in the background."""
        session = self.session
        if not session.ready or session.comparison is not None:
            return
        compared = await self.work("comparing", "compare", session.source, session.text, how="quiet")
        if compared is not None:
            self._found(session, compared=compared)

    async def diagnose(self, unasked: bool = False) -> None:
        """Find what is missing from the active model; unasked only what is not known yet and does not take long."""
        session = self.session
        long = session.look is not None and session.look.rows > LONG  # a minute or more
        if not session.ready or (unasked and (session.diagnosis is not None or long)):
            return
        how: How = "unasked" if unasked else "asked"
        found = await self.work(DIAGNOSING, "diagnose", session.source, session.text, how=how)
        if found is not None:
            self._found(session, diagnosed=found)

    async def change(self, verb: str, *effects: str) -> None:
        """Add, remove or refit, one after the other; then what is missing is looked for again."""
        async with self._turn_of:
            session = self.session
            there = {each.key for each in session.effects}
            wanted = tuple(key for key in effects if (key in there) == (verb == "remove"))
            if not session.ready or (effects and not wanted):
                return
            doing = {"add": "adding", "remove": "removing", "fit": "refitting"}[verb]
            words = f"{doing} {', '.join(wanted)}".strip()
            changed = await self.work(words, "change", session.source, session.text, verb, wanted)
            if changed is None:
                return
            self.session = session.changed(verb, wanted, changed)
            self.tell("session")
        await self._look()
        await self.diagnose(unasked=True)

    async def train(self) -> None:
        """Train the network on what the active model leaves."""
        session = self.session
        if session.ready:
            trained = await self.work("training the network", "train", session.source, session.text)
            if trained is not None:
                self._found(session, trained=trained)

    async def switch(self, key: str, on: bool) -> None:
        """Count an effect or leave it aside, without a refit."""
        await self._turn(lambda session: session.switched(key, on))

    async def undo(self) -> None:
        """One step back."""
        await self._turn(Session.undone)

    async def redo(self) -> None:
        """One step forward again."""
        await self._turn(Session.redone)

    async def resume(self) -> None:
        """Work out what a session that was taken up again lacks."""
        if self.session.ready:
            self.tell("session")
            await self._look()
            await self.diagnose(unasked=True)

    def _found(self, session: Session, **found: Any) -> None:
        """Keep what was found on the model of a session, if the run is still the same."""
        if self.session.source == session.source:
            self.session = self.session.remembering(text=session.text, **found)
            self.tell("session")

    async def _turn(self, change: Callable[[Session], Session]) -> None:
        """Change the model at once, after whatever is changing it; what it lacks then, nobody has to wait for."""
        async with self._turn_of:
            self.session = change(self.session)
            self.tell("session")
        await self._look()

    async def _look(self) -> None:
        """Work out what is not known yet of the model that is shown."""
        async with self._looking:
            session = self.session
            if session.look is None and session.ready:
                look: Look | None = await self.work("residual", "look", session.source, session.text, how="quiet")
                if look is not None:
                    self._found(session, look=look)
            await self.compare()
