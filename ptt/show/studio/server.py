"""The web server of the studio: bound to 127.0.0.1, with an address for each session and access control."""

import gc
import socket
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from nicegui import Client, app, ui
from nicegui.client import ClientConnectionTimeout
from starlette.middleware.trustedhost import TrustedHostMiddleware

from ptt.errors import InputError
from ptt.show.studio.controller import Studio
from ptt.show.studio.guard import COOKIE, Guard, UploadLimit
from ptt.show.studio.page import build_page
from ptt.show.studio.pool import Pool
from ptt.show.studio.results import Source
from ptt.show.studio.store import SessionFolder, SessionStore
from ptt.show.studio.uploads import keep_effects, keep_upload

HOST = "127.0.0.1"
STAY = 60.0  # s that a tab may be disconnected (a laptop that sleeps) before its session is closed
SHADE = (
    "position:fixed;inset:0;z-index:9999;display:flex;align-items:center;justify-content:center;"
    "background:rgba(20,24,27,.85);color:#fff;font-size:20px"
)
TAKEN = "This session is open in another tab; reload to take it back."
ELSEWHERE = f"""document.body.insertAdjacentHTML('beforeend', '<div role="alert" style="{SHADE}">{TAKEN}</div>')"""


@dataclass(frozen=True)
class Opening:
    """What a fresh session starts with, from the command line.

    Attributes:
        files: name -> content.
        source: how they are read; None without a run.
        machine: text of the machine.toml; '' without one.
    """

    files: dict[str, bytes]
    source: Source | None
    machine: str


def serve(
    opening: Opening,
    port: int,
    show: bool,
    tell: Callable[[str], None],
    warn: Callable[[str], None],
    root: Path | None = None,
) -> None:
    """Serve the page until interrupted.

    Args:
        opening: what a fresh session starts with.
        port: port to listen at; 0 for a free one.
        show: whether a browser is opened.
        tell: called with the address of the page.
        warn: called with messages that no page can show any more.
        root: folder of sessions; None for the usual one.

    Raises:
        InputError: the port is in use, or the folder cannot be written.
    """
    store, pool = SessionStore(root), Pool()
    pages = _Pages(store, pool, opening, warn)
    _lay_out(pages)
    app.on_shutdown(pages.close)
    app.add_middleware(UploadLimit)
    app.add_middleware(Guard, owner=_owner_of_client)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
    port = _free_port(port)
    tell(f"http://{HOST}:{port}")
    gc.freeze()  # keeps modules loaded by now out of garbage collections, which would stop the server for 0.5 s
    ui.run(
        host=HOST, port=port, title="ptt studio", show=show, reload=False, reconnect_timeout=STAY, language="en-US",
        show_welcome_message=False, favicon="\N{STRAIGHT RULER}", tailwind=False, dark=None,
        ws_per_message_deflate=False,  # compression gains nothing within one computer
    )  # fmt: skip


class _Pages:
    """The open pages; a session is on one of them at a time."""

    def __init__(self, store: SessionStore, pool: Pool, opening: Opening, warn: Callable[[str], None]) -> None:
        self.store, self.pool, self.opening, self.warn = store, pool, opening, warn
        self.studios: dict[str, Studio] = {}

    async def show(self, place: SessionFolder, view: str) -> None:
        """Build the page of a session for the client that asks for it, on one of the views."""
        client = ui.context.client
        try:
            await client.connected(timeout=STAY)
        except ClientConnectionTimeout:  # requested by something that is no browser
            return
        self.pool.warm()
        known = self.studios.get(place.key)
        fresh = known is None and place.empty
        studio = self.studios[place.key] = known or Studio(place, self.pool)
        if known is not None and known.client is not client and known.client.has_socket_connection:
            known.client.run_javascript(ELSEWHERE)
        studio.attach(client)
        client.on_delete(lambda: self._left(studio, client))
        build_page(studio, view)
        ui.run_javascript('import("nicegui-plotly"); null')  # ahead of the first picture
        if fresh and (self.opening.files or self.opening.machine):
            await _start(studio, self.opening)
        elif known is None:
            await studio.resume()

    def find(self, key: str, owner: str) -> SessionFolder | None:
        """The folder of a session that belongs to a browser; None where there is none."""
        place, known = self.store.find(key, owner), self.studios.get(key)
        if place is None and known is not None and known.place.owner == owner:
            return known.place  # a new session is on disk only once something was opened
        return place

    def close(self) -> None:
        """End all processes, and save all sessions."""
        self.pool.close()
        for studio in list(self.studios.values()):
            self._end(studio)

    def _left(self, studio: Studio, client: Client) -> None:
        if studio.client is client:  # else the session is on another page by now
            self.studios.pop(studio.place.key, None)
            self._end(studio)

    def _end(self, studio: Studio) -> None:
        if words := studio.close():  # its page is gone, so the terminal is told
            self.warn(words)


def _lay_out(pages: _Pages) -> None:
    """Define the addresses: of a fresh session, and of one that exists."""

    @ui.page("/", title="ptt studio")
    async def root_page() -> None:
        await pages.show(pages.store.fresh(_owner(ui.context.client)), "load")

    @ui.page("/s/{key}", title="ptt studio")
    @ui.page("/s/{key}/{view}", title="ptt studio")
    async def session_page(key: str, view: str = "load") -> None:
        place = pages.find(key, _owner(ui.context.client))
        if place is None:
            _unknown()
            return
        await pages.show(place, view)


def _owner(client: Client) -> str:
    """The cookie of the browser that a page was made for."""
    request = client.request
    return "" if request is None else str(request.cookies.get(COOKIE, ""))


def _owner_of_client(key: str) -> str | None:
    client = Client.instances.get(key)
    return None if client is None else _owner(client)


def _unknown() -> None:
    with ui.element("div").style("padding: 40px; max-width: 640px"):
        ui.html("No such session", sanitize=False, tag="h1").style("font-size: 24px")
        ui.label("It was removed, or it belongs to another browser.")
        ui.link("Begin a new one", "/")


async def _start(studio: Studio, opening: Opening) -> None:
    try:
        source = keep_opening(studio.folder, opening)
    except InputError as error:
        studio.fail(str(error))
        return
    if source is not None and opening.machine:
        await studio.open(source, opening.machine)
    else:
        studio.stage(source, opening.machine)


def keep_opening(folder: Path, opening: Opening) -> Source | None:
    """Copy the files of the command line into a session's folder.

    Args:
        folder: the session's folder.
        opening: the files.

    Returns:
        The source with the names that the files have there; None without a run.

    Raises:
        InputError: a file that cannot be taken.
    """
    source = opening.source
    if source is None:
        return None
    kept = {"": ""}
    for name, data in opening.files.items():
        if name in source.effects:
            keep_effects(folder, name, data)
        else:
            kept[name] = keep_upload(folder, name, data)
    also = tuple(kept[name] for name in source.also)
    return replace(source, run=kept[source.run], also=also, targets=kept[source.targets], map_=kept[source.map_])


def _free_port(port: int) -> int:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            raise InputError(
                f"port {port} is in use", where="ptt studio", fix="end the other studio, or give --port 0"
            ) from None
        return int(probe.getsockname()[1])
