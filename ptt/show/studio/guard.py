"""Access control: requests must come from this server's own pages, and from the browser that a session belongs to.

Without it any web page that the user visits could reach the server on 127.0.0.1.
"""

import re
import secrets
from collections.abc import Awaitable, Callable
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

from starlette.responses import PlainTextResponse
from starlette.types import Message, Receive, Scope, Send

LIMIT = 64 * 2**20  # bytes of an upload: more than a million rows
SLACK = 2**16  # bytes that a form adds to its file
COOKIE = "ptt_studio"
TOKEN = re.compile(r"[A-Za-z0-9_-]{20,80}")
YEAR = 365 * 24 * 3600  # s, lifetime of the cookie
POLICY = (
    # Vue compiles templates in the page, which takes 'unsafe-eval'; nothing but this server is ever a source.
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; "
    "object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
HEADERS = {
    b"content-security-policy": POLICY.encode(),
    b"x-frame-options": b"DENY",
    b"x-content-type-options": b"nosniff",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
}

App = Callable[[Scope, Receive, Send], Awaitable[None]]
Owner = Callable[[str], str | None]  # id of a NiceGUI client -> cookie of the browser that it was made for


def owner_of(scope: Scope) -> str:
    """This server's cookie in a request; '' where there is none, or not of the form that the server gives out."""
    header = dict(scope["headers"]).get(b"cookie", b"").decode("latin-1")
    try:
        morsel = SimpleCookie(header).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel is not None and TOKEN.fullmatch(morsel.value) else ""


class Guard:
    """ASGI middleware: refuses foreign origins, gives each browser a cookie, and adds security headers."""

    def __init__(self, app: App, owner: Owner) -> None:
        """Wrap an application; `owner` tells which browser a client belongs to."""
        self.app, self.owner = app, owner

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on a request that is allowed, refuse any other."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        cookie = owner_of(scope)
        client = _client_of(scope)
        known = self.owner(client) if client else None
        if not same_origin(headers.get(b"origin"), headers.get(b"host", b"")) or known not in (None, cookie):
            await _refuse(scope, receive, send)
            return
        fresh = "" if cookie or scope["type"] == "websocket" else secrets.token_urlsafe(32)
        if fresh:
            scope = dict(scope) | {"headers": [*scope["headers"], (b"cookie", f"{COOKIE}={fresh}".encode())]}

        async def guarded(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.accept"):
                message = dict(message) | {"headers": _headers(message.get("headers", ()), fresh)}
            await send(message)

        await self.app(scope, receive, guarded)


def same_origin(origin: bytes | None, host: bytes) -> bool:
    """Whether a request comes from a page of this server, or from no page at all.

    Args:
        origin: the header Origin; None where there is none.
        host: the header Host, already checked to name this computer.

    Returns:
        False for pages of other hosts, ports and schemes, and for 'null'.
    """
    if origin is None:
        return True
    parts = urlsplit(origin.decode("latin-1"))
    return parts.scheme == "http" and parts.netloc.lower() == host.decode("latin-1").lower()


def _client_of(scope: Scope) -> str:
    """Id of the NiceGUI client that a socket or an upload names; '' where it names none."""
    asked = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("client_id", [""])[0]
    named = re.match(r"/_nicegui/client/([^/]+)/", scope["path"])
    return named[1] if named else asked


def _headers(given: Any, fresh: str) -> list[tuple[bytes, bytes]]:
    kept = [(name, value) for name, value in given if not name.lower().startswith(b"access-control-")]
    kept = [(name, value) for name, value in kept if name.lower() not in HEADERS]
    cookie = f"{COOKIE}={fresh}; Path=/; Max-Age={YEAR}; HttpOnly; SameSite=Strict".encode()
    return [*kept, *HEADERS.items(), *([(b"set-cookie", cookie)] if fresh else [])]


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    await PlainTextResponse("not from this page", status_code=403)(scope, receive, send)


class UploadLimit:
    """ASGI middleware: refuses uploads whose stated or actual size exceeds the limit."""

    def __init__(self, app: App) -> None:
        """Wrap an application."""
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on a request that is small enough, refuse any other."""
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
