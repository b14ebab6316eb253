"""Sessions on disk: a folder for each, with its files, its state and its results, so that it survives a restart."""

import hashlib
import json
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from ptt.errors import InputError, PttError
from ptt.files import write_bytes, write_text
from ptt.show.studio.arrays import pack_look, unpack_look
from ptt.show.studio.results import Compared, Diagnosed, Source, Trained
from ptt.show.studio.session import Session
from ptt.show.studio.snapshot import Rung, Snapshot

KEY = re.compile(r"[a-z0-9]{12}")
STATE, FOUND, FILES = "session.json", "found", "files"
DIAGNOSED = "learned.json"  # diagnoses; the name is kept for sessions that are on disk already
SHOWN_SESSIONS = 12  # most earlier sessions that are listed
VERSION = 1


def usual_root() -> Path:
    """The folder of sessions unless another is named."""
    given = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return Path(given or Path.home() / ".local" / "state") / "ptt" / "studio"


@dataclass(frozen=True)
class Listed:
    """An earlier session in a list: its key, words on it, and when it was changed (ISO 8601, UTC)."""

    key: str
    words: str
    changed: str


class SessionFolder:
    """The folder of one session."""

    def __init__(self, root: Path, key: str, owner: str) -> None:
        """Make the folder if it is not there.

        Args:
            root: folder of all sessions.
            key: key of the session, as in its address.
            owner: cookie of the browser that it belongs to.
        """
        self.root, self.key, self.owner = root, key, owner
        self.folder = root / key
        self.files = self.folder / FILES
        self.files.mkdir(parents=True, exist_ok=True)
        self._kept: set[Path] = set()

    def save(self, session: Session) -> None:
        """Write a session; each result is written only once. Not reentrant: `SessionWriter` calls it one at a time.

        Raises:
            InputError: the folder cannot be written.
            HostError: the disk is full.
        """
        if session.source is None or session.now is None:
            return
        state = {
            "version": VERSION,
            "owner": _hashed(self.owner),
            "changed": datetime.now(UTC).isoformat(timespec="seconds"),
            "words": f"{session.source.run} on {session.now.file.machine.name}: {session.now.words}",
            "source": asdict(session.source),
            "now": _plain(session.now),
            "past": [_plain(each) for each in session.past],
            "future": [_plain(each) for each in session.future],
            "first": session.first,
            "later": session.later,
            "said": session.said,
        }
        for text, look in session.looks.items():
            self._once(session.source, text, "look.npz", partial(pack_look, look))
        for text, compared in session.comparisons.items():
            said = {"data": compared.data, "text": compared.text}
            self._once(session.source, text, "compared.json", partial(_json, said))
        for text, diagnosed in session.diagnoses.items():
            self._once(session.source, text, DIAGNOSED, partial(_json, _told(diagnosed)))
        for text, trained in session.trainings.items():
            self._once(session.source, text, "trained.json", partial(_json, trained.data))
            self._once(session.source, text, "trained.zip", partial(bytes, trained.archive))
        write_text(self.folder / STATE, json.dumps(state))

    def load(self) -> Session:
        """The session as it was saved; an empty one where there is none, or one of another version."""
        try:
            state = json.loads((self.folder / STATE).read_text(encoding="utf-8"))
            if state["version"] != VERSION:
                return Session()
            source = _source(state["source"])
            now = _snapshot(state["now"])
            past, future = (tuple(_snapshot(each) for each in state[key]) for key in ("past", "future"))
            later = tuple((str(run), str(date)) for run, date in state.get("later", ()))
            said = tuple((str(a), str(b), str(c), str(d)) for a, b, c, d in state.get("said", ()))
        except (OSError, ValueError, KeyError, TypeError):
            return Session()
        found: dict[str, dict[str, Any]] = {"looks": {}, "comparisons": {}, "diagnoses": {}, "trainings": {}}
        for snapshot in (*past, now, *future):
            with suppress(PttError):
                self._find(source, snapshot.active, found)
        return Session(source, now, past, future, **found, first=str(state.get("first", "")), later=later, said=said)

    def remove(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @property
    def empty(self) -> bool:
        """Whether no session was ever saved here."""
        return not (self.folder / STATE).exists()

    def _place(self, source: Source, text: str, kind: str) -> Path:
        digest = hashlib.sha256(json.dumps([asdict(source), text]).encode()).hexdigest()[:24]
        return self.folder / FOUND / f"{digest}.{kind}"

    def _once(self, source: Source, text: str, kind: str, content: Any) -> None:
        path = self._place(source, text, kind)
        if path not in self._kept and not path.exists():
            write_bytes(path, content())
        self._kept.add(path)

    def _find(self, source: Source, text: str, found: dict[str, dict[str, Any]]) -> None:
        """Load the results on one model into `found`; what cannot be read is left out and computed again later."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            found["looks"][text] = unpack_look(self._place(source, text, "look.npz").read_bytes())
            compared = json.loads(self._place(source, text, "compared.json").read_text(encoding="utf-8"))
            found["comparisons"][text] = Compared(found["looks"][text], compared["data"], compared["text"])
        with suppress(OSError, ValueError, KeyError, TypeError):
            diagnosed = json.loads(self._place(source, text, DIAGNOSED).read_text(encoding="utf-8"))
            found["diagnoses"][text] = Diagnosed(**diagnosed)
        with suppress(OSError, ValueError, KeyError, TypeError):
            data = json.loads(self._place(source, text, "trained.json").read_text(encoding="utf-8"))
            found["trainings"][text] = Trained(data, self._place(source, text, "trained.zip").read_bytes())


class SessionStore:
    """All sessions of this computer's user."""

    def __init__(self, root: Path | None = None) -> None:
        """Make the folder; where the usual one cannot be made, a temporary one is used.

        Args:
            root: folder of all sessions; None for the usual one.

        Raises:
            InputError: the folder that was named cannot be made.
        """
        self.root = (root or usual_root()).absolute()  # workers change their working directory
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            os.chmod(self.root, 0o700)
        except OSError as error:
            if root is not None:
                raise InputError(f"cannot be written ({error.strerror})", where=str(root), fix="name another") from None
            self.root = Path(tempfile.mkdtemp(prefix="ptt-studio-"))

    def fresh(self, owner: str) -> SessionFolder:
        """The folder of a new session of a browser."""
        return SessionFolder(
            self.root, "".join(secrets.choice("abcdefghijkmnpqrstuvwxyz23456789") for _ in range(12)), owner
        )

    def find(self, key: str, owner: str) -> SessionFolder | None:
        """The folder of a session by its key; None where there is none, or it belongs to another browser."""
        if not KEY.fullmatch(key) or self._state(key).get("owner") != _hashed(owner):
            return None
        return SessionFolder(self.root, key, owner)

    def recent(self, owner: str) -> list[Listed]:
        """The latest sessions of a browser, the last changed first."""
        own = _hashed(owner)
        found = [(self._state(path.name), path.name) for path in self.root.iterdir() if KEY.fullmatch(path.name)]
        listed = [
            Listed(key, str(state["words"]), str(state["changed"])) for state, key in found if state.get("owner") == own
        ]
        return sorted(listed, key=lambda each: each.changed, reverse=True)[:SHOWN_SESSIONS]

    def _state(self, key: str) -> Mapping[str, Any]:
        try:
            state = json.loads((self.root / key / STATE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return state if isinstance(state, dict) else {}


def _hashed(owner: str) -> str:
    return hashlib.sha256(owner.encode()).hexdigest()


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()


def _told(diagnosed: Diagnosed) -> dict[str, Any]:
    """What is saved of a diagnosis: plain values, without the pickle."""
    return {name: value for name, value in asdict(diagnosed).items() if name != "whole"}


def _plain(snapshot: Snapshot) -> dict[str, Any]:
    return asdict(snapshot) | {"off": sorted(snapshot.off), "removed": sorted(snapshot.removed)}


def _snapshot(data: Mapping[str, Any]) -> Snapshot:
    own = dict(data)
    own["rungs"] = tuple(Rung(**rung) for rung in data["rungs"])
    own["off"], own["removed"] = frozenset(data["off"]), frozenset(data["removed"])
    own["commands"] = tuple(data["commands"])
    return Snapshot(**own)


def _source(data: Mapping[str, Any]) -> Source:
    own: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
    own["answers"] = tuple(tuple(pair) for pair in data["answers"])
    return Source(**own)
