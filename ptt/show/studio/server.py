"""The server: bound to 127.0.0.1, a studio for each browser tab, uploads of limited size."""

import socket
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Any

from nicegui import app, ui
from nicegui.client import ClientConnectionTimeout
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import PlainTextResponse
from starlette.types import Message, Receive, Scope, Send

from ptt.errors import InputError
from ptt.show.studio.controller import LIMIT, Studio
from ptt.show.studio.page import build_page
from ptt.show.studio.results import Source

HOST = "127.0.0.1"
SLACK = 2**16  # bytes that a form adds to its file
STAY = 60.0  # s that a tab may be away (a laptop that sleeps) before its session ends


@dataclass(frozen=True)
class Opening:
    """What a fresh tab starts with: files by name and content, how they are read, and the machine's text."""

    files: dict[str, bytes]
    source: Source | None
    machine: str


def serve(opening: Opening, port: int, show: bool, tell: Callable[[str], None]) -> None:
    """Serve the page until interrupted.

    Args:
        opening: what a fresh tab starts with.
        port: where to listen; 0 takes a free one.
        show: whether a browser is opened.
        tell: says where the page is.

    Raises:
        InputError: the port is in use.
    """
    studios: dict[str, Studio] = {}

    @ui.page("/", title="ptt studio")
    async def root() -> None:
        client = ui.context.client
        try:
            await client.connected(timeout=STAY)
        except ClientConnectionTimeout:  # the page was asked for by something that is no browser
            return
        tab = str(client.tab_id)
        known = studios.get(tab)
        studio = studios[tab] = known or Studio()
        studio.attach(client)

        def close() -> None:
            if studio.client is client:  # else the page was loaded anew and lives on
                studios.pop(tab, None)
                studio.close()

        client.on_delete(close)
        build_page(studio)
        ui.run_javascript('import("nicegui-plotly"); null')  # while the person looks for a file
        if known is None and (opening.files or opening.machine):
            await _start(studio, opening)

    def close_all() -> None:
        for studio in studios.values():
            studio.close()

    app.on_shutdown(close_all)
    app.add_middleware(UploadLimit)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
    port = _free_port(port)
    tell(f"http://{HOST}:{port}")
    ui.run(
        host=HOST, port=port, title="ptt studio", show=show, reload=False, reconnect_timeout=STAY, language="en-US",
        show_welcome_message=False, favicon="\N{STRAIGHT RULER}",
    )  # fmt: skip


class UploadLimit:
    """Refuses uploads that say, or turn out, to be larger than the limit."""

    def __init__(self, app: Callable[[Scope, Receive, Send], Awaitable[None]]) -> None:
        """Wrap an application."""
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what is small enough."""
        if scope["type"] != "http" or scope["method"] != "POST":
            await self.app(scope, receive, send)
            return
        headers: dict[Any, Any] = dict(scope["headers"])
        try:
            said = int(headers.get(b"content-length", b"-1"))
        except ValueError:
            said = -1
        if not 0 <= said <= LIMIT + SLACK:
            refused = PlainTextResponse(f"larger than {LIMIT >> 20} MB", status_code=413)
            await refused(scope, receive, send)
            return
        left = said

        async def counted() -> Message:
            nonlocal left
            message = await receive()
            left -= len(message.get("body", b""))
            return message if left >= 0 else {"type": "http.disconnect"}

        await self.app(scope, counted, send)


async def _start(studio: Studio, opening: Opening) -> None:
    try:
        source = keep_opening(studio, opening)
    except InputError as error:
        studio.fail(str(error))
        return
    studio.machine, studio.pending = opening.machine, source
    studio.tell("session")
    if source is not None and opening.machine:
        await studio.open(source, opening.machine)


def keep_opening(studio: Studio, opening: Opening) -> Source | None:
    """Copy the files of the command line into a tab's folder.

    Args:
        studio: of the tab.
        opening: the files.

    Returns:
        The source by the names that the files have there.

    Raises:
        InputError: a file that cannot be taken.
    """
    source = opening.source
    if source is None:
        return None
    kept = {"": ""}
    for name, data in opening.files.items():
        if name in source.effects:
            studio.keep_effects(name, data)
        else:
            kept[name] = studio.keep(name, data)
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
