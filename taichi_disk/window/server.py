"""The sandbox as a page: one server, one sandbox, which the first visitor plays with and the others watch.

`websockets` serves the page's files and its messages. This module adds access control: a token in the address, the
page's own origin, and a check of every message.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import socket
import sys
import webbrowser
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.asyncio.server import serve as listen
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from taichi_disk.errors import TaichiDiskError
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.audience import Audience, Visitor
from taichi_disk.window.commands import MAX_BYTES
from taichi_disk.window.controls import Entry
from taichi_disk.window.session import Session

LOCAL = ("127.0.0.1", "localhost")
_POLLED = 0.1  # between two looks at whether a signal has come [s]
_GONE_AFTER = 20.0  # a page that answers no ping for so long has gone [s]
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


def serve(playlist: list[Entry], host: str = LOCAL[0], port: int = 0, open_browser: bool = False) -> None:
    """Serve the sandbox until Ctrl-C. A `port` of 0: one that is free.

    Prints the address, with the token that every request needs. Raises TaichiDiskError if it cannot listen there,
    KeyboardInterrupt after Ctrl-C.
    """
    try:
        listening = socket.create_server((host, port))
    except (OSError, OverflowError) as error:
        raise TaichiDiskError(f"cannot listen at {host}, port {port}: {error}; choose another --port") from None
    page = Page(Session(playlist, KernelCache()), secrets.token_urlsafe(16))
    try:
        asyncio.run(page.run(listening, host, open_browser))
    finally:
        if page.audience.ignored:
            print(f"note: {page.audience.ignored} malformed messages were ignored", file=sys.stderr)


class Page:
    """Serves `session`.

    Attributes:
        token: the first part of every path: nothing is served without it.
        audience: who is connected.
    """

    def __init__(self, session: Session, token: str) -> None:
        self.audience, self.token = Audience(session), token

    async def run(self, listening: socket.socket, host: str, open_browser: bool) -> None:
        """Serve until a signal comes, which is raised as KeyboardInterrupt."""
        logger = logging.getLogger("taichi_disk.page")
        logger.setLevel(logging.CRITICAL + 1)  # what strangers send is not worth a line
        options: dict[str, Any] = {"max_size": MAX_BYTES, "max_queue": 64, "compression": None, "server_header": None}
        options |= {"ping_timeout": _GONE_AFTER, "logger": logger}
        async with listen(self._meet, sock=listening, process_request=self.answer, **options):
            port, name = listening.getsockname()[1], socket.gethostname() if host == "0.0.0.0" else host
            address = f"http://{name}:{port}/{self.token}/"
            print(f"the sandbox is at {address}\nCtrl-C ends it", flush=True)
            if host not in LOCAL:
                print(
                    "note: whoever has this address and reaches this machine can play; nothing is encrypted", flush=True
                )
            if open_browser:
                webbrowser.open(address)
            while True:
                raise_if_interrupted()
                if failure := self.audience.failure:
                    raise failure
                await asyncio.sleep(_POLLED)

    # ---- the door

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, or a refusal; None opens the websocket."""
        _, token, name = (*request.path.split("?")[0].split("/", 2), "", "")[:3]
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return _response(HTTPStatus.FORBIDDEN, b"Use the whole address that `taichi-disk view` printed.")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            # A script of another site can open a websocket here, but not pretend that it comes from here.
            origin = request.headers.get("Origin", "").partition("://")[2]
            allowed = name == "socket" and origin and origin == request.headers.get("Host")
            return None if allowed else _response(HTTPStatus.FORBIDDEN, b"This websocket is for its own page.")
        if request.path == f"/{token}":
            return _response(HTTPStatus.TEMPORARY_REDIRECT, b"", Location=f"/{self.token}/")
        name = name or "index.html"
        suffix = name[name.rfind(".") :]
        known = {one.name for one in files("taichi_disk.web").iterdir()}
        if suffix not in TYPES or name not in known:
            return _response(HTTPStatus.NOT_FOUND, b"There is no such file.")
        return _response(HTTPStatus.OK, files("taichi_disk.web").joinpath(name).read_bytes(), TYPES[suffix])

    async def _meet(self, connection: ServerConnection) -> None:
        async def send(message: str | bytes) -> None:
            with suppress(ConnectionClosed):
                try:
                    await asyncio.wait_for(connection.send(message), _GONE_AFTER)
                except asyncio.TimeoutError:
                    connection.transport.abort()  # a ping waits, too, for a page that never reads

        visitor = Visitor(send)
        self.audience.join(visitor)
        try:
            async for text in connection:
                self.audience.hear(visitor, text)
        except ConnectionClosed:
            pass
        finally:
            self.audience.leave(visitor)


def _response(status: HTTPStatus, body: bytes, kind: str = "text/plain", **headers: str) -> Response:
    policy = "default-src 'self' data: blob:; connect-src 'self' ws: wss:; style-src 'self' 'unsafe-inline'"
    fields = {
        "Content-Type": f"{kind}; charset=utf-8",
        "Content-Length": str(len(body)),
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "Content-Security-Policy": policy,
        "Connection": "close",
    }
    return Response(status.value, status.phrase, Headers(fields | headers), body)
