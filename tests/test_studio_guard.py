"""Who is let in to the studio, and what a pool of processes does for them."""

import asyncio
from multiprocessing import active_children
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pandas as pd
import pytest
from nicegui import Client
from studio_sample import MACHINE, OWNER, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here

from ptt.show.studio import jobs
from ptt.show.studio.controller import Studio
from ptt.show.studio.guard import COOKIE, Guard, same_origin
from ptt.show.studio.outcomes import JobFailedError, SetupFoundError
from ptt.show.studio.pool import Pool
from ptt.show.studio.results import Source
from ptt.show.studio.session import Session
from ptt.show.studio.store import SessionStore


@pytest.mark.parametrize(
    ("origin", "let_in"),
    [
        (None, True),
        (b"http://127.0.0.1:8317", True),
        (b"http://127.0.0.1:9999", False),
        (b"null", False),
        (b"https://127.0.0.1:8317", False),
        (b"http://evil.example", False),
        (b"http://127.0.0.1:8317.evil.example", False),
    ],
)
def test_only_pages_of_this_server_are_let_in(origin: bytes | None, let_in: bool):
    assert same_origin(origin, b"127.0.0.1:8317") is let_in


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_the_guard_refuses_foreign_pages_and_foreign_browsers(kind: str):
    said: list[dict] = []

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": [(b"access-control-allow-origin", b"*")]})

    def ask(path: str, cookie: str, origin: bytes) -> dict:
        async def send(message):
            said.append(message)

        headers = [(b"host", b"127.0.0.1:1"), (b"origin", origin), (b"cookie", f"{COOKIE}={cookie}".encode())]
        scope = {"type": kind, "path": path, "headers": headers, "query_string": b"client_id=mine", "method": "GET"}
        asyncio.run(Guard(app, {"mine": OWNER}.get)(scope, None, send))
        return said[-1] if kind == "websocket" else said[-1] | {"first": said[0]}

    good = ask("/", OWNER, b"http://127.0.0.1:1")
    assert good["status"] == 200
    names = {name.lower() for name, _ in good["headers"]}
    assert b"access-control-allow-origin" not in names and b"content-security-policy" in names
    assert b"frame-ancestors 'none'" in dict(good["headers"])[b"content-security-policy"]
    for path, cookie, origin in (("/", OWNER, b"http://evil.example"), ("/", "b" * 43, b"http://127.0.0.1:1")):
        said.clear()
        refused = ask(path, cookie, origin)
        assert refused.get("first", refused).get("status", 403) == 403 and not any(m.get("status") == 200 for m in said)


def test_a_browser_without_a_cookie_gets_one_of_its_own():
    async def fetch() -> list[tuple[bytes, bytes]]:
        kept: list[tuple[bytes, bytes]] = []

        async def app(scope, receive, send):
            kept.extend(value for value in scope["headers"] if value[0] == b"cookie")
            await send({"type": "http.response.start", "status": 200, "headers": []})

        async def send(message):
            kept.extend(message.get("headers", ()))

        await Guard(app, lambda client: None)(
            {"type": "http", "path": "/", "headers": [], "query_string": b""}, None, send
        )
        return kept

    first, again = dict(asyncio.run(fetch())), dict(asyncio.run(fetch()))
    cookie = first[b"set-cookie"].decode()
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie and first[b"cookie"] != again[b"cookie"]
    assert cookie.startswith(first[b"cookie"].decode())


def test_a_pool_shares_few_processes_gives_them_back_and_is_stopped(folder: Path, monkeypatch: pytest.MonkeyPatch):
    async def course() -> None:
        others, pool = set(active_children()), Pool(most=1, idle=0.2)
        try:
            seen: list[str] = []
            names = pool.run(folder, "names", ("serial", ()), lambda what, done, of: seen.append(what))
            both = await asyncio.gather(pool.run(folder, "names", ("three-ptt", ())), names)
            assert "backlash" in both[0] and "dh-offsets" in both[1] and len(active_children()) == len(others) + 1
            assert seen[0].startswith("waiting")
            with pytest.raises(JobFailedError, match=r"No such file|no such file"):
                await pool.run(folder, "look", (Source("none.csv"), MACHINE))
            frame = pd.read_csv(folder / "run.csv", dtype=str)
            frame["z_meas"] = (-frame["z_meas"].astype(float)).astype(str)
            frame.to_csv(folder / "left.csv", index=False)
            with pytest.raises(SetupFoundError) as found:
                await pool.run(folder, "look", (Source("left.csv"), MACHINE))
            assert found.value.findings[0]["rms_um"]["after"] < found.value.findings[0]["rms_um"]["before"] / 100.0
            (process,) = set(active_children()) - others
            monkeypatch.setattr("ptt.show.studio.pool.LEAVE", 60.0)
            for _ in range(2):  # what is stopped leaves off by itself, and its process takes the next job
                told = await _stopped(pool, folder)
                assert set(active_children()) == others | {process} and "drawing it" not in told
                assert "backlash" in await pool.run(folder, "names", ("three-ptt", ()))
            monkeypatch.setattr("ptt.show.studio.pool.LEAVE", 0.0)  # what does not leave off is ended
            await _stopped(pool, folder)
            assert not process.is_alive()
            assert "dh-offsets" in await pool.run(folder, "names", ("serial", ()))
            await asyncio.sleep(1.6)
            assert set(active_children()) == others  # without work for longer than it may be
        finally:
            pool.close()

    asyncio.run(course())


async def _stopped(pool: Pool, folder: Path) -> list[str]:
    """Stop a diagnosis in its middle: the stages that it came to."""
    told: list[str] = []
    begun = asyncio.Event()

    def tell(what: str, done: int, of: int) -> None:
        told.append(what)
        begun.set() if what.startswith("which effects") else None

    task = asyncio.create_task(pool.run(folder, "diagnose", (RUN, MACHINE), tell))
    await begun.wait()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    return told


def test_an_undo_waits_for_nothing_that_is_worked_out(here: Path, tmp_path: Path):
    async def course() -> None:
        async def slow(folder: Path, job: str, arguments: tuple, *given: object, **how: object) -> object:
            return jobs.change(*arguments, silent) if job == "change" else await asyncio.Event().wait()

        studio = Studio(SessionStore(tmp_path).fresh(OWNER), cast(Pool, SimpleNamespace(run=slow)))
        studio.client = cast(Client, SimpleNamespace(is_deleted=True))
        studio.session = Session().opened(RUN, MACHINE).remembering(compared=jobs.compare(RUN, MACHINE, silent))
        adding = asyncio.create_task(studio.change("add", "backlash"))  # of what it leaves no picture comes
        while not studio.session.past:
            await asyncio.sleep(0.01)
        assert studio.session.look is None
        back = asyncio.create_task(studio.undo())
        await asyncio.sleep(0.05)
        assert studio.session.text == MACHINE and studio.session.look is not None
        adding.cancel()
        await back

    asyncio.run(course())
