"""The sandbox as a page: one server, and a sandbox for each page.

`websockets` serves the page's files and its messages. `door.py` decides who may come.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import secrets
import socket
import webbrowser
from contextlib import suppress
from functools import partial
from threading import Thread
from urllib.parse import urlsplit

from websockets.asyncio import server

from taichi_disk.base.errors import InputError, TaichiDiskError
from taichi_disk.base.runtime import alone
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.sandbox.controls import Preset
from taichi_disk.sandbox.door import answer
from taichi_disk.sandbox.history import Timeline, start_of
from taichi_disk.sandbox.page import Page
from taichi_disk.sandbox.session import MAX_BYTES, Session

LOCAL_HOST = "127.0.0.1"
QUIET_TIME = 1.0  # between two kernels that are compiled in advance [s]
KEPT = 8  # sessions that a page finds again
_POLL_INTERVAL = 0.1  # time between two checks for a signal [s]
_CLOSE_TIME = 0.5  # time that pages get for saying goodbye at the end [s]


class Sessions:
    """The sessions of the pages, by the keys that the pages have chosen."""

    def __init__(self, playlist: list[Preset]) -> None:
        self._playlist = playlist
        self._known: dict[str, Session] = {}

    def find(self, key: str) -> Session:
        """Return the session with this key, or a new one; the last ones are kept."""
        known = self._known
        session = known.pop(key, None) or Session(self._playlist)
        known[key] = session
        if len(known) > KEPT:
            del known[next(iter(known))]
        return session

    async def compile(self) -> None:
        """Compile the kernels of the list while nobody plays, so that nobody waits when
        a scene is chosen."""
        known = self._known
        for entry in self._playlist:
            await asyncio.sleep(QUIET_TIME)
            while not known or any(one.is_busy for one in known.values()):
                await asyncio.sleep(QUIET_TIME)
            with suppress(TaichiDiskError):
                Timeline(start_of(entry.load()))


def serve(
    playlist: list[Preset],
    host: str = LOCAL_HOST,
    port: int = 0,
    open_browser: bool = False,
) -> None:
    """Serve the sandbox until Ctrl-C, at a free port if `port` is 0.

    Prints the address, with the token that every request needs. Raises InputError if
    the server cannot listen there, TaichiDiskError if the first scene cannot be built,
    KeyboardInterrupt after Ctrl-C.
    """
    listening = _listen(host, port)
    # The page shows that its kernels are compiled, so they wait for it.
    start_of(playlist[0].load())
    sessions = Sessions(playlist)
    token = secrets.token_urlsafe(8)
    name = f"[{host}]" if ":" in host else host
    address = f"http://{name}:{listening.getsockname()[1]}/{token}/"
    # A pass of the garbage collector over all modules would hold up the disks.
    gc.collect()
    gc.freeze()
    print("the sandbox is at", address)
    print("Ctrl-C ends it", flush=True)
    if open_browser:
        # A browser in the foreground returns when it is closed.
        Thread(target=webbrowser.open, args=[address], daemon=True).start()
    with alone():
        asyncio.run(run(sessions, token, listening))


def _listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at a name or address, of IPv4 if it has one.

    Raises InputError if it cannot listen there.
    """
    if not host:
        raise InputError(
            "--host is empty: write 127.0.0.1 for this machine alone, or its address in"
            " a network"
        )
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        found.sort(key=lambda one: one[0] != socket.AF_INET)
        family, *_, address = found[0]
        return socket.create_server(address, family=family)
    except (OSError, OverflowError, UnicodeError) as error:
        raise InputError(
            f"cannot listen at {host}, port {port}: {error}; choose another --host or"
            " --port"
        ) from None


async def run(sessions: Sessions, token: str, listening: socket.socket) -> None:
    """Serve until a signal, which raises KeyboardInterrupt."""
    # what strangers send is not logged
    logger = logging.Logger("page", logging.CRITICAL + 1)
    serving = await server.serve(
        partial(_meet, sessions),
        sock=listening,
        process_request=partial(answer, token),
        max_size=MAX_BYTES,
        close_timeout=_CLOSE_TIME,
        compression=None,
        server_header=None,
        logger=logger,
    )
    compiling = asyncio.create_task(sessions.compile())
    try:
        while True:
            raise_if_interrupted()
            await asyncio.sleep(_POLL_INTERVAL)
    finally:
        compiling.cancel()
        serving.close()
        # `wait_closed` also waits for connections that have asked for nothing yet.
        closed = asyncio.ensure_future(serving.wait_closed())
        await asyncio.wait([closed], timeout=2.0 * _CLOSE_TIME)


async def _meet(sessions: Sessions, connection: server.ServerConnection) -> None:
    key = urlsplit(connection.request.path).query if connection.request else ""
    page = Page(sessions.find(key), partial(server.broadcast, [connection]))
    try:
        async for text in connection:
            page.hear(text)
    finally:
        page.leave()
