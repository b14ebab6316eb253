"""The controller of one page: it holds the session, gives jobs to the pool, and tells the views what changed."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from nicegui import Client

from ptt.errors import PttError
from ptt.fitting.chunks import LONG
from ptt.machine import parse_machine
from ptt.show.studio.draw_queue import DrawQueue
from ptt.show.studio.looks import Look
from ptt.show.studio.outcomes import QuestionError, SetupFoundError
from ptt.show.studio.pool import Pool
from ptt.show.studio.results import Source
from ptt.show.studio.running import How, JobRunner
from ptt.show.studio.session import Session
from ptt.show.studio.session_writer import SessionWriter
from ptt.show.studio.steps import START
from ptt.show.studio.store import SessionFolder

DIAGNOSING = "finding what is missing"  # words of the job, by which the page recognises it
TOPICS = ("session", "picked", "busy", "staged", "view")  # what views may listen to
Listener = Callable[[], None]


@dataclass
class Staged:
    """Files that were dropped and not opened yet.

    Attributes:
        source: the run and how it is read; None before there is one.
        machine: text of the machine.toml; '' before there is one.
        question: what has to be answered before the run can be read.
        setup: mistakes of the set-up that were found when they were to be opened, as `ptt check --json` lists them.
        refused: whether they could not be opened as they are.
    """

    source: Source | None = None
    machine: str = ""
    question: QuestionError | None = None
    setup: tuple[dict[str, Any], ...] = ()
    refused: bool = False


class Studio(JobRunner):
    """One session on a page: its state, its folder, its jobs. Sessions share nothing but the pool of processes."""

    def __init__(self, place: SessionFolder, pool: Pool) -> None:
        """Load a session from its folder.

        Args:
            place: the folder.
            pool: processes for jobs.
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
        """Show the session on a page, such as a reloaded one; the listeners of any page before are dropped.

        Args:
            client: of the page.
        """
        self.client = client
        self._listeners = {topic: [] for topic in TOPICS}
        self.draw_queue = DrawQueue(client, lambda: self.view, lambda: self.idle)

    def on(self, topic: str, listener: Listener) -> None:
        """Register a listener that is called at once whenever something changes.

        Args:
            topic: one of `TOPICS`.
            listener: the listener.
        """
        self._listeners[topic].append(listener)

    def when(self, view: str, topic: str, listener: Listener) -> None:
        """Register a listener of a view: called at once while the view is shown, else when the page is idle.

        Args:
            view: name of the view.
            topic: one of `TOPICS`.
            listener: the listener.
        """
        self.on(topic, lambda: self.draw_queue.request(view, listener))

    def tell(self, topic: str) -> None:
        """Call the listeners of a topic; a changed session is also written to disk, in the background."""
        if topic == "session":
            self._keeper.keep(self.session)
        if getattr(self.client, "is_deleted", False):
            return
        # NiceGUI adds elements to the slot of the element whose event it handles; a listener may have removed that one.
        with self.client:
            if topic == "session":
                self.draw_queue.rest()
            for listener in self._listeners[topic]:
                listener()

    def close(self) -> str:
        """Stop all jobs and save the session; an empty one is removed. Returns why it could not be saved, or ''."""
        self.cancel()
        words = self._keeper.close()
        if self.place.empty and not self.session.ready:
            self.place.remove()
        return words

    def fail(self, words: str) -> None:
        """Show what went wrong; '' removes the message."""
        self.trouble = words
        self.tell("busy")

    def pick(self, rows: list[int]) -> None:
        """Highlight readings in every view."""
        self.picked = rows
        self.tell("picked")

    def stage(self, source: Source | None = None, machine: str = "") -> None:
        """Stage files, to be opened together later.

        Args:
            source: the run; None leaves the one that is staged.
            machine: text of the machine.toml; '' leaves the one that is staged.
        """
        self.staged = Staged(source or self.staged.source, machine or self.staged.machine)
        self.trouble = ""
        self.tell("staged")
        self.tell("busy")

    @property
    def at_hand(self) -> tuple[Source | None, str]:
        """Run and text of the machine that would be opened: those that are staged, else those of the session."""
        now = self.session.now
        return self.staged.source or self.session.source, self.staged.machine or (now.text if now else "")

    async def open(self, source: Source, machine: str, view: str = "") -> bool:
        """Read a run and compare it with a machine, then diagnose it; questions and mistakes keep the old session.

        Args:
            source: the files.
            machine: text of the machine.toml.
            view: shown once it is open, before comparison and diagnosis; '' for the one that is shown already.

        Returns:
            Whether it was opened.
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
                look = None
            if look is None:
                if self.trouble and self.staged.source == source:
                    self.staged = replace(self.staged, refused=True)
                    self.tell("staged")
                return False
            self.staged, self.picked = Staged(), []
            self.session = fresh.remembering(look=look)
            self.tell("staged")
            self.tell("session")
            if view:
                with self.client:
                    self.go(view)
        await self.compare()
        await self.diagnose(unasked=True)
        return True

    def with_source(self, source: Source) -> None:
        """Replace the source by one that reads the same run, with another effect file; all results are kept."""
        self.session = replace(self.session, source=source)
        self.tell("session")

    async def answer(self, choice: str) -> None:
        """Answer the question about the staged run, and open it."""
        source, asked = self.staged.source, self.staged.question
        if source is not None and asked is not None:
            await self.open(source.answered(asked.about, asked.question, choice), self.staged.machine)

    async def compare(self) -> None:
        """Compare the run with the active model, in the background."""
        session = self.session
        if not session.ready or session.comparison is not None:
            return
        compared = await self.work("comparing", "compare", session.source, session.text, how="quiet")
        if compared is not None:
            self._found(session, compared=compared)

    async def diagnose(self, unasked: bool = False) -> None:
        """Find what is missing from the active model; unasked only if that is not known and the run is not long."""
        session = self.session
        long = session.look is not None and session.look.rows > LONG  # it takes a minute or more
        if not session.ready or (unasked and (session.diagnosis is not None or long)):
            return
        how: How = "unasked" if unasked else "asked"
        found = await self.work(DIAGNOSING, "diagnose", session.source, session.text, how=how)
        if found is not None:
            self._found(session, diagnosed=found)

    async def change(self, verb: str, *effects: str) -> None:
        """Add or remove effects, or refit ('add', 'remove', 'fit'), then diagnose; changes wait for each other."""
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
        """Train the network on the residual of the active model."""
        session = self.session
        if session.ready:
            trained = await self.work("training the network", "train", session.source, session.text)
            if trained is not None:
                self._found(session, trained=trained)

    async def switch(self, key: str, on: bool) -> None:
        """Switch an effect on or off, without a refit."""
        await self._turn(lambda session: session.switched(key, on))

    async def undo(self) -> None:
        """One step back."""
        await self._turn(Session.undone)

    async def redo(self) -> None:
        """One step forward again."""
        await self._turn(Session.redone)

    async def resume(self) -> None:
        """Compute what a session loaded from disk lacks."""
        if self.session.ready:
            self.tell("session")
            await self._look()
            await self.diagnose(unasked=True)

    def _found(self, session: Session, **found: Any) -> None:
        """Keep results on the model that a session had when a job began, if the run is still the same."""
        if self.session.source == session.source:
            self.session = self.session.remembering(text=session.text, **found)
            self.tell("session")

    async def _turn(self, change: Callable[[Session], Session]) -> None:
        """Change the session once no other change is in progress, then compute what the new model lacks."""
        async with self._turn_of:
            self.session = change(self.session)
            self.tell("session")
        await self._look()

    async def _look(self) -> None:
        """Compute residual and comparison of the active model where they are not known yet."""
        async with self._looking:
            session = self.session
            if session.look is None and session.ready:
                look: Look | None = await self.work("residual", "look", session.source, session.text, how="quiet")
                if look is not None:
                    self._found(session, look=look)
            await self.compare()
