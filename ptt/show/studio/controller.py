"""One page's hands: keeps the session, gives jobs to the worker, tells the views what changed."""

import asyncio
import shutil
import tempfile
import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

from nicegui import Client, ui

from ptt.errors import InputError, PttError
from ptt.files import write_bytes
from ptt.machine import parse_machine
from ptt.show.studio.looks import Look
from ptt.show.studio.results import EFFECTS, SEAL, Source
from ptt.show.studio.session import START, Session
from ptt.show.studio.worker import JobCancelledError, JobFailedError, QuestionError, Worker

LIMIT = 64 * 2**20  # bytes of an upload: more than a million rows
RESERVED = ("model.toml", "answers.toml", "sliders.csv", "report.html", "compensator", "challenge", EFFECTS, SEAL)
Listener = Callable[[], None]


@dataclass(frozen=True)
class Busy:
    """What is being done: words, how much of how much (0 of 0 where nobody knows)."""

    words: str
    done: int = 0
    of: int = 0


class Studio:
    """One browser tab: its session, its worker and its folder; nothing is shared with another tab."""

    def __init__(self) -> None:
        """Make a folder and start the worker in it."""
        self.folder = Path(tempfile.mkdtemp(prefix="ptt-studio-"))
        self.worker = Worker(self.folder)
        self.session = Session()
        self.picked: list[int] = []
        self.trouble = ""
        self.busy: Busy | None = None
        self.machine: str = ""
        self.pending: Source | None = None
        self._listeners: dict[str, list[Listener]] = {}
        self._lock = asyncio.Lock()
        self._epoch = 0

    def attach(self, client: Client) -> None:
        """Show the session on a page, a reloaded one for instance; a page before is forgotten.

        Args:
            client: of the page.
        """
        self.client = client
        self._listeners = {"session": [], "picked": [], "busy": []}

    def on(self, topic: str, listener: Listener) -> None:
        """Call a view whenever something changes.

        Args:
            topic: 'session', 'picked' or 'busy'.
            listener: of the view.
        """
        self._listeners[topic].append(listener)

    def tell(self, topic: str) -> None:
        """Tell the views."""
        # A button that is replaced by its own doing leaves no place to put things in; the page itself stays.
        with self.client:
            for listener in self._listeners[topic]:
                listener()

    def close(self) -> None:
        """Stop the worker and remove the folder."""
        self.worker.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def fail(self, words: str) -> None:
        """Show what went wrong; '' takes it away."""
        self.trouble = words
        self.tell("busy")

    def pick(self, rows: list[int]) -> None:
        """Highlight readings in every view."""
        self.picked = rows
        self.tell("picked")

    def cancel(self) -> None:
        """Stop what is running."""
        self._epoch += 1
        if self.worker.busy:
            self.worker.cancel()

    async def work(self, words: str, job: str, *arguments: Any, quiet: bool = False) -> Any:
        """Do a job off the page, one at a time.

        Args:
            words: what is done, for the person.
            job: name of the job.
            *arguments: what it takes.
            quiet: a job that nobody asked for; others need not wait until it is over to be asked for.

        Returns:
            Its result; None where it was stopped or failed, which is shown.
        """
        if self.busy is not None and not quiet:
            self.fail(f"{words}: not begun, because '{self.busy.words}' is not done; wait, or cancel it")
            return None
        epoch = self._epoch
        if not quiet:
            self.trouble = ""
            self._is_busy(Busy(words))
        try:
            async with self._lock:
                if epoch != self._epoch:
                    raise JobCancelledError("stopped")
                return await self.worker.run(job, *arguments, tell=self._teller(words, quiet))
        except JobCancelledError:
            if not quiet:
                self.trouble = f"{words}: stopped"
        except JobFailedError as error:
            self.trouble = str(error)
        finally:
            if not quiet:
                self._is_busy(None)
            else:
                self.tell("busy")
        return None

    async def open(self, source: Source, machine: str) -> bool:
        """Read a run and hold it against a machine; asks where the file is ambiguous.

        Args:
            source: the files.
            machine: text of the machine.toml.

        Returns:
            Whether that went well; else the old session stays.
        """
        try:
            parse_machine(machine, START)
            fresh = self.session.opened(source, machine)
            look = await self.work(f"reading {source.run}", "look", source, fresh.text)
        except QuestionError as question:
            with self.client:
                answer = await _ask(question)
            if answer is None:
                self.fail(f"{question.question}: not answered, so the run was not read")
                return False
            return await self.open(replace(source, answers=(*source.answers, (question.question, answer))), machine)
        except PttError as error:
            self.fail(str(error))
            return False
        if look is None:
            return False
        self.machine, self.pending, self.picked = machine, None, []
        self.session = fresh.remembering(look=look)
        self.tell("session")
        await self.compare()
        return True

    async def compare(self) -> None:
        """Work out the figures of the active model in the background."""
        session = self.session
        if not session.ready or session.comparison is not None:
            return
        compared = await self.work("comparing", "compare", session.source, session.text, quiet=True)
        if compared is not None and self.session.source == session.source:
            self.session = replace(
                self.session,
                looks={**self.session.looks, session.text: compared.look},
                comparisons={**self.session.comparisons, session.text: compared},
            )
            self.tell("session")

    async def learn(self) -> None:
        """Find what is missing from the active model."""
        session = self.session
        if not session.ready:
            return
        found = await self.work("finding what is missing", "learn", session.source, session.text)
        if found is not None and self.session.source == session.source:
            self.session = replace(self.session, lessons={**self.session.lessons, session.text: found})
            self.tell("session")

    async def change(self, verb: str, *effects: str) -> None:
        """Add, remove or refit."""
        session = self.session
        if not session.ready:
            return
        doing = {"add": "adding", "remove": "removing", "fit": "refitting"}[verb]
        words = f"{doing} {', '.join(effects)}".strip()
        changed = await self.work(words, "change", session.source, session.text, verb, effects)
        if changed is not None:
            self.session = session.changed(verb, effects, changed)
            await self._look()

    async def switch(self, key: str, on: bool) -> None:
        """Count an effect or leave it aside, without a refit."""
        await self._turn(lambda session: session.switched(key, on))

    async def undo(self) -> None:
        """One step back."""
        await self._turn(Session.undone)

    async def redo(self) -> None:
        """One step forward again."""
        await self._turn(Session.redone)

    async def train(self) -> None:
        """Train the network on what the active model leaves."""
        session = self.session
        if not session.ready:
            return
        trained = await self.work("training the network", "train", session.source, session.text)
        if trained is not None and self.session.source == session.source:
            self.session = replace(self.session, trainings={**self.session.trainings, session.text: trained})
            self.tell("session")

    def keep(self, name: str, data: bytes) -> str:
        """Keep an uploaded file in the session's folder, beside whatever is there.

        Args:
            name: as the browser gives it; only its last part counts.
            data: its content, never executed.

        Returns:
            The name in the folder; a number is added where another file has that name.

        Raises:
            InputError: larger than the limit, or a program.
        """
        if len(data) > LIMIT:
            raise InputError(f"larger than {LIMIT >> 20} MB", where=safe_name(name), fix="split it")
        wanted = safe_name(name)
        if _folded(wanted).endswith(".py"):
            fix = "name your own effects when starting the studio: ptt studio --effects FILE.py"
            raise InputError("a program is not taken from the page", where=wanted, fix=fix)
        taken = {_folded(file.name): file for file in self.folder.iterdir()} | dict.fromkeys(RESERVED)
        for kept in _numbered(wanted):
            there = taken.get(_folded(kept))
            if _folded(kept) not in taken:
                write_bytes(self.folder / kept, data)
                return kept
            if there is not None and there.is_file() and there.read_bytes() == data:
                return there.name
        raise AssertionError  # numbers do not end

    def keep_effects(self, name: str, data: bytes) -> None:
        """Keep a file of effects that was named when the studio was started; it will be executed.

        Args:
            name: of the file.
            data: its content.
        """
        place = self.folder / EFFECTS
        place.mkdir(exist_ok=True)
        write_bytes(place / name, data)

    async def _turn(self, change: Callable[[Session], Session]) -> None:
        """Change the model at once; while something else is changing it, everything stays as it is."""
        if self.busy is None:
            self.session = change(self.session)
        await self._look()

    async def _look(self) -> None:
        """Show a changed model; what is known of it already is not worked out again."""
        session = self.session
        self.tell("session")
        if session.look is None and session.ready:
            look: Look | None = await self.work("residual", "look", session.source, session.text, quiet=True)
            if look is not None and self.session.source == session.source:
                self.session = replace(self.session, looks={**self.session.looks, session.text: look})
                self.tell("session")
        await self.compare()

    def _teller(self, words: str, quiet: bool) -> Callable[[str, int, int], None]:
        def tell(what: str, done: int, of: int) -> None:
            if not quiet:
                self._is_busy(Busy(f"{words}: {what}" if what else words, done, of))

        return tell

    def _is_busy(self, busy: Busy | None) -> None:
        self.busy = busy
        self.tell("busy")


def safe_name(name: str) -> str:
    """A file name without folders or odd characters."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    kept = "".join(letter if letter.isalnum() or letter in "._- ()+" else "_" for letter in last).strip(". ")
    return kept[-100:] or "file"


def _numbered(name: str) -> Iterator[str]:
    """The name itself, then 'name (2)' and so on, the ending kept."""
    yield name
    place = Path(name)
    yield from (f"{place.stem} ({number}){place.suffix}" for number in count(2))


def _folded(name: str) -> str:
    """What a file system that ignores case and the spelling of accents compares."""
    return unicodedata.normalize("NFC", name).casefold()


async def _ask(question: QuestionError) -> str | None:
    """Put a question to the person."""
    with ui.dialog() as dialog, ui.card():
        ui.label(question.question).classes("text-subtitle1")
        choice = ui.radio(list(question.choices), value=question.choices[0]).props('aria-label="answers"')
        with ui.row():
            ui.button("Answer", on_click=lambda: dialog.submit(choice.value)).props("no-caps")
            ui.button("Do not read it", on_click=lambda: dialog.submit(None)).props("flat no-caps")
    answer = await dialog
    return None if answer is None else str(answer)
