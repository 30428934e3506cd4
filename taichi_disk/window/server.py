"""The sandbox as a page: one server, one sandbox, which the first visitor plays with and the others watch.

`websockets` serves the page's files and its messages. This module adds access control: a token in the address, the
page's own origin, and a check of every message.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import socket
import sys
import webbrowser
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from time import perf_counter
from typing import Any

from websockets.asyncio.server import ServerConnection, serve as listen
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from taichi_disk.errors import TaichiDiskError
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.commands import MAX_BYTES, understood
from taichi_disk.window.controls import Entry
from taichi_disk.window.session import Session

LOCAL = ("127.0.0.1", "localhost")
FASTEST = 60.0  # pictures per second at most
_IN_FLIGHT = 2  # states that a page may have got and not yet drawn
_POLLED = 0.1  # between two looks at whether a signal has come [s]
_PAUSED_AFTER = 20.0  # a page that answers no ping for so long has gone [s]
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


def serve(playlist: list[Entry], host: str = LOCAL[0], port: int = 0, open_browser: bool = False) -> None:
    """Serve the sandbox until Ctrl-C. A `port` of 0: one that is free.

    Prints the address, with the token that every request needs. Raises TaichiDiskError if it cannot listen there,
    KeyboardInterrupt after Ctrl-C.
    """
    session = Session(playlist, KernelCache())
    try:
        listening = socket.create_server((host, port))
    except (OSError, OverflowError) as error:
        raise TaichiDiskError(f"cannot listen at {host}, port {port}: {error}; choose another --port") from None
    page = Page(session, secrets.token_urlsafe(16))
    try:
        asyncio.run(page.run(listening, host, open_browser))
    finally:
        if page.ignored:
            print(f"note: {page.ignored} malformed messages were ignored", file=sys.stderr)


class Visitor:
    """One page that is connected.

    Attributes:
        ready: set when something may have to be sent.
        drawn: number of the last state that the page has drawn.
    """

    def __init__(self, connection: ServerConnection) -> None:
        self.connection, self.ready = connection, asyncio.Event()
        self.drawn = 0
        self._states: list[int] = []  # numbers of states that are on their way
        self._texts: dict[str, str] = {}

    def acknowledge(self, number: float) -> None:
        """The page has drawn a state."""
        self._states = [one for one in self._states if one > number]
        self.ready.set()

    @property
    def can_take(self) -> bool:
        """Whether the page keeps up, so that it may be sent another state."""
        return len(self._states) < _IN_FLIGHT

    async def show(self, session: Session, plays: bool) -> None:
        """Send the texts that have changed, and the last state."""
        role = {"role": json.dumps({"kind": "role", "plays": plays})}
        state, number, texts = session.state, session.number, session.texts | role
        self.drawn = number
        self._states.append(number)
        for kind, text in texts.items():
            if self._texts.get(kind) is not text and self._texts.get(kind) != text:
                self._texts[kind] = text
                await self.connection.send(text)
        await self.connection.send(state)


class Page:
    """Serves `session`.

    Attributes:
        token: the first part of every path: nothing is served without it.
        ignored: number of malformed messages.
    """

    def __init__(self, session: Session, token: str) -> None:
        self.session, self.token, self.ignored = session, token, 0
        self._visitors: list[Visitor] = []  # who came first plays

    async def run(self, listening: socket.socket, host: str, open_browser: bool) -> None:
        """Serve until a signal comes, which is raised as KeyboardInterrupt."""
        logger = logging.getLogger("taichi_disk.page")
        logger.setLevel(logging.CRITICAL + 1)  # what strangers send is not worth a line
        options: dict[str, Any] = {"max_size": MAX_BYTES, "max_queue": 64, "compression": None, "server_header": None}
        options |= {"ping_timeout": _PAUSED_AFTER, "logger": logger}
        async with listen(self._meet, sock=listening, process_request=self.answer, **options):
            port, name = listening.getsockname()[1], socket.gethostname() if host == "0.0.0.0" else host
            address = f"http://{name}:{port}/{self.token}/"
            print(f"the sandbox is at {address}\nCtrl-C ends it", flush=True)
            if host not in LOCAL:
                print("note: whoever has this address and reaches this machine can play; nothing is encrypted", flush=True)
            if open_browser:
                webbrowser.open(address)
            while True:
                raise_if_interrupted()
                await asyncio.sleep(_POLLED)

    # ---- the door

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, or a refusal; None opens the websocket."""
        _, token, *rest = request.path.split("?")[0].split("/", 2)
        name = rest[0] if rest else ""
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return _response(HTTPStatus.FORBIDDEN, b"Use the whole address that `taichi-disk view` printed.")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            # A script of another site can open a websocket here, but not pretend that it comes from here.
            origin = request.headers.get("Origin", "").partition("://")[2]
            allowed = name == "socket" and origin and origin == request.headers.get("Host")
            return None if allowed else _response(HTTPStatus.FORBIDDEN, b"This websocket is for its own page.")
        if not rest:
            return _response(HTTPStatus.TEMPORARY_REDIRECT, b"", Location=f"/{self.token}/")
        name = name or "index.html"
        suffix = name[name.rfind(".") :]
        known = {one.name for one in files("taichi_disk.web").iterdir()}
        if suffix not in TYPES or name not in known:
            return _response(HTTPStatus.NOT_FOUND, b"There is no such file.")
        return _response(HTTPStatus.OK, files("taichi_disk.web").joinpath(name).read_bytes(), TYPES[suffix])

    async def _meet(self, connection: ServerConnection) -> None:
        visitor = Visitor(connection)
        self._visitors.append(visitor)
        self._wake()
        feeding = asyncio.create_task(self._feed(visitor))
        try:
            async for text in connection:
                message = understood(text)
                if message is None:
                    self.ignored += 1
                elif message["do"] == "seen":
                    visitor.acknowledge(message["number"])
                elif message["do"] == "yaml":
                    scene = self.session.sandbox.scene.to_yaml()
                    await connection.send(json.dumps({"kind": "yaml", "text": scene}))
                elif visitor is self._visitors[0]:
                    self.session.hear(message)
                    visitor.ready.set()
        except ConnectionClosed:
            pass
        finally:
            feeding.cancel()
            played = visitor is self._visitors[0]
            self._visitors.remove(visitor)
            if played:
                self.session.let_go(pause=not self._visitors)
                self._wake()

    def _wake(self) -> None:
        for one in self._visitors:
            one.ready.set()

    async def _feed(self, visitor: Visitor) -> None:
        """Send states for as long as the page draws them; the player's page is the clock of the sandbox."""
        session, role = self.session, None
        with suppress(ConnectionClosed):
            while True:
                began, plays = perf_counter(), visitor is self._visitors[0]
                visitor.ready.clear()
                if visitor.can_take and (
                    (plays and session.busy) or visitor.drawn < session.number or role is not plays
                ):
                    if plays and session.busy:
                        session.advance()
                        self._wake()
                    role = plays
                    await visitor.show(session, plays)
                    await asyncio.sleep(max(0.0, 1.0 / FASTEST - (perf_counter() - began)))
                else:
                    await visitor.ready.wait()


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
