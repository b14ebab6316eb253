"""Sessions on disk: taken up as they were, each for its own browser, read without running anything."""

import asyncio
import errno
import time
from dataclasses import replace
from pathlib import Path

import pytest
from studio_sample import MACHINE, OWNER, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here

from ptt.errors import InputError
from ptt.files import cannot_write
from ptt.show.studio import jobs
from ptt.show.studio.arrays import pack_look, unpack_look
from ptt.show.studio.session import Session
from ptt.show.studio.session_writer import SessionWriter
from ptt.show.studio.store import SessionFolder, SessionStore


def test_the_newest_state_gets_on_the_disk_and_a_full_disk_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    place, said, written = SessionStore(tmp_path).fresh(OWNER), [], []
    states = [replace(Session().opened(RUN, MACHINE), first=f"2026-01-0{day}") for day in (1, 2, 3, 4)]

    def slow(session: Session) -> None:
        time.sleep(0.05)
        written.append(session.first)
        SessionFolder.save(place, session)

    async def keep() -> None:
        keeper = SessionWriter(place, said.append)
        keeper.keep(states[0])
        await asyncio.sleep(0.02)  # the first is being written
        for state in states[1:3]:
            keeper.keep(state)
        await keeper.kept()
        assert (written, place.load().first) == (["2026-01-01", "2026-01-03"], "2026-01-03")
        keeper.keep(states[3])
        assert keeper.close() == ""  # the server ends before its turn comes
        await keeper.kept()
        assert (written[2:], place.load().first) == (["2026-01-04"], "2026-01-04")

    def full(session: Session) -> None:
        raise cannot_write(place.folder / "session.json", OSError(errno.ENOSPC, "No space left on device"))

    async def fail() -> None:
        keeper = SessionWriter(place, said.append)
        keeper.keep(states[0])
        await keeper.kept()
        keeper.keep(states[1])
        assert "No space left" in keeper.close()

    monkeypatch.setattr(place, "save", slow)
    asyncio.run(keep())
    assert said == []
    monkeypatch.setattr(place, "save", full)
    asyncio.run(fail())
    assert len(said) == 1 and "cannot be kept on disk" in said[0] and "No space left" in said[0]


def test_a_session_belongs_to_the_browser_that_made_it(here: Path, tmp_path: Path):
    store = SessionStore(tmp_path)
    place = store.fresh(OWNER)
    place.save(Session().opened(RUN, MACHINE))
    assert store.find(place.key, "b" * 43) is None and store.find("../../etc", OWNER) is None
    assert [each.key for each in store.recent(OWNER)] == [place.key] and store.recent("b" * 43) == []
    assert OWNER not in (place.folder / "session.json").read_text()  # whoever reads the disk cannot take its place


def test_what_cannot_be_read_is_worked_out_anew(here: Path, tmp_path: Path):
    place = SessionFolder(tmp_path, "abcdefghijkm", OWNER)
    place.save(Session().opened(RUN, MACHINE).remembering(look=jobs.look(RUN, MACHINE, silent)))
    (found,) = (place.folder / "found").iterdir()
    found.write_bytes(found.read_bytes()[:100])
    assert place.load().ready and place.load().look is None
    (place.folder / "session.json").write_text("{")
    assert not place.load().ready


def test_a_look_travels_without_anything_that_could_run(here: Path):
    look = jobs.look(RUN, MACHINE, silent)
    data = pack_look(replace(look, name=("<b>", *look.name[1:])))
    assert b"pickle" not in data and unpack_look(data).name[0] == "<b>"
    with pytest.raises((ValueError, KeyError)):
        unpack_look(b"PK\x03\x04 no archive")


def test_a_store_that_cannot_be_written_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        SessionStore(tmp_path / "file" / "store")


def test_a_store_that_is_named_from_here_is_the_same_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store = SessionStore(Path("sessions"))
    assert store.root == tmp_path / "sessions" and store.root.is_dir()
