"""The sandbox as a page: one server, one sandbox, which the first visitor plays with
and the others watch.

`websockets` serves the page's files and its messages. This module adds access control:
a token in the address, the page's own origin, and a check of every message.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import socket
import sys
import webbrowser
from functools import partial
from importlib.resources import files
from typing import Any

from websockets.asyncio import server
from websockets.http11 import Request, Response

from taichi_disk.errors import InputError
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import source
from taichi_disk.window.audience import Audience
from taichi_disk.window.controls import Entry
from taichi_disk.window.session import MAX_BYTES, Session

LOCAL_HOSTS = ("127.0.0.1", "localhost")
_POLL_INTERVAL = 0.1  # time between two checks for a signal [s]
# [bytes]; more than a scene and two states: those of 200,000 points have 10 MB
_WRITE_LIMIT = 2**26
_TYPES = {"html": "html", "js": "javascript", "css": "css"}  # text types by file suffix
_POLICY = (
    "default-src 'self' data: blob:; connect-src 'self' ws: wss:; style-src 'self'"
    " 'unsafe-inline'"
)
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": _POLICY,
}


def serve(
    playlist: list[Entry],
    host: str = LOCAL_HOSTS[0],
    port: int = 0,
    open_browser: bool = False,
) -> None:
    """Serve the sandbox until Ctrl-C, at a free port if `port` is 0.

    Prints the address, with the token that every request needs. Raises InputError if it
    cannot listen there, KeyboardInterrupt after Ctrl-C.
    """
    try:
        listening = socket.create_server((host, port))
    except (OSError, OverflowError) as error:
        raise InputError(
            f"cannot listen at {host}, port {port}: {error}; choose another --host or"
            " --port"
        ) from None
    audience, token = (
        Audience(Session(playlist, KernelCache())),
        secrets.token_urlsafe(16),
    )
    name = socket.gethostname() if host == "0.0.0.0" else host
    address = f"http://{name}:{listening.getsockname()[1]}/{token}/"
    print(f"the sandbox is at {address}\nCtrl-C ends it", flush=True)
    if host not in LOCAL_HOSTS:
        print(
            "note: whoever has this address and reaches this machine can play; nothing"
            " is encrypted",
            flush=True,
        )
    if open_browser:
        webbrowser.open(address)
    try:
        asyncio.run(run(audience, token, listening))
    finally:
        if audience.ignored:
            print(
                f"note: {audience.ignored} malformed messages were ignored",
                file=sys.stderr,
            )


async def run(audience: Audience, token: str, listening: socket.socket) -> None:
    """Serve until a signal, which raises KeyboardInterrupt, or until an error has ended
    `audience`."""
    # what strangers send is not logged
    logger = logging.Logger("page", logging.CRITICAL + 1)
    options: dict[str, Any] = {
        "max_size": MAX_BYTES,
        "compression": None,
        "server_header": None,
        "logger": logger,
    }
    # `websockets` would wait with its pings for a page that never reads.
    options |= {"process_request": partial(answer, token), "write_limit": _WRITE_LIMIT}
    async with server.serve(partial(_meet, audience), sock=listening, **options):
        playing = asyncio.create_task(audience.run())
        while not playing.done():
            raise_if_interrupted()
            await asyncio.wait([playing], timeout=_POLL_INTERVAL)
        playing.result()


async def _meet(audience: Audience, connection: server.ServerConnection) -> None:
    visitor = audience.join(
        partial(server.broadcast, [connection]),
        connection.transport.get_write_buffer_size,
    )
    try:
        async for text in connection:
            audience.hear(visitor, text)
    finally:
        audience.leave(visitor)


def answer(
    token: str, connection: server.ServerConnection, request: Request
) -> Response | None:
    """Return a file of the page, or a refusal; None opens the websocket. Every path
    begins with `token`."""
    _, first, name = (*request.path.split("?")[0].split("/", 2), "", "")[:3]
    if not secrets.compare_digest(first.encode(), token.encode()):
        return connection.respond(
            403, "Use the whole address that `taichi-disk view` printed."
        )
    if request.headers.get("Upgrade", "").lower() == "websocket":
        # A script of another site can open a websocket here, but not pretend that it
        # comes from here.
        origin = request.headers.get("Origin", "").partition("://")[2]
        if name == "socket" and origin and origin == request.headers.get("Host"):
            return None
        return connection.respond(403, "This websocket accepts only its own page.")
    if request.path == f"/{token}":
        response = connection.respond(307, "")
        response.headers["Location"] = f"/{token}/"
        return response
    name = name or "index.html"
    kind = _TYPES.get(name.rpartition(".")[2])
    if not kind or name not in {one.name for one in files("taichi_disk.web").iterdir()}:
        return connection.respond(404, "There is no such file.")
    response = connection.respond(200, source(name))
    del response.headers["Content-Type"]
    response.headers.update({"Content-Type": f"text/{kind}; charset=utf-8"} | _HEADERS)
    return response
